"""Endpoints that RxSdo reads and writes: the vendor's names, numbers of our own.

    RxSdo   u8 opcode (0 read, 1 write)   u16 endpoint   u8 0   value, little endian
    TxSdo   u8 0                          u16 endpoint   u8 0   value, zero padded to 8 bytes

The vendor's numbers change with every firmware and come from its `flat_endpoints.json`; ours are
those of `ENDPOINTS` and `functions.FUNCTIONS`, stable, and `flat_endpoints` gives them in the form
of that file. Firmware 0.6.11 and later answers a write with what was written, earlier ones answer
reads only. Unknown endpoints, other opcodes, short frames, writes to what is read-only and values
that no drive takes are ignored. Writing inputs this way doesn't feed the watchdog.
"""

import struct
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from bridge.drives.odrive import frames as f
from bridge.drives.odrive import reports
from bridge.drives.odrive.frames import AxisState, Command
from bridge.drives.odrive.functions import FUNCTIONS, Value
from bridge.drives.odrive.local_axis import LocalAxis
from bridge.drives.odrive.parameters import FLOAT32_MAX

ANSWERS_WRITES = (0, 6, 11)
"""First firmware that does."""
_READ, _WRITE = 0, 1
_MS_NS = 1_000_000
_NAMES = {"f": "float", "?": "bool", "B": "uint8", "I": "uint32"}
_Json = dict[str, object]
Read = Callable[[LocalAxis], float]
Write = Callable[[LocalAxis, float, int], bool]
"""LocalAxis, value, bus time; False if it isn't taken."""


class Endpoint(NamedTuple):
    """One value behind a number."""

    number: int
    path: str
    code: str  # of `struct`
    read: Read
    write: Write | None = None


def _parameter(path: str, name: str) -> tuple[str, str, Read, Write]:
    def read(axis: LocalAxis) -> float:
        return float(getattr(axis.parameters, name))

    def write(axis: LocalAxis, value: float, _: int) -> bool:
        taken = axis.parameters.put(name, value)
        axis.apply()
        return taken

    return path, "f", read, write


def _integrator_limit(axis: LocalAxis, value: float, _: int) -> bool:
    """An infinite limit is none, as drives are delivered."""
    if not value >= 0.0:
        return False
    axis.parameters.velocity_integrator_limit = value
    return True


def _period(name: str, command: Command) -> tuple[str, str, Read, Write]:
    def read(axis: LocalAxis) -> float:
        return axis.parameters.period_ns[command] // _MS_NS

    def write(axis: LocalAxis, value: float, _: int) -> bool:
        axis.parameters.period_ns[command] = int(value) * _MS_NS
        return True

    return f"axis0.config.can.{name}_msg_rate_ms", "I", read, write


def _state(axis: LocalAxis, value: float, now_ns: int) -> bool:
    axis.request(int(value), now_ns)
    return True


def _enable_watchdog(axis: LocalAxis, value: float, now_ns: int) -> bool:
    """It counts from now on."""
    if value and not axis.parameters.watchdog_enabled:
        axis.fed_ns = now_ns
    axis.parameters.watchdog_enabled = bool(value)
    axis.apply()
    return True


def _modes(which: str) -> Write:
    def write(axis: LocalAxis, value: float, _: int) -> bool:
        p = axis.parameters
        chosen = {"control_mode": p.control_mode, "input_mode": p.input_mode, which: int(value)}
        axis.set_modes(**chosen)
        return True

    return write


def _input(write: Callable[[LocalAxis, float], None]) -> Write:
    def checked(axis: LocalAxis, value: float, _: int) -> bool:
        if not -FLOAT32_MAX <= value <= FLOAT32_MAX:
            return False
        write(axis, value)
        return True

    return checked


def _input_torque(axis: LocalAxis, value: float) -> None:
    axis.input_torque_shaft = value


def _input_velocity(axis: LocalAxis, value: float) -> None:
    axis.controller.input_velocity = value


def _input_position(axis: LocalAxis, value: float) -> None:
    axis.controller.move_to(value)


