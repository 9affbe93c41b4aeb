"""The ticks at which the process of a controller is absent by faults.

The plant, which in lockstep waits for no absent controller, and the launcher, which wakes processes
and starts them again, go by the same list.
"""

from collections.abc import Iterable
from typing import NamedTuple

from configs.edges import FOREVER
from configs.faults.base import PlannedFault
from configs.faults.processes import ProcessRestart, ProcessStopped


class Absence(NamedTuple):
    """The process of one robot's controller doesn't act at these ticks."""

    name: str  # of the fault
    robot: str
    from_tick: int
    to_tick: int | None  # the first tick at which it acts again; None: there is none
    frozen: bool
    """Whether the process is there; otherwise it is killed."""

    def lasts_at(self, tick: int) -> bool:
        """Whether the controller is absent at a tick."""
        return self.from_tick <= tick and (self.to_tick is None or tick < self.to_tick)

    def ended(self, tick: int) -> "Absence":
        """The same, ended at a tick if not before; it lasts for a tick at least."""
        if self.to_tick is not None and self.to_tick <= tick:
            return self
        return self._replace(to_tick=max(tick, self.from_tick + 1))


def absences(planned: Iterable[PlannedFault], ticks: int = FOREVER) -> tuple[Absence, ...]:
    """The absences by all faults that kill or freeze, in a run of `ticks`, by tick and robot."""
    found = []
    for one in planned:
        # Killed at a tick, it can't act at that tick any more.
        next_tick = one.from_tick + 1
        match one.fault:
            case ProcessRestart():
                found.append(Absence(one.name, one.target, one.from_tick, next_tick, False))
            case ProcessStopped(kind=kind):
                until = None if one.to_tick is None else max(one.to_tick, next_tick)
                frozen = kind == "process_freeze"
                found.append(Absence(one.name, one.target, one.from_tick, until, frozen))
    found = [
        one if one.to_tick is None or one.to_tick < ticks else one._replace(to_tick=None)
        for one in found
    ]
    return tuple(sorted(found, key=lambda it: (it.from_tick, it.robot)))


class Overlap(NamedTuple):
    """Two absences of one robot at the same time."""

    before: Absence
    after: Absence

    def problem(self, period_s: float) -> str:
        """Why the later one can't be."""
        since_s = round(self.before.from_tick * period_s, 9)
        remedy = f"of {self.after.robot} is absent from {since_s:g} s on"
        return f"the process {remedy}, and can't be killed or frozen then"


def overlapping(absent: Iterable[Absence]) -> Overlap | None:
    """Two absences of one robot at the same time; None if there are none."""
    newest: dict[str, Absence] = {}
    for one in sorted(absent, key=lambda it: it.from_tick):
        before = newest.get(one.robot)
        if before is not None and (before.to_tick is None or one.from_tick < before.to_tick):
            return Overlap(before, one)
        newest[one.robot] = one
    return None
