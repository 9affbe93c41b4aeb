"""Faults of frames, buses and the CAN controllers of drives."""

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le

from configs.faults.base import Model, RobotFault, WheelFault
from configs.parameters import parameter


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameFault(RobotFault):
    """Frames on the buses of robots, by identifier and direction."""

    can_id: Annotated[int, Ge(0), Le((1 << 29) - 1)] | None = parameter(None, "any if not given")
    direction: Literal["to_drives", "from_drives", "both"] = "both"
    count: Annotated[int, Ge(1), Le(10**9)] | None = parameter(
        None, "so many frames; all while it lasts if not given"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameChange(FrameFault):
    """Frames are lost (drop), or come twice (duplicate)."""

    kind: Literal["can_drop", "can_duplicate"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameCorruption(FrameFault):
    """A bit of the frames is flipped on the wire: an error frame, and they are sent again."""

    NEEDS: ClassVar[frozenset[Model]] = frozenset({"wire"})
    kind: Literal["can_corrupt"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameDelay(FrameFault):
    """Frames are held back for this long."""

    kind: Literal["can_delay"]
    delay_s: Annotated[float, Gt(0), Le(60)] = 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class BusCut(RobotFault):
    """No frame passes between the robots' controllers and their drives."""

    kind: Literal["bus_cut"]


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeSilent(WheelFault):
    """A drive's CAN controller says and hears nothing."""

    kind: Literal["node_silent"]


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeBusOff(WheelFault):
    """A drive's CAN controller is bus-off; `bus.drive_restart_s` says whether it comes back."""

    INSTANT: ClassVar[bool] = True
    NEEDS: ClassVar[frozenset[Model]] = frozenset({"wire"})
    kind: Literal["node_bus_off"]


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeBabbling(WheelFault):
    """A drive's CAN controller sends a frame again and again."""

    NEEDS: ClassVar[frozenset[Model]] = frozenset({"wire"})
    kind: Literal["node_babbling"]
    can_id: Annotated[int, Ge(0), Le((1 << 11) - 1)] = 0
    period_s: Annotated[float, Ge(1e-5), Le(60)] = 0.0005
