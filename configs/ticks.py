"""What is asked of a schedule at every tick, compiled: what is due at one, and when one is."""

from configs.brief import Schedule


class Ticks:
    """Of one schedule, in numbers of its own.

    Args:
        schedule: of the run.
    """

    __slots__ = (
        *("_countdown_ticks", "_localise_every", "_period_ns", "_pose_delay_ticks"),
        *("_share_every", "place_delay_ticks"),
    )

    def __init__(self, schedule: Schedule) -> None:
        self._countdown_ticks = schedule.countdown_ticks
        self._period_ns = schedule.period_ns
        self._share_every = schedule.share_every
        self._localise_every = schedule.localise_every
        self._pose_delay_ticks = schedule.pose_delay_ticks
        self.place_delay_ticks = max(schedule.pose_delay_ticks, 1)
        """Delay of other robots' poses to the emulated network: a tick or more."""

    def shares(self, tick: int) -> bool:
        """Whether path states are due at a tick."""
        return tick >= 0 and tick % self._share_every == 0

    def localises(self, tick: int) -> bool:
        """Whether the localisation system takes poses at a tick."""
        return tick >= 0 and tick % self._localise_every == 0

    def owes(self, tick: int) -> bool:
        """Whether a pose or path states are due at a tick."""
        return (
            self.shares(tick)
            or self.localises(tick - self._pose_delay_ticks)
            or self.localises(tick - self.place_delay_ticks)
        )

    def bus_time_ns(self, tick: int) -> int:
        """Bus time of a tick: nanoseconds since power-up, 0 at the first tick of the countdown."""
        return (tick + self._countdown_ticks) * self._period_ns
