"""The messages of an axis: their data as functions of its state.

Without measurements (an ideal motor) current and torque are the demanded ones, temperatures 25 °C
and the bus has 24 V. What a single can't hold saturates; NaN stays.
"""

from collections.abc import Callable, Mapping
from math import pi
from typing import Final

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import Command
from bridge.drives.odrive.local_axis import LocalAxis
from bridge.drives.odrive.parameters import FLOAT32_MAX

PROTOCOL_VERSION: Final = 2
HARDWARE: tuple[int, int, int] = (4, 4, 58)
"""Product line, version, variant: an ODrive Pro."""
AMBIENT_C: Final = 25.0
NOMINAL_V: Final = 24.0


def floats(first: float, second: float) -> bytes:
    """Two floats for the wire."""
    try:
        return f.floats_data(first, second)
    except OverflowError:
        return f.floats_data(_single(first), _single(second))


def version(axis: LocalAxis) -> bytes:
    """Get_Version; a released firmware."""
    return f.VERSION.pack(PROTOCOL_VERSION, *HARDWARE, *axis.model.firmware_version, 0)


def heartbeat(axis: LocalAxis) -> bytes:
    """Heartbeat: errors that are active or disarmed it last."""
    done = axis.controller.trajectory_done
    return f.HEARTBEAT.pack(axis.errors | axis.disarm_reason, axis.state, axis.result, done, 0)


def error(axis: LocalAxis) -> bytes:
    """Get_Error."""
    return f.TWO_U32.pack(axis.errors, axis.disarm_reason)


def address(axis: LocalAxis) -> bytes:
    """Address: node id and serial number, connection 0."""
    return bytes((axis.parameters.node_id, *axis.serial.to_bytes(6, "little"), 0))


def encoder_estimates(axis: LocalAxis) -> bytes:
    """Get_Encoder_Estimates."""
    return floats(axis.position, axis.velocity)


def iq(axis: LocalAxis) -> bytes:
    """Get_Iq: set-point and measurement."""
    return floats(iq_setpoint(axis), iq_measured(axis))


def temperature(axis: LocalAxis) -> bytes:
    """Get_Temperature: FETs and motor."""
    measurements = axis.measurements
    if measurements is None:
        return floats(AMBIENT_C, AMBIENT_C)
    return floats(measurements.fet_C, measurements.motor_C)


def bus(axis: LocalAxis) -> bytes:
    """Get_Bus_Voltage_Current."""
    return floats(bus_voltage(axis), bus_current(axis))


def torques(axis: LocalAxis) -> bytes:
    """Get_Torques: target after limits, and estimate."""
    return floats(axis.effective_torque_shaft, _torque_estimate(axis))


def powers(axis: LocalAxis) -> bytes:
    """Get_Powers: electrical and mechanical."""
    return floats(bus_voltage(axis) * bus_current(axis), _mechanical_power(axis))


def iq_setpoint(axis: LocalAxis) -> float:
    """Current asked for [A]."""
    return axis.effective_torque_shaft / axis.model.torque_constant_N_m_A


def iq_measured(axis: LocalAxis) -> float:
    """Current measured [A]."""
    return iq_setpoint(axis) if axis.measurements is None else axis.measurements.current_A


def bus_voltage(axis: LocalAxis) -> float:
    """Voltage of the supply [V]."""
    return NOMINAL_V if axis.measurements is None else axis.measurements.bus_V


def bus_current(axis: LocalAxis) -> float:
    """Current from the supply [A]; negative while braking feeds it."""
    return (
        _mechanical_power(axis) / NOMINAL_V
        if axis.measurements is None
        else axis.measurements.bus_A
    )


def _torque_estimate(axis: LocalAxis) -> float:
    return (
        axis.effective_torque_shaft
        if axis.measurements is None
        else axis.measurements.torque_shaft_N_m
    )


def _mechanical_power(axis: LocalAxis) -> float:
    return _torque_estimate(axis) * axis.velocity * 2.0 * pi


def _single(value: float) -> float:
    return min(max(value, -FLOAT32_MAX), FLOAT32_MAX)


REPORTS: Final[Mapping[int, Callable[[LocalAxis], bytes]]] = {
    Command.GET_VERSION: version,
    Command.HEARTBEAT: heartbeat,
    Command.GET_ERROR: error,
    Command.GET_ENCODER_ESTIMATES: encoder_estimates,
    Command.GET_IQ: iq,
    Command.GET_TEMPERATURE: temperature,
    Command.GET_BUS_VOLTAGE_CURRENT: bus,
    Command.GET_TORQUES: torques,
    Command.GET_POWERS: powers,
}
"""By command: sent when asked for by a remote or an empty frame, and cyclically."""
