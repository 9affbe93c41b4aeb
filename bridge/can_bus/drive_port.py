"""Port through which the plant's emulated drives receive and send CAN frames, whatever the bus.

`hub.Hub` serves emulated buses, `external.ExternalBuses` serves buses of any python-can interface,
`external.CombinedPort` serves both.
"""

from collections.abc import Sequence
from typing import Protocol

from bridge.frame import Frame


class DrivePort(Protocol):
    """Where emulated drives hear and speak."""

    def deliver(self, name: str, stamp_ns: int, frames: Sequence[Frame]) -> None:
        """Send frames of the drives, in order, over a bus at bus time `stamp_ns`."""

    def serve(self, timeout_s: float) -> None:
        """Handle what happens on the buses; waits at most `timeout_s`."""

    def pending(self) -> list[str]:
        """Buses with something to take."""

    def receive(self, name: str) -> list[Frame]:
        """What others sent on a bus since the last take, in order."""

    def clients(self) -> int:
        """How many may be listening."""

    def troubles(self) -> dict[str, str]:
        """Buses that failed at times or lost frames, in words."""

    def close(self, reason: str) -> None:
        """Leave all buses. Idempotent."""
