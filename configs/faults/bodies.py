"""Faults of bodies: forces, loads, friction and wheels."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le

from configs.faults.base import RobotFault, WheelFault
from configs.parameters import Finite, parameter


@dataclass(frozen=True, slots=True, kw_only=True)
class Push(RobotFault):
    """A force along the body's axis and a torque about the vertical act on the body."""

    NOTHING: ClassVar[Mapping[str, float]] = {"force_body_N": 0.0, "torque_body_N_m": 0.0}
    kind: Literal["push"]
    force_body_N: Finite = 5.0
    torque_body_N_m: Finite = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload(RobotFault):
    """The body has another load; speeds stay continuous."""

    NOTHING: ClassVar[Mapping[str, float]] = {
        "mass_kg": 0.0,
        "inertia_kg_m2": 0.0,
        "com_offset_m": 0.0,
    }
    kind: Literal["payload"]
    mass_kg: Annotated[float, Ge(-1e6), Le(1e6)] = parameter(1.0, "more than it had")
    inertia_kg_m2: Annotated[float, Ge(-1e6), Le(1e6)] = parameter(0.0, "more than it had")
    com_offset_m: Annotated[float, Ge(-100), Le(100)] = parameter(0.0, "more than it had")


@dataclass(frozen=True, slots=True, kw_only=True)
class Friction(WheelFault):
    """The wheel has another viscous damping: d_11, d_22 of the plant times this."""

    NOTHING: ClassVar[Mapping[str, float]] = {"factor": 1.0}
    kind: Literal["friction"]
    factor: Annotated[float, Ge(0), Le(1000)] = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelRadius(RobotFault):
    """The wheels' true radius is the controller's times this."""

    NOTHING: ClassVar[Mapping[str, float]] = {"factor": 1.0}
    kind: Literal["wheel_radius"]
    factor: Annotated[float, Ge(0.1), Le(10)] = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelSlip(WheelFault):
    """The wheel turns faster than it rolls: (ν r − its speed over ground) / ν r is this."""

    kind: Literal["wheel_slip"]
    ratio: Annotated[float, Gt(0), Le(0.99)] = 0.3
