"""Faults of one bus together: what they do to its frames and to the CAN controllers of its drives.

A bus is told its disturbance at each tick at which one of these faults begins or ends, made anew of
all that act. On a bus of its own all frames are a robot's. Where robots share a bus they are told
apart by the node that the drives' protocol reads from the identifier: frames of no node, and of
other protocols, are then no robot's.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from bridge.drives import protocol
from bridge.drives.interface import DriveNode
from bridge.fault_schedule import Change
from bridge.frame import Frame
from bridge.frame_faults import ActingFrameFault, Concerns
from configs.faults.base import PlannedFault, WheelFault
from configs.faults.buses import FrameFault, NodeBabbling
from plant.effects import of_side
from plant.robot import EmulatedRobot

BABBLE: Final = bytes(8)
"""Data of the frames of a node that babbles."""


@dataclass(slots=True)
class Disturbance:
    """What acts on one bus."""

    frames: list[ActingFrameFault] = field(default_factory=list)
    silent: list[DriveNode] = field(default_factory=list)
    cut: list[EmulatedRobot] = field(default_factory=list)
    """Robots whose drives hear, and are heard by, nobody but each other."""
    babbling: list[tuple[DriveNode, Frame, int]] = field(default_factory=list)
    """Drives whose controllers babble, with frame and period [ns]; the last entry counts."""
    bus_off: list[DriveNode] = field(default_factory=list)
    """Go bus-off now."""


@dataclass(slots=True)
class _Acting:
    """A fault of a bus on one robot."""

    planned: PlannedFault
    robot: EmulatedRobot
    frame_fault: ActingFrameFault | None

    @property
    def drives(self) -> Sequence[DriveNode]:
        fault = self.planned.fault
        return of_side(self.robot.drives, fault.wheel if isinstance(fault, WheelFault) else "both")


def _frames(acting: _Acting, on: Disturbance) -> None:
    if acting.frame_fault is not None:
        on.frames.append(acting.frame_fault)


def _cut(acting: _Acting, on: Disturbance) -> None:
    on.cut.append(acting.robot)


def _silent(acting: _Acting, on: Disturbance) -> None:
    on.silent += acting.drives


def _bus_off(acting: _Acting, on: Disturbance) -> None:
    on.bus_off += acting.drives


def _babbling(acting: _Acting, on: Disturbance) -> None:
    fault = acting.planned.fault
    if isinstance(fault, NodeBabbling):
        frame = Frame(fault.can_id, BABBLE)
        period_ns = round(fault.period_s * 1e9)
        on.babbling += [(drive, frame, period_ns) for drive in acting.drives]


BUS_EFFECTS: Final[Mapping[str, Callable[[_Acting, Disturbance], None]]] = {
    "can_drop": _frames,
    "can_duplicate": _frames,
    "can_corrupt": _frames,
    "can_delay": _frames,
    "bus_cut": _cut,
    "node_silent": _silent,
    "node_bus_off": _bus_off,
    "node_babbling": _babbling,
}
"""By kind."""


class Disturbances:
    """Follows the faults of one bus.

    Args:
        robots: on it.
    """

    __slots__ = ("_acting", "_concerns", "_robots", "disturb")

    def __init__(self, robots: Sequence[EmulatedRobot]) -> None:
        shared = len(robots) > 1
        self._robots = {robot.brief.robot: robot for robot in robots}
        self._concerns = {r.brief.robot: _concerns(r) if shared else None for r in robots}
        self._acting: list[_Acting] = []
        self.disturb: Callable[[Disturbance], None] = lambda _: None
        """Set by the bus."""

    def follow(self, planned: Sequence[PlannedFault], changes: Sequence[Change]) -> None:
        """Tell the bus what acts from now on, if faults of buses are among the changes."""
        if not any(change.planned.fault.kind in BUS_EFFECTS for change in changes):
            return
        disturbance = Disturbance()
        # An order may have changed when one ends: it is the same fault, and goes on counting.
        kept = {(id(one.planned.fault), one.planned.target): one for one in self._acting}
        self._acting = [
            kept.get((id(one.fault), one.target)) or self._begin(one)
            for one in planned
            if one.fault.kind in BUS_EFFECTS
        ]
        now = [c.planned for c in changes if c.acts and c.planned.fault.INSTANT]
        instants = [self._begin(one) for one in now if one.fault.kind in BUS_EFFECTS]
        for acting in (*self._acting, *instants):
            BUS_EFFECTS[acting.planned.fault.kind](acting, disturbance)
        self.disturb(disturbance)

    def _begin(self, planned: PlannedFault) -> _Acting:
        robot, fault = self._robots[planned.target], planned.fault
        frame_fault = None
        if isinstance(fault, FrameFault):
            frame_fault = ActingFrameFault(fault, self._concerns[planned.target])
        return _Acting(planned, robot, frame_fault)


def _concerns(robot: EmulatedRobot) -> Concerns:
    """Whether a frame is one of a robot, by the node in its identifier."""
    brief = robot.brief
    node_seen = protocol(brief.drive.choice.plugin).node_seen
    nodes = (brief.right_node, brief.left_node)

    def concerns(frame: Frame) -> bool:
        seen = node_seen(frame)
        return seen is not None and seen.node in nodes

    return concerns
