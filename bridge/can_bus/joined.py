"""Both ends as one: some robots on our own buses, others on any other.

Whoever waits here waits for all buses at once.
"""

from collections.abc import Sequence

from bridge.can_bus.drive_port import Crossed, DriveEnd
from bridge.can_bus.external import AttachedBuses
from bridge.frame import Frame
from bridge.waiting import readable


class JoinedEnds:
    """Two ends as one; each bus is on one of them."""

    def __init__(self, ours: DriveEnd, others: AttachedBuses, names: Sequence[str]) -> None:
        self._ours = ours
        self._others = others
        self._of_others = frozenset(names)
        self._both: tuple[DriveEnd, ...] = (ours, others)

    def _end_of(self, name: str) -> DriveEnd:
        return self._others if name in self._of_others else self._ours

    def deliver(self, name: str, stamp_ns: int, frames: Sequence[Frame]) -> None:
        """Send frames of the drives, in order, over a bus at bus time `stamp_ns`."""
        self._end_of(name).deliver(name, stamp_ns, frames)

    def serve(self, timeout_s: float) -> None:
        """Handle what happens on the buses; waits at most `timeout_s`."""
        readable(self._both, self._others.patience(timeout_s))
        for end in self._both:
            end.serve(0.0)

    def heard(self) -> list[str]:
        """Buses with something to take."""
        return [name for end in self._both for name in end.heard()]

    def take(self, name: str) -> list[Frame]:
        """What others sent on a bus since the last take, in order."""
        return self._end_of(name).take(name)

    def clients(self) -> int:
        """How many may be listening."""
        return sum(end.clients() for end in self._both)

    def counters(self, name: str) -> Crossed:
        """What went over a bus so far."""
        return self._end_of(name).counters(name)

    def troubles(self) -> dict[str, str]:
        """Buses that failed at times, and how."""
        return self._ours.troubles() | self._others.troubles()

    def fileno(self) -> int:
        """The first end's descriptor."""
        return self._ours.fileno()

    def close(self, reason: str) -> None:
        """Leave all buses. Idempotent."""
        for end in self._both:
            end.close(reason)
