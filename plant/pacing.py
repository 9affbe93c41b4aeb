"""The pace of a lockstep run: which ticks may begin, and when. Pure: it is told the time.

    as fast as it can    a bus may be up to `LEAD_TICKS` ahead of the slowest one
    at a speed           all go tick by tick together; tick k begins at the wall time
                         t_0 + (k − k_0) h / speed, k_0 the tick at which the speed was set
    paused               no tick after `last_tick` begins: a bus that is behind goes on up to it

Pauses, steps and speeds change when ticks are computed, never what is computed.
"""

from configs.brief import LEAD_TICKS, Schedule
from configs.edges import FOREVER


class Pacing:
    """The pace of one run.

    Args:
        schedule: of the run.
        speed: multiple of real time; 0: as fast as the machine allows.
    """

    __slots__ = ("_from_ns", "_from_tick", "_period_ns", "_ticks", "last_tick", "speed", "tick_ns")

    def __init__(self, schedule: Schedule, speed: float = 0.0) -> None:
        self._period_ns, self._ticks = schedule.period_ns, schedule.ticks
        self._from_tick = self._from_ns = 0
        self.speed = speed
        self.tick_ns = 0
        """Wall time of a tick [ns]; 0: as fast as it can."""
        self.last_tick = FOREVER
        """The last tick that may begin."""
        self.set_speed(speed, 0, 0)

    @property
    def paused(self) -> bool:
        """Whether there is a last tick."""
        return self.last_tick < FOREVER

    @property
    def window(self) -> int:
        """How far a bus may be ahead of the slowest one [ticks]."""
        return 0 if self.tick_ns else LEAD_TICKS

    def due_ns(self, tick: int) -> int:
        """The wall time at which a tick may begin; 0: at any."""
        return self._from_ns + (tick - self._from_tick) * self.tick_ns if self.tick_ns else 0

    def anchor(self, tick: int, now_ns: int) -> None:
        """Count wall time from a tick that begins now."""
        self._from_tick, self._from_ns = tick, now_ns

    def set_speed(self, speed: float, tick: int, now_ns: int) -> None:
        """Keep to a multiple of real time from a tick on that begins now; 0: to none."""
        self.speed = speed
        self.tick_ns = max(round(self._period_ns / speed), 1) if speed > 0.0 else 0
        self.anchor(tick, now_ns)

    def pause(self, begun: int) -> int | str:
        """Let no tick after those that were begun begin; the last one, or why not."""
        if begun >= self._ticks:
            return "the run is at its last tick"
        self.last_tick = min(self.last_tick, begun)
        return self.last_tick

    def step(self, ticks: int) -> int | str:
        """Let so many more ticks begin; the last one, or why not."""
        if not self.paused:
            return "the run isn't paused"
        self.last_tick = min(self.last_tick + ticks, self._ticks)
        return self.last_tick

    def resume(self) -> None:
        """Let all ticks begin again."""
        self.last_tick = FOREVER
