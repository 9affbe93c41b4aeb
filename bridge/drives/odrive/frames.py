"""ODrive CANSimple frames, firmware 0.6.x (vendor manual, "CAN Protocol"): identifiers and layouts.

11-bit identifier = node_id << 5 | command; node 0x3F is unaddressed. Little endian, float is
IEEE-754 single. Both directions use the same identifier: what the drive says is `Get_...`, what the
host says is `Set_...`; a remote frame or an empty data frame with a Get's identifier asks for it.

Hosts send other lengths than the table's: missing bytes read as zero, extra ones are ignored.
"""

import struct
from enum import IntEnum, IntFlag
from typing import Final, NamedTuple

from librt.strings import BytesWriter, read_f32_le, write_f32_le

from bridge.frame import RTR, Frame

UNADDRESSED: Final = 0x3F
MAX_NODE: Final = 0x3E
BITS: Final = 5


class Command(IntEnum):
    """The command part of an identifier."""

    GET_VERSION = 0x00
    HEARTBEAT = 0x01
    ESTOP = 0x02
    GET_ERROR = 0x03
    RX_SDO = 0x04
    TX_SDO = 0x05
    ADDRESS = 0x06
    SET_AXIS_STATE = 0x07
    GET_ENCODER_ESTIMATES = 0x09
    SET_CONTROLLER_MODE = 0x0B
    SET_INPUT_POS = 0x0C
    SET_INPUT_VEL = 0x0D
    SET_INPUT_TORQUE = 0x0E
    SET_LIMITS = 0x0F
    SET_TRAJ_VEL_LIMIT = 0x11
    SET_TRAJ_ACCEL_LIMITS = 0x12
    SET_TRAJ_INERTIA = 0x13
    GET_IQ = 0x14
    GET_TEMPERATURE = 0x15
    REBOOT = 0x16
    GET_BUS_VOLTAGE_CURRENT = 0x17
    CLEAR_ERRORS = 0x18
    SET_ABSOLUTE_POSITION = 0x19
    SET_POS_GAIN = 0x1A
    SET_VEL_GAINS = 0x1B
    GET_TORQUES = 0x1C
    GET_POWERS = 0x1D
    ENTER_DFU_MODE = 0x1F


class AxisState(IntEnum):
    """The state of an axis."""

    UNDEFINED = 0
    IDLE = 1
    STARTUP_SEQUENCE = 2
    FULL_CALIBRATION_SEQUENCE = 3
    MOTOR_CALIBRATION = 4
    SENSORLESS_CONTROL = 5
    ENCODER_INDEX_SEARCH = 6
    ENCODER_OFFSET_CALIBRATION = 7
    CLOSED_LOOP_CONTROL = 8
    LOCKIN_SPIN = 9
    ENCODER_DIR_FIND = 10
    HOMING = 11
    ENCODER_HALL_POLARITY_CALIBRATION = 12
    ENCODER_HALL_PHASE_CALIBRATION = 13
    ANTICOGGING_CALIBRATION = 14


class ControlMode(IntEnum):
    """The controlled quantity of an axis."""

    VOLTAGE = 0
    TORQUE = 1
    VELOCITY = 2
    POSITION = 3


class InputMode(IntEnum):
    """The filter between a set-point and the controller's input."""

    INACTIVE = 0
    PASSTHROUGH = 1
    VEL_RAMP = 2
    POS_FILTER = 3
    TRAP_TRAJ = 5
    TORQUE_RAMP = 6
    MIRROR = 7
    TUNING = 8


class ProcedureResult(IntEnum):
    """The result of the last change of state."""

    SUCCESS = 0
    BUSY = 1
    CANCELLED = 2
    DISARMED = 3
    NO_RESPONSE = 4
    POLE_PAIR_CPR_MISMATCH = 5
    PHASE_RESISTANCE_OUT_OF_RANGE = 6
    PHASE_INDUCTANCE_OUT_OF_RANGE = 7
    UNBALANCED_PHASES = 8
    INVALID_MOTOR_TYPE = 9
    ILLEGAL_HALL_STATE = 10
    TIMEOUT = 11
    HOMING_WITHOUT_ENDSTOP = 12
    INVALID_STATE = 13
    NOT_CALIBRATED = 14
    NOT_CONVERGING = 15


class RebootAction(IntEnum):
    """The byte of Reboot."""

    REBOOT = 0
    SAVE_CONFIGURATION = 1
    ERASE_CONFIGURATION = 2
    ENTER_DFU_MODE = 3


