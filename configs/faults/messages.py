"""Faults of messages: poses of the localisation system, and links between robots."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le, Len

from configs.faults.base import Fault, Place, RobotFault
from configs.netem import Delay_s, Probability
from configs.parameters import Finite

Angle_rad = Annotated[float, Ge(-3.2), Le(3.2)]


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseOffset(RobotFault):
    """Poses are off: all of them while it lasts (bias), or a single one (jump)."""

    NOTHING: ClassVar[Mapping[str, float]] = {"x_m": 0.0, "y_m": 0.0, "theta_rad": 0.0}
    x_m: Finite = 0.1
    y_m: Finite = 0.0
    theta_rad: Angle_rad = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseBias(PoseOffset):
    """All poses are off by the same."""

    kind: Literal["localisation_bias"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseJump(PoseOffset):
    """A single pose is off, the next one is right again."""

    INSTANT: ClassVar[bool] = True
    kind: Literal["localisation_jump"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseDrift(RobotFault):
    """Poses drift away at these rates, and are right again afterwards."""

    NOTHING: ClassVar[Mapping[str, float]] = {"x_m_s": 0.0, "y_m_s": 0.0, "theta_rad_s": 0.0}
    kind: Literal["localisation_drift"]
    x_m_s: Finite = 0.02
    y_m_s: Finite = 0.0
    theta_rad_s: Finite = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseOutage(RobotFault):
    """No pose reaches the robot."""

    PLACE: ClassVar[Place] = "agent"
    kind: Literal["localisation_outage"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFault(Fault):
    """A fault of directed edges, acting as the emulated network does."""

    PLACE: ClassVar[Place] = "agent"
    edges: Annotated[tuple[str, ...], Len(1)] = ("* -> *",)


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkPartition(LinkFault):
    """Every message is lost."""

    kind: Literal["link_partition"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkLoss(LinkFault):
    """Messages are lost with this probability."""

    kind: Literal["link_loss"]
    probability: Probability = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkDelay(LinkFault):
    """Messages take this much longer."""

    kind: Literal["link_delay"]
    delay_s: Delay_s = 0.2
