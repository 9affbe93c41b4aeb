"""CANSimple frames in words: message names and values as ODrive's DBC calls them.

A remote frame, or an empty one with the identifier of what a drive says, is a request. Frames that
aren't CANSimple's (29-bit, error frames, unknown commands) have no words.
"""

import struct
from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

from bridge.drives.interface import NodeSeen
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import Command
from bridge.frame import EFF, ERR, RTR, Frame

_NAMES = {
    Command.RX_SDO: "RxSdo",
    Command.TX_SDO: "TxSdo",
    Command.ENTER_DFU_MODE: "Enter_DFU_Mode",
}
_ANSWERED = frozenset({Command.HEARTBEAT, Command.ADDRESS})


class Signal(NamedTuple):
    """One field of a message; the raw number times `scale` is in `unit`."""

    name: str
    unit: str = ""
    scale: float = 1.0
    meaning: type[IntEnum] | None = None
    bits: int = 0xFFFF_FFFF_FFFF


class Value(NamedTuple):
    """One decoded field."""

    name: str
    value: float | int | str
    unit: str


class Message(NamedTuple):
    """A frame in CANSimple's terms; a request has no values."""

    node: int
    name: str
    values: tuple[Value, ...]
    request: bool


class Layout(NamedTuple):
    """The bytes of a message and what they mean."""

    packed: struct.Struct
    signals: tuple[Signal, ...]


def _floats(*signals: tuple[str, str]) -> Layout:
    return Layout(
        struct.Struct(f"<{len(signals)}f"), tuple(Signal(name, unit) for name, unit in signals)
    )


def _numbers(form: str, *signals: Signal | str) -> Layout:
    named = tuple(Signal(signal) if isinstance(signal, str) else signal for signal in signals)
    return Layout(struct.Struct(form), named)


ERRORS = "Axis_Error", "Active_Errors", "Disarm_Reason"
_SDO_VALUE = "Endpoint_ID", "Value"
LAYOUTS: Mapping[Command, Layout] = {
    Command.GET_VERSION: _numbers(
        "<8B",
        "Protocol_Version",
        "Hw_Version_Major",
        "Hw_Version_Minor",
        "Hw_Version_Variant",
        "Fw_Version_Major",
        "Fw_Version_Minor",
        "Fw_Version_Revision",
        "Fw_Version_Unreleased",
    ),
    Command.HEARTBEAT: _numbers(
        "<IBBBx",
        "Axis_Error",
        Signal("Axis_State", meaning=f.AxisState),
        Signal("Procedure_Result", meaning=f.ProcedureResult),
        Signal("Trajectory_Done_Flag", bits=1),
    ),
    Command.ESTOP: _numbers("<"),
    Command.GET_ERROR: _numbers("<II", "Active_Errors", "Disarm_Reason"),
    Command.RX_SDO: _numbers("<BHxI", "Opcode", *_SDO_VALUE),
    Command.TX_SDO: _numbers("<xHxI", *_SDO_VALUE),
    Command.ADDRESS: _numbers("<BIH", "Node_ID", "Serial_Number"),
    Command.SET_AXIS_STATE: _numbers("<I", Signal("Axis_Requested_State", meaning=f.AxisState)),
    Command.GET_ENCODER_ESTIMATES: _floats(("Pos_Estimate", "rev"), ("Vel_Estimate", "rev/s")),
    Command.SET_CONTROLLER_MODE: _numbers(
        "<II",
        Signal("Control_Mode", meaning=f.ControlMode),
        Signal("Input_Mode", meaning=f.InputMode),
    ),
    Command.SET_INPUT_POS: _numbers(
        "<fhh",
        Signal("Input_Pos", "rev"),
        Signal("Vel_FF", "rev/s", 0.001),
        Signal("Torque_FF", "N·m", 0.001),
    ),
    Command.SET_INPUT_VEL: _floats(("Input_Vel", "rev/s"), ("Input_Torque_FF", "N·m")),
    Command.SET_INPUT_TORQUE: _floats(("Input_Torque", "N·m")),
    Command.SET_LIMITS: _floats(("Velocity_Limit", "rev/s"), ("Current_Limit", "A")),
    Command.SET_TRAJ_VEL_LIMIT: _floats(("Traj_Vel_Limit", "rev/s")),
    Command.SET_TRAJ_ACCEL_LIMITS: _floats(
        ("Traj_Accel_Limit", "rev/s²"), ("Traj_Decel_Limit", "rev/s²")
    ),
    Command.SET_TRAJ_INERTIA: _floats(("Traj_Inertia", "N·m/(rev/s²)")),
    Command.GET_IQ: _floats(("Iq_Setpoint", "A"), ("Iq_Measured", "A")),
    Command.GET_TEMPERATURE: _floats(("FET_Temperature", "°C"), ("Motor_Temperature", "°C")),
    Command.REBOOT: _numbers("<B", Signal("Action", meaning=f.RebootAction)),
    Command.GET_BUS_VOLTAGE_CURRENT: _floats(("Bus_Voltage", "V"), ("Bus_Current", "A")),
    Command.CLEAR_ERRORS: _numbers("<B", "Identify"),
    Command.SET_ABSOLUTE_POSITION: _floats(("Position", "rev")),
    Command.SET_POS_GAIN: _floats(("Pos_Gain", "(rev/s)/rev")),
    Command.SET_VEL_GAINS: _floats(("Vel_Gain", "N·m/(rev/s)"), ("Vel_Integrator_Gain", "N·m/rev")),
    Command.GET_TORQUES: _floats(("Torque_Target", "N·m"), ("Torque_Estimate", "N·m")),
    Command.GET_POWERS: _floats(("Electrical_Power", "W"), ("Mechanical_Power", "W")),
    Command.ENTER_DFU_MODE: _numbers("<"),
}


