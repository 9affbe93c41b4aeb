"""The parameters of an axis that a host can set: in RAM, saved by Reboot 1, lost by other reboots.

Floats are finite and not negative, as is everything else; what isn't is refused, and the value
stays. The vendor's defaults come with `AxisModel`.
"""

from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Final, Self

from bridge.drives.odrive.frames import Command, ControlMode, InputMode
from bridge.drives.odrive.model import AxisModel

FLOAT32_MAX: Final = 3.4028234663852886e38


@dataclass(slots=True)
class Parameters:
    """The parameters of one axis."""

    node_id: int
    period_ns: dict[Command, int]  # of cyclic messages; 0: off
    watchdog_s: float
    watchdog_enabled: bool
    velocity_limit: float  # [rev/s]
    current_limit: float  # [A]
    position_gain: float  # [1/s]
    velocity_gain: float  # [N·m·s/rev]
    velocity_integrator_gain: float  # [N·m/rev]
    velocity_ramp: float  # [rev/s²]
    torque_ramp: float  # [N·m/s]
    filter_bandwidth: float  # [1/s]
    trajectory_velocity: float  # [rev/s]
    trajectory_accel: float  # [rev/s²]
    trajectory_decel: float  # [rev/s²]
    motor_calibrated: bool
    encoder_calibrated: bool
    velocity_integrator_limit: float = inf  # [N·m]
    inertia: float = 0.0  # [N·m·s²/rev]
    control_mode: int = ControlMode.TORQUE
    input_mode: int = InputMode.PASSTHROUGH

    @classmethod
    def of(cls, model: AxisModel, node_id: int) -> Self:
        """The parameters of a drive as delivered."""
        return cls(
            node_id=node_id,
            period_ns={
                Command.HEARTBEAT: model.heartbeat_period_ns,
                Command.GET_ERROR: model.error_period_ns,
                Command.GET_ENCODER_ESTIMATES: model.encoder_period_ns,
                Command.GET_IQ: model.iq_period_ns,
                Command.GET_TEMPERATURE: model.temperature_period_ns,
                Command.GET_BUS_VOLTAGE_CURRENT: model.bus_voltage_period_ns,
                Command.GET_TORQUES: model.torques_period_ns,
                Command.GET_POWERS: model.powers_period_ns,
            },
            watchdog_s=model.watchdog_ns * 1e-9,
            watchdog_enabled=model.watchdog_ns > 0,
            velocity_limit=model.velocity_limit_shaft_rev_s,
            current_limit=model.current_limit_A,
            position_gain=model.position_gain_1_s,
            velocity_gain=model.velocity_gain_shaft_N_m_s_rev,
            velocity_integrator_gain=model.velocity_integrator_gain_shaft_N_m_rev,
            velocity_ramp=model.velocity_ramp_shaft_rev_s2,
            torque_ramp=model.torque_ramp_shaft_N_m_s,
            filter_bandwidth=model.input_filter_bandwidth_1_s,
            trajectory_velocity=model.trajectory_velocity_shaft_rev_s,
            trajectory_accel=model.trajectory_accel_shaft_rev_s2,
            trajectory_decel=model.trajectory_decel_shaft_rev_s2,
            motor_calibrated=model.calibrated,
            encoder_calibrated=model.calibrated,
        )

    def copy(self) -> Self:
        """The same, independent."""
        return replace(self, period_ns=dict(self.period_ns))

    def put(self, name: str, value: float) -> bool:
        """Set one number; False if it is none that the drive takes."""
        if not acceptable(value):
            return False
        setattr(self, name, value)
        return True


def acceptable(value: float) -> bool:
    """Whether a limit, a gain or a rate may have this value."""
    return isfinite(value) and value >= 0.0
