"""Faults of the plant: what acts on the robots of one bus, tick by tick.

At a tick at which something changes, the effects of a robot are made anew of all the faults that
act on it, in the order in which they began; so one that ends leaves the others as they are. Faults
that are an instant strike once.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from bridge.fault_schedule import FaultSchedule
from configs.faults.base import PlannedFault
from plant.robot import EmulatedRobot

Effect = Callable[[EmulatedRobot, Any], None]
"""Lets a fault, of its kind's class, act on a robot."""


def _push(robot: EmulatedRobot, fault: Any) -> None:
    robot.push(fault.force_body_N, fault.torque_body_N_m)


EFFECTS: Mapping[str, Effect] = {
    "push": _push,
}
"""By kind."""


class BusFaults:
    """The faults of the robots on one bus."""

    __slots__ = ("_robots", "schedule")

    def __init__(self, planned: Iterable[PlannedFault], robots: Sequence[EmulatedRobot]) -> None:
        self._robots = {robot.brief.robot: robot for robot in robots}
        self.schedule = FaultSchedule(one for one in planned if one.target in self._robots)

    def begin(self, tick: int) -> None:
        """Let the faults of a tick act, bodies being where they are at that instant."""
        if tick >= self.schedule.next_tick:
            self._change(tick)

    def _change(self, tick: int) -> None:
        changes = self.schedule.due(tick)
        for name in dict.fromkeys(change.planned.target for change in changes):
            robot = self._robots[name]
            robot.clear_faults()
            for planned in self.schedule.acting:
                if planned.target == name:
                    EFFECTS[planned.fault.kind](robot, planned.fault)
        for change in changes:
            if change.acts and change.planned.fault.INSTANT:
                EFFECTS[change.planned.fault.kind](
                    self._robots[change.planned.target], change.planned.fault
                )