def decode(frame: Frame) -> Message | None:
    """The message in a frame, None if it isn't CANSimple's. Missing bytes read as zero."""
    can_id, data = frame.can_id, frame.data
    if can_id & (EFF | ERR):
        return None
    number = can_id & 0x7FF
    try:
        command = Command(number & (1 << f.BITS) - 1)
        layout = LAYOUTS[command]
    except (ValueError, KeyError):
        return None
    node = number >> f.BITS
    name = name_of(command)
    if can_id & RTR or (not data and is_answered(command)):
        return Message(node, name, (), request=True)
    raw = layout.packed.unpack(f.padded(data, layout.packed.size))
    if command is Command.ADDRESS:
        raw = (raw[0], raw[1] | raw[2] << 32)
    values = tuple(map(_value, layout.signals, raw))
    return Message(node, name, values, request=False)


def words(frame: Frame) -> str:
    """A frame in one line for people, empty if it isn't CANSimple's."""
    message = decode(frame)
    if message is None:
        return ""
    parts = [f"node {message.node:2}  {message.name}"]
    if message.request:
        parts.append("request")
    for name, value, unit in message.values:
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        parts.append(f"{name}={shown} {unit}".rstrip())
    return "  ".join(parts)


def name_of(command: Command) -> str:
    """The vendor's name of a message."""
    return _NAMES.get(command, command.name.title())


def is_answered(command: Command) -> bool:
    """Whether drives say it: cyclically, or asked by an empty frame."""
    return command in _ANSWERED or command.name.startswith("GET_")


def _value(signal: Signal, raw: float) -> Value:
    if signal.name in ERRORS:
        return Value(signal.name, f.error_names(f.AxisError(int(raw))), "")
    if signal.meaning is not None:
        return Value(signal.name, f.name_of(signal.meaning, int(raw)), "")
    if signal.scale != 1.0:
        return Value(signal.name, raw * signal.scale, signal.unit)
    return Value(signal.name, raw & signal.bits if isinstance(raw, int) else raw, signal.unit)


def node_seen(frame: Frame) -> NodeSeen | None:
    """The node that a frame concerns, with its state if it is a heartbeat; None: no CANSimple."""
    can_id, data = frame.can_id, frame.data
    if can_id & (EFF | ERR) or (can_id & (1 << f.BITS) - 1) not in LAYOUTS:
        return None
    node, command = (can_id & 0x7FF) >> f.BITS, can_id & (1 << f.BITS) - 1
    if command != Command.HEARTBEAT or can_id & RTR or not data:
        return NodeSeen(node)
    heartbeat = f.decode_heartbeat(data)
    state = f.name_of(f.AxisState, heartbeat.state)
    return NodeSeen(node, state, f.error_names(heartbeat.errors))
