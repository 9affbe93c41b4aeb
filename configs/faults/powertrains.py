"""Faults of drives, motors, encoders and the supply."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le

from configs.faults.base import Model, RobotFault, WheelFault
from configs.parameters import parameter


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveFault(WheelFault):
    """A fault of the drive itself, by its protocol."""

    INSTANT: ClassVar[bool] = True


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveEvent(DriveFault):
    """The drive disarms by itself: emergency stop, watchdog, or its firmware boots anew."""

    kind: Literal["drive_estop", "drive_watchdog", "drive_reboot"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveError(DriveFault):
    """The drive disarms with an error of its protocol."""

    kind: Literal["drive_error"]
    error: str | None = parameter(
        None, "by the protocol's name for it; ODrives' DRV_FAULT, of the gate driver, if not given"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorTorque(WheelFault):
    """The motor makes its last torque (stuck), or half, none (zero) or minus its demand."""

    kind: Literal["torque_stuck", "torque_half", "torque_zero", "torque_reversed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class OverTemperature(WheelFault):
    """A thermistor reads this much more."""

    NEEDS: ClassVar[frozenset[Model]] = frozenset({"powertrain"})
    kind: Literal["fet_over_temperature", "motor_over_temperature"]
    rise_K: Annotated[float, Gt(0), Le(1000)] = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class UnderVoltage(RobotFault):
    """The supply sags to this open-circuit voltage."""

    NEEDS: ClassVar[frozenset[Model]] = frozenset({"powertrain"})
    kind: Literal["under_voltage"]
    voltage_V: Annotated[float, Ge(0), Le(1000)] = 9.0


@dataclass(frozen=True, slots=True, kw_only=True)
class OverVoltage(RobotFault):
    """The supply rises to this open-circuit voltage."""

    NEEDS: ClassVar[frozenset[Model]] = frozenset({"powertrain"})
    kind: Literal["over_voltage"]
    voltage_V: Annotated[float, Ge(0), Le(1000)] = 31.0


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderState(WheelFault):
    """The encoder stands still (freeze) or counts backwards; afterwards it counts on from there."""

    kind: Literal["encoder_freeze", "encoder_sign_flip"]


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderJump(WheelFault):
    """The encoder's position jumps, once and for good."""

    INSTANT: ClassVar[bool] = True
    NOTHING: ClassVar[Mapping[str, float]] = {"shaft_rev": 0.0}
    kind: Literal["encoder_jump"]
    shaft_rev: Annotated[float, Ge(-1e6), Le(1e6)] = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderNoise(WheelFault):
    """White noise of the shaft's angle where it is counted, beside the encoder's own."""

    kind: Literal["encoder_noise"]
    counts_rms: Annotated[float, Gt(0), Le(1e6)] = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderSlip(WheelFault):
    """The encoder loses this share of its counts in either direction; only an index finds them."""

    kind: Literal["encoder_slip"]
    share: Annotated[float, Gt(0), Le(1)] = 0.01
