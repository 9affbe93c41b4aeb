"""Ticks at which messages are due at controllers."""

from configs.brief import Schedule


class Dues:
    """Of one schedule, in numbers of its own: it is asked at every tick."""

    __slots__ = ("_localise_every", "_place_delay_ticks", "_pose_delay_ticks", "_share_every")

    def __init__(self, schedule: Schedule) -> None:
        self._share_every = schedule.share_every
        self._localise_every = schedule.localise_every
        self._pose_delay_ticks = schedule.pose_delay_ticks
        self._place_delay_ticks = schedule.place_delay_ticks

    def shares(self, tick: int) -> bool:
        """Whether path states are due at a tick, as `Schedule.shares`."""
        return tick >= 0 and tick % self._share_every == 0

    def localises(self, tick: int) -> bool:
        """Whether the localisation system takes poses at a tick, as `Schedule.localises`."""
        return tick >= 0 and tick % self._localise_every == 0

    def owes(self, tick: int) -> bool:
        """Whether a pose or path states are due at a tick."""
        return (
            self.shares(tick)
            or self.localises(tick - self._pose_delay_ticks)
            or self.localises(tick - self._place_delay_ticks)
        )