class AxisError(IntFlag):
    """Active errors and disarm reasons."""

    INITIALIZING = 0x1
    SYSTEM_LEVEL = 0x2
    TIMING_ERROR = 0x4
    MISSING_ESTIMATE = 0x8
    BAD_CONFIG = 0x10
    DRV_FAULT = 0x20
    MISSING_INPUT = 0x40
    DC_BUS_OVER_VOLTAGE = 0x100
    DC_BUS_UNDER_VOLTAGE = 0x200
    DC_BUS_OVER_CURRENT = 0x400
    DC_BUS_OVER_REGEN_CURRENT = 0x800
    CURRENT_LIMIT_VIOLATION = 0x1000
    MOTOR_OVER_TEMP = 0x2000
    INVERTER_OVER_TEMP = 0x4000
    VELOCITY_LIMIT_VIOLATION = 0x8000
    POSITION_LIMIT_VIOLATION = 0x10000
    WATCHDOG_TIMER_EXPIRED = 0x0100_0000
    ESTOP_REQUESTED = 0x0200_0000
    SPINOUT_DETECTED = 0x0400_0000
    BRAKE_RESISTOR_DISARMED = 0x0800_0000
    THERMISTOR_DISCONNECTED = 0x1000_0000
    CALIBRATION_ERROR = 0x4000_0000


ONE_FLOAT: Final = struct.Struct("<f")
TWO_FLOATS: Final = struct.Struct("<ff")
ONE_U32: Final = struct.Struct("<I")
TWO_U32: Final = struct.Struct("<II")
HEARTBEAT: Final = struct.Struct("<IBBBB")  # axis error, state, procedure result, flags, reserved
VERSION: Final = struct.Struct("<8B")
SDO: Final = struct.Struct("<BHB")  # opcode (0 in replies), endpoint, reserved; the value follows
INPUT_POS: Final = struct.Struct("<fhh")  # rev, 0.001 rev/s, 0.001 N·m


class Heartbeat(NamedTuple):
    """The state of a drive, sent cyclically."""

    errors: AxisError
    state: int
    result: int
    trajectory_done: bool


def identifier(node: int, command: Command) -> int:
    """The identifier of a command of a node."""
    return node << BITS | command


def request(node: int, command: Command) -> Frame:
    """A remote frame that asks a drive for one of its messages."""
    return Frame(identifier(node, command) | RTR, bytes(8))


def is_request(frame: Frame) -> bool:
    """Whether a frame with a Get's identifier asks: remote, or empty."""
    return bool(frame.can_id & RTR) or not frame.data


def padded(data: bytes | bytearray, size: int) -> bytes | bytearray:
    """The first `size` bytes of data, missing ones zero."""
    return data[:size].ljust(size, b"\0")


def decode_heartbeat(data: bytes | bytearray) -> Heartbeat:
    """The content of a heartbeat."""
    errors, state, result, flags, _ = HEARTBEAT.unpack(padded(data, HEARTBEAT.size))
    return Heartbeat(AxisError(errors), state, result, bool(flags & 1))


_SINGLE_BELOW: Final = 2.0**128 - 2.0**103
"""The least number that rounds to one that a single can't hold."""


def float_data(value: float) -> bytes:
    """One float for the wire.

    Raises:
        OverflowError: a single can't hold it.
    """
    if not -_SINGLE_BELOW < value < _SINGLE_BELOW:
        return ONE_FLOAT.pack(value)
    data = BytesWriter()
    write_f32_le(data, value)
    return data.getvalue()


def floats_data(first: float, second: float) -> bytes:
    """Two floats for the wire.

    Raises:
        OverflowError: a single can't hold one of them.
    """
    if not (-_SINGLE_BELOW < first < _SINGLE_BELOW and -_SINGLE_BELOW < second < _SINGLE_BELOW):
        return TWO_FLOATS.pack(first, second)
    data = BytesWriter()
    write_f32_le(data, first)
    write_f32_le(data, second)
    return data.getvalue()


def float_at(data: bytes, place: int) -> float:
    """The float at a place of a message that is long enough."""
    return read_f32_le(data, place)


def decode_floats(data: bytes | bytearray) -> tuple[float, float]:
    """The two floats of a message."""
    first, second = TWO_FLOATS.unpack(data if len(data) == 8 else padded(data, 8))
    return first, second


def decode_float(data: bytes | bytearray) -> float:
    """The first float of a message."""
    (value,) = ONE_FLOAT.unpack(data if len(data) == 4 else padded(data, 4))
    return float(value)


def error_names(errors: AxisError) -> str:
    """Names of the error bits, for people."""
    known = [bit.name for bit in AxisError if bit in errors and bit.name]
    rest = int(errors) & ~sum(AxisError)
    return " | ".join(known + ([hex(rest)] if rest else [])) or "no error"


def name_of(kind: type[IntEnum], value: int) -> str:
    """The name of a value, or the value if it has none, for people."""
    try:
        return kind(value).name
    except ValueError:
        return str(value)
