"""The host's messages to an axis: their data, and their effect on it.

Missing bytes read as zero, extra ones are ignored. Values that no drive takes (NaN, negative
limits and gains) change nothing; all values of a message are taken, or none.
"""

from collections.abc import Callable, Mapping
from typing import Final

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import Command
from bridge.drives.odrive.local_axis import LocalAxis
from bridge.drives.odrive.parameters import FLOAT32_MAX, acceptable

Setter = Callable[[LocalAxis, bytes, int], bool]
"""LocalAxis, data, bus time; False if the data were ignored."""


def _axis_state(axis: LocalAxis, data: bytes, now_ns: int) -> bool:
    (asked,) = f.ONE_U32.unpack(f.padded(data, 4))
    axis.request(asked, now_ns)
    return True


def _controller_mode(axis: LocalAxis, data: bytes, _: int) -> bool:
    axis.set_modes(*f.TWO_U32.unpack(f.padded(data, 8)))
    return True


def _input_pos(axis: LocalAxis, data: bytes, now_ns: int) -> bool:
    position, velocity, torque = f.INPUT_POS.unpack(f.padded(data, 8))
    axis.set_position(position, velocity * 1e-3, torque * 1e-3, now_ns)
    return True


def _input_vel(axis: LocalAxis, data: bytes, now_ns: int) -> bool:
    velocity, torque = f.decode_floats(data)
    axis.set_velocity(velocity, torque, now_ns)
    return True


def _input_torque(axis: LocalAxis, data: bytes, now_ns: int) -> bool:
    axis.set_torque(f.decode_float(data), now_ns)
    return True


def _limits(axis: LocalAxis, data: bytes, _: int) -> bool:
    """An infinite limit is none: hosts say so."""
    velocity, current = f.decode_floats(data)
    if not (velocity >= 0.0 and current >= 0.0):
        return False
    axis.parameters.velocity_limit = min(velocity, FLOAT32_MAX)
    axis.parameters.current_limit = min(current, FLOAT32_MAX)
    axis.apply()
    return True


def _absolute_position(axis: LocalAxis, data: bytes, _: int) -> bool:
    return axis.move_origin(f.decode_float(data))


def _clear_errors(axis: LocalAxis, data: bytes, now_ns: int) -> bool:  # noqa: ARG001
    axis.clear_errors()
    return True


def _one(name: str) -> Setter:
    def act(axis: LocalAxis, data: bytes, _: int) -> bool:
        return axis.parameters.put(name, f.decode_float(data))

    return act


def _two(first: str, second: str) -> Setter:
    def act(axis: LocalAxis, data: bytes, _: int) -> bool:
        a, b = f.decode_floats(data)
        if not (acceptable(a) and acceptable(b)):
            return False
        setattr(axis.parameters, first, a)
        setattr(axis.parameters, second, b)
        axis.apply()
        return True

    return act


SETTERS: Final[Mapping[int, Setter]] = {
    Command.SET_AXIS_STATE: _axis_state,
    Command.SET_CONTROLLER_MODE: _controller_mode,
    Command.SET_INPUT_POS: _input_pos,
    Command.SET_INPUT_VEL: _input_vel,
    Command.SET_INPUT_TORQUE: _input_torque,
    Command.SET_LIMITS: _limits,
    Command.SET_TRAJ_VEL_LIMIT: _one("trajectory_velocity"),
    Command.SET_TRAJ_ACCEL_LIMITS: _two("trajectory_accel", "trajectory_decel"),
    Command.SET_TRAJ_INERTIA: _one("inertia"),
    Command.CLEAR_ERRORS: _clear_errors,
    Command.SET_ABSOLUTE_POSITION: _absolute_position,
    Command.SET_POS_GAIN: _one("position_gain"),
    Command.SET_VEL_GAINS: _two("velocity_gain", "velocity_integrator_gain"),
}
"""By command; a remote frame carries nothing to set and never gets here."""
