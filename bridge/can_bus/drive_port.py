"""Port through which the plant's emulated drives receive and send CAN frames, whatever the bus.

`hub.Hub` serves emulated buses, `external.ExternalBuses` serves buses of any python-can interface,
`external.CombinedPort` serves both.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence

from mypy_extensions import mypyc_attr

from bridge.frame import Frame


@mypyc_attr(allow_interpreted_subclasses=True)
class DrivePort(ABC):
    """Where emulated drives hear and speak."""

    @abstractmethod
    def deliver(self, name: str, stamp_ns: int, frames: Sequence[Frame]) -> None:
        """Send frames of the drives, in order, over a bus at bus time `stamp_ns`."""

    @abstractmethod
    def serve(self, timeout_s: float) -> None:
        """Handle what happens on the buses; waits at most `timeout_s`."""

    @abstractmethod
    def pending(self) -> list[str]:
        """Buses with something to take."""

    @abstractmethod
    def receive(self, name: str) -> list[Frame]:
        """What others sent on a bus since the last take, in order."""

    @abstractmethod
    def clients(self) -> int:
        """How many may be listening."""

    @abstractmethod
    def troubles(self) -> dict[str, str]:
        """Buses that failed at times or lost frames, in words."""

    @abstractmethod
    def close(self, reason: str) -> None:
        """Leave all buses. Idempotent."""


@mypyc_attr(allow_interpreted_subclasses=True)
class WaitablePort(DrivePort):
    """A drive port with a descriptor to wait for."""

    @abstractmethod
    def fileno(self) -> int:
        """A descriptor that is readable when there is something to handle."""