def _rows() -> Iterator[tuple[str, str, Read] | tuple[str, str, Read, Write]]:
    yield "vbus_voltage", "f", reports.bus_voltage
    yield "ibus", "f", reports.bus_current
    yield "fw_version_major", "B", lambda axis: axis.model.firmware_version[0]
    yield "fw_version_minor", "B", lambda axis: axis.model.firmware_version[1]
    yield "fw_version_revision", "B", lambda axis: axis.model.firmware_version[2]
    yield "axis0.active_errors", "I", lambda axis: axis.errors
    yield "axis0.disarm_reason", "I", lambda axis: axis.disarm_reason
    yield "axis0.procedure_result", "B", lambda axis: axis.result
    yield "axis0.current_state", "B", lambda axis: axis.state
    yield "axis0.requested_state", "B", lambda _: 0, _state
    yield "axis0.is_armed", "?", lambda axis: axis.state is AxisState.CLOSED_LOOP_CONTROL
    yield "axis0.pos_estimate", "f", lambda axis: axis.position
    yield "axis0.vel_estimate", "f", lambda axis: axis.velocity
    yield "axis0.motor.foc.Iq_setpoint", "f", reports.iq_setpoint
    yield "axis0.motor.foc.Iq_measured", "f", reports.iq_measured
    yield "axis0.config.motor.torque_constant", "f", lambda axis: axis.model.torque_constant_N_m_A
    yield _parameter("axis0.config.motor.current_soft_max", "current_limit")
    path = "axis0.config.enable_watchdog"
    yield path, "?", lambda axis: axis.parameters.watchdog_enabled, _enable_watchdog
    yield _parameter("axis0.config.watchdog_timeout", "watchdog_s")
    yield "axis0.config.can.node_id", "I", lambda axis: axis.parameters.node_id
    yield _period("heartbeat", Command.HEARTBEAT)
    yield _period("error", Command.GET_ERROR)
    yield _period("encoder", Command.GET_ENCODER_ESTIMATES)
    yield _period("iq", Command.GET_IQ)
    yield _period("temperature", Command.GET_TEMPERATURE)
    yield _period("bus_voltage", Command.GET_BUS_VOLTAGE_CURRENT)
    yield _period("torques", Command.GET_TORQUES)
    yield _period("powers", Command.GET_POWERS)
    at = "axis0.controller"
    yield f"{at}.input_pos", "f", lambda x: x.controller.input_position, _input(_input_position)
    yield f"{at}.input_vel", "f", lambda x: x.controller.input_velocity, _input(_input_velocity)
    yield f"{at}.input_torque", "f", lambda x: x.input_torque_shaft, _input(_input_torque)
    yield f"{at}.trajectory_done", "?", lambda x: x.controller.trajectory_done
    modes = "control_mode", "input_mode"
    yield (
        f"{at}.config.{modes[0]}",
        "B",
        lambda x: x.parameters.control_mode & 0xFF,
        _modes(modes[0]),
    )
    yield f"{at}.config.{modes[1]}", "B", lambda x: x.parameters.input_mode & 0xFF, _modes(modes[1])
    yield _parameter(f"{at}.config.vel_limit", "velocity_limit")
    yield f"{at}.config.vel_limit_tolerance", "f", lambda x: x.model.overspeed_ratio
    yield _parameter(f"{at}.config.pos_gain", "position_gain")
    yield _parameter(f"{at}.config.vel_gain", "velocity_gain")
    yield _parameter(f"{at}.config.vel_integrator_gain", "velocity_integrator_gain")
    yield _parameter(f"{at}.config.vel_ramp_rate", "velocity_ramp")
    yield _parameter(f"{at}.config.torque_ramp_rate", "torque_ramp")
    yield _parameter(f"{at}.config.input_filter_bandwidth", "filter_bandwidth")
    yield _parameter(f"{at}.config.inertia", "inertia")
    yield _parameter("axis0.trap_traj.config.vel_limit", "trajectory_velocity")
    yield _parameter("axis0.trap_traj.config.accel_limit", "trajectory_accel")
    yield _parameter("axis0.trap_traj.config.decel_limit", "trajectory_decel")
    yield "hw_version_major", "B", lambda _: reports.HARDWARE[0]
    yield "hw_version_minor", "B", lambda _: reports.HARDWARE[1]
    yield "hw_version_variant", "B", lambda _: reports.HARDWARE[2]
    yield "fw_version_unreleased", "B", lambda _: 0
    path = f"{at}.config.vel_integrator_limit"
    yield path, "f", lambda x: x.parameters.velocity_integrator_limit, _integrator_limit
    yield "config.dc_bus_undervoltage_trip_level", "f", lambda axis: axis.model.under_voltage_V
    yield "config.dc_bus_overvoltage_trip_level", "f", lambda axis: axis.model.over_voltage_V


ENDPOINTS: Mapping[int, Endpoint] = {n: Endpoint(n, *row) for n, row in enumerate(_rows(), 1)}
"""Values by number; new ones go to the end, so that numbers stay."""


def answer(axis: LocalAxis, data: bytes, now_ns: int) -> bytes | None:
    """The data of TxSdo in answer to an RxSdo with a number; None for no answer."""
    opcode, number, _ = f.SDO.unpack_from(data)
    endpoint = ENDPOINTS.get(number)
    if endpoint is None:
        return None
    if opcode == _WRITE:
        size = struct.calcsize(endpoint.code)
        value = data[f.SDO.size : f.SDO.size + size]
        if len(value) < size or endpoint.write is None:
            return None
        if not endpoint.write(axis, struct.unpack(f"<{endpoint.code}", value)[0], now_ns):
            return None
        if axis.model.firmware_version < ANSWERS_WRITES:
            return None
    elif opcode != _READ:
        return None
    return (f.SDO.pack(0, number, 0) + _packed(endpoint, axis)).ljust(8, b"\0")


def flat_endpoints(
    firmware: tuple[int, int, int], hardware: tuple[int, int, int] = reports.HARDWARE
) -> _Json:
    """The tables in the form of the vendor's `flat_endpoints.json`, for scripts that read it.

    Both versions are those of Get_Version, which such scripts compare.
    """
    values: _Json = {
        endpoint.path: {
            "id": endpoint.number,
            "type": _NAMES[endpoint.code],
            "access": "r" if endpoint.write is None else "rw",
        }
        for endpoint in ENDPOINTS.values()
    }
    calls: _Json = {
        function.path: {
            "id": number,
            "type": "function",
            "inputs": _described(function.argument),
            "outputs": _described(function.result),
        }
        for number, function in FUNCTIONS.items()
    }
    return {
        "fw_version": ".".join(map(str, firmware)),
        "hw_version": ".".join(map(str, hardware)),
        "endpoints": values | calls,
    }


def _described(value: Value | None) -> list[_Json]:
    return [] if value is None else [{"name": value.name, "type": _NAMES[value.code]}]


def _packed(endpoint: Endpoint, axis: LocalAxis) -> bytes:
    value = endpoint.read(axis)
    if endpoint.code == "f":
        return reports.floats(value, 0.0)[:4]
    return struct.pack(f"<{endpoint.code}", int(value))
