"""The faults of one bus or one controller on their way through the ticks. Pure.

Planned faults come from the scenario, others are ordered during a run. At a tick faults end first,
then others begin, each in the order in which they came.
"""

from collections.abc import Iterable
from typing import NamedTuple

from configs.edges import FOREVER, hearer
from configs.events import Event
from configs.faults.base import PlannedFault


class Change(NamedTuple):
    """A fault that begins or ends at a tick."""

    tick: int
    planned: PlannedFault
    acts: bool
    """Whether it acts from this tick on; of one that is an instant: it acts at this tick."""

    @property
    def event(self) -> Event:
        """The change as an event of its robot: of a link, of the one that hears it."""
        name, target, fault, *_ = self.planned
        robot = hearer(target)
        kind = "" if name == fault.kind else f" ({fault.kind})"
        where = "" if robot == target else f" on {target}"
        what = "fault_applied" if self.acts else "fault_cleared"
        return Event(self.tick, robot, what, f"{name}{kind}{where}")


class FaultSchedule:
    """Says at each tick which faults begin and end."""

    __slots__ = ("_acting", "_waiting", "next_tick")

    def __init__(self, planned: Iterable[PlannedFault]) -> None:
        self._waiting = list(planned)
        self._acting: list[PlannedFault] = []
        self.next_tick = FOREVER
        """Nothing changes before; loops compare it with their tick."""
        self._look()

    @property
    def acting(self) -> tuple[PlannedFault, ...]:
        """The faults that act, in the order in which they began; instants are over at once."""
        return tuple(self._acting)

    @property
    def known(self) -> tuple[PlannedFault, ...]:
        """The faults that act or wait."""
        return (*self._acting, *self._waiting)

    def knows(self, name: str, target: str) -> bool:
        """Whether a fault of this name waits or acts on a target."""
        return any((one.name, one.target) == (name, target) for one in self.known)

    def add(self, planned: PlannedFault) -> None:
        """Take a fault that was ordered; one whose tick has gone acts at the next."""
        self._waiting.append(planned)
        self._look()

    def clear(self, name: str, tick: int) -> bool:
        """End a fault at a tick, on all targets; whether there was one of this name.

        One that would begin at that tick or later is forgotten.
        """
        of_name = [one for one in (*self._waiting, *self._acting) if one.name == name]
        self._waiting = [
            self._ended(one, name, tick)
            for one in self._waiting
            if one.name != name or one.from_tick < tick
        ]
        self._acting = [self._ended(one, name, tick) for one in self._acting]
        self._look()
        return bool(of_name)

    @staticmethod
    def _ended(one: PlannedFault, name: str, tick: int) -> PlannedFault:
        if one.name != name:
            return one
        return one._replace(to_tick=tick if one.to_tick is None else min(one.to_tick, tick))

    def due(self, tick: int) -> list[Change]:
        """The changes at a tick; `acting` is then what acts from it on."""
        if tick < self.next_tick:
            return []
        ended = [one for one in self._acting if _is_over(one, tick)]
        self._acting = [one for one in self._acting if not _is_over(one, tick)]
        # Of a controller that was started again some are over.
        begun = [one for one in self._waiting if one.from_tick <= tick and not _is_over(one, tick)]
        self._waiting = [one for one in self._waiting if one.from_tick > tick]
        self._acting += [one for one in begun if not one.fault.INSTANT]
        changes = [Change(tick, one, False) for one in ended]
        changes += [Change(tick, one, True) for one in begun]
        self._look()
        return changes

    def _look(self) -> None:
        begins = [one.from_tick for one in self._waiting]
        ends = [one.to_tick for one in self._acting if one.to_tick is not None]
        self.next_tick = min((*begins, *ends), default=FOREVER)


def _is_over(one: PlannedFault, tick: int) -> bool:
    return one.to_tick is not None and one.to_tick <= tick
