"""The bus as the clock of a controller in lockstep: the tick that is due at each frame.

A tick is due once both drives' encoder frames have arrived at its bus time or later, or when the
bus's question of that tick ends without one of them: the controller then acts on its last feedback.
Each tick is due once, in order.
"""

from bridge.drives.interface import DriveClient
from configs.brief import Schedule
from configs.ticks import Ticks


class BusClock:
    """Counts the ticks of one controller.

    Args:
        drives: of the robot; both encoder frames have to be in.
        first: the first tick that is due; the first of the countdown, if none is given.
    """

    __slots__ = ("_drives", "_due_ns", "_next", "_period_ns")

    def __init__(self, schedule: Schedule, drives: DriveClient, first: int | None = None) -> None:
        self._drives = drives
        self._period_ns = schedule.period_ns
        self._next = -schedule.countdown_ticks if first is None else first
        self._due_ns = Ticks(schedule).bus_time_ns(self._next)

    def due(self, now_ns: int) -> int | None:
        """The tick to compute after a frame of bus time `now_ns`; None if none is due."""
        if now_ns >= self._due_ns and self._drives.feedback_since(self._due_ns - 1):
            return self._advance()
        return None

    def due_at_end(self, asked_ns: int) -> int | None:
        """The tick to compute at the end of the bus's question of bus time `asked_ns` [ns].

        None if it was due before.
        """
        return self._advance() if asked_ns >= self._due_ns else None

    def _advance(self) -> int:
        tick = self._next
        self._next = tick + 1
        self._due_ns += self._period_ns
        return tick
