"""The endpoints of an axis, see `endpoints`: numbers, vendor's names, what is behind them."""

from collections.abc import Callable
from itertools import count
from typing import Protocol

from bridge.drives.odrive.control import Control
from bridge.drives.odrive.cyclic import Cyclic
from bridge.drives.odrive.endpoints import Endpoint, Kind
from bridge.drives.odrive.frames import AxisError, AxisState, Command
from bridge.drives.odrive.readings import Readings

FIRST_ENDPOINT = 256
_MS = 1_000_000
_RATES = {
    "heartbeat": Command.HEARTBEAT,
    "error": Command.GET_ERROR,
    "iq": Command.GET_IQ,
    "temperature": Command.GET_TEMPERATURE,
    "bus_voltage": Command.GET_BUS_VOLTAGE_CURRENT,
    "torques": Command.GET_TORQUES,
    "powers": Command.GET_POWERS,
}
_GAINS = {
    "controller.config.vel_limit": "velocity_limit",
    "controller.config.pos_gain": "position_gain",
    "controller.config.vel_gain": "velocity_gain",
    "controller.config.vel_integrator_gain": "velocity_integrator_gain",
    "controller.config.vel_ramp_rate": "velocity_ramp_rate",
    "controller.config.torque_ramp_rate": "torque_ramp_rate",
    "controller.config.input_filter_bandwidth": "filter_bandwidth",
    "controller.config.inertia": "inertia",
    "trap_traj.config.vel_limit": "trajectory_velocity",
    "trap_traj.config.accel_limit": "accel_limit",
    "trap_traj.config.decel_limit": "decel_limit",
    "config.motor.current_soft_max": "current_limit",
}


class Axis(Protocol):
    """What the endpoints reach of an axis."""

    state: AxisState
    errors: AxisError
    disarm_reason: AxisError
    node_id: int
    watchdog_ns: int
    encoder_period_ns: int

    def readdress(self, node: int) -> None:
        """Take a node id."""

    def set_encoder_period(self, period_ns: int) -> None:
        """Change the rate of the encoder's frames."""


def parameters(
    axis: Axis, control: Control, cyclic: Cyclic, readings: Readings
) -> dict[int, Endpoint]:
    """The table of one axis, in a fixed order from `FIRST_ENDPOINT` on."""
    endpoints = [
        Endpoint("vbus_voltage", Kind.F32, lambda: _volts(readings)),
        Endpoint("axis0.current_state", Kind.U8, lambda: axis.state),
        Endpoint("axis0.active_errors", Kind.U32, lambda: axis.errors),
        Endpoint("axis0.disarm_reason", Kind.U32, lambda: axis.disarm_reason),
        Endpoint("axis0.pos_estimate", Kind.F32, lambda: readings.position),
        Endpoint("axis0.vel_estimate", Kind.F32, lambda: readings.velocity),
        Endpoint(
            "axis0.config.can.node_id",
            Kind.U32,
            lambda: axis.node_id,
            lambda node: axis.readdress(int(node)),
        ),
        Endpoint(
            "axis0.config.can.encoder_msg_rate_ms",
            Kind.U32,
            lambda: axis.encoder_period_ns // _MS,
            lambda ms: axis.set_encoder_period(int(ms) * _MS),
        ),
        Endpoint("axis0.config.motor.torque_constant", Kind.F32, lambda: control.torque_constant),
    ]
    for name, command in _RATES.items():
        endpoints.append(
            Endpoint(
                f"axis0.config.can.{name}_msg_rate_ms",
                Kind.U32,
                _period(cyclic, command),
                _set_period(cyclic, command),
            )
        )
    for name, attribute in _GAINS.items():
        endpoints.append(
            Endpoint(
                f"axis0.{name}", Kind.F32, _gain(control, attribute), _set_gain(control, attribute)
            )
        )

    def set_timeout(seconds: float) -> None:
        if seconds > 0.0:
            axis.watchdog_ns = round(seconds * 1e9)

    def enable(on: float) -> None:
        axis.watchdog_ns = (axis.watchdog_ns or 100 * _MS) if on else 0

    endpoints += [
        Endpoint(
            "axis0.config.watchdog_timeout", Kind.F32, lambda: axis.watchdog_ns * 1e-9, set_timeout
        ),
        Endpoint("axis0.config.enable_watchdog", Kind.BOOL, lambda: axis.watchdog_ns > 0, enable),
    ]
    return dict(zip(count(FIRST_ENDPOINT), endpoints, strict=False))


def _volts(readings: Readings) -> float:
    return 24.0 if readings.feeling is None else readings.feeling.bus_V


def _period(cyclic: Cyclic, command: Command) -> Callable[[], int]:
    return lambda: cyclic.periods_ns.get(command, 0) // _MS


def _set_period(cyclic: Cyclic, command: Command) -> Callable[[float], None]:
    # Due from the next look on: a host that changes a rate doesn't know the drive's time.
    return lambda ms: cyclic.set_period(command, int(ms) * _MS, 0)


def _gain(control: Control, attribute: str) -> Callable[[], float]:
    return lambda: float(getattr(control, attribute))


def _set_gain(control: Control, attribute: str) -> Callable[[float], None]:
    def write(value: float) -> None:
        if value >= 0.0:
            setattr(control, attribute, value)

    return write
