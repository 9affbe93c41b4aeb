"""Awake time: a clock for deadlines that stands still while the process doesn't run.

Who waits looks at the clock at least every `LOOK_S`. When two looks are much further apart than
that, the process did not run meanwhile: it was stopped (Ctrl-Z, SIGSTOP), starved of processor
time, or its machine stood still. What it waited for may have come in that time or stood still as
well, so the time doesn't count. Nor does time in which the launcher is stopped: its router carries
all messages.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

from bridge.process.clock import SYSTEM_CLOCK, Clock

LOOK_S: Final = 0.1
STALL_S: Final = 0.25
"""Beyond what a wait was to last: this much later is no lateness any more."""
LATE_S: Final = 0.04
"""For who keeps absolute deadlines: who is so late may be taken for silent by others."""
AFTERMATH_S: Final = 0.5
"""What happens so soon after a stall may be its doing."""
MAX_STALLS: Final = 32


def _never() -> bool:
    return False


def _ignore(_stall_s: float) -> None:
    pass


class AwakeClock:
    """Counts the seconds in which this process was awake; keep it looked at.

    Args:
        look_s: longest time between two looks, if all is well [s].
        stall_s: what is later than that by so much is a stall [s].
        held: whether those that are waited for are held up at this moment; asked after real waits.
        on_stall: told of every stall: how long it was [s].
        clock: the machine's.
    """

    __slots__ = (
        *("_held", "_look_s", "_looked_s", "_lost_s", "_clock", "_on_stall", "_stall_s"),
        "longest_late_s",
    )

    def __init__(
        self,
        *,
        look_s: float = LOOK_S,
        stall_s: float = STALL_S,
        held: Callable[[], bool] = _never,
        on_stall: Callable[[float], None] = _ignore,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._look_s = look_s
        self._stall_s = stall_s
        self._held = held
        self._on_stall = on_stall
        self._clock = clock
        self._looked_s = clock.monotonic_s()
        self._lost_s = 0.0
        self.longest_late_s = 0.0
        """The longest that a look came later than it should have."""

    def now(self) -> float:
        """Seconds on a clock that stood still while this process did."""
        now_s = self._clock.monotonic_s()
        gap_s = now_s - self._looked_s
        self._looked_s = now_s
        self.longest_late_s = max(self.longest_late_s, gap_s - self._look_s)
        if gap_s > self._look_s + self._stall_s:
            self._lost_s += gap_s - self._look_s
            self._on_stall(gap_s - self._look_s)
        elif gap_s >= 0.5 * self._look_s and self._held():
            self._lost_s += gap_s
        return now_s - self._lost_s

    def resume(self) -> None:
        """What was done since the last look took its time, and was no wait."""
        self._looked_s = self._clock.monotonic_s()


class Stall(NamedTuple):
    """Of who keeps absolute deadlines."""

    tick: int  # the first that came late
    lasted_s: float


class Lateness:
    """Finds the stalls of who keeps absolute deadlines, tick by tick."""

    __slots__ = ("_limit_s", "_period_s", "_until", "late", "stalls")

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._limit_s = max(LATE_S, 2.0 * period_s)
        self._until = 0
        self.late = False
        """Whether there is a stall that is not caught up with, or was until `AFTERMATH_S` ago."""
        self.stalls: list[Stall] = []

    def note(self, tick: int, late_s: float) -> bool:
        """A tick comes so late; whether a stall begins with it."""
        if late_s > self._limit_s:
            begins = not self.late
            self._until = tick + round((late_s + AFTERMATH_S) / self._period_s)
            if begins and len(self.stalls) < MAX_STALLS:
                self.stalls.append(Stall(tick, late_s))
            self.late = True
            return begins
        if self.late and tick > self._until:
            self.late = False
        return False
