"""Conversion between python-can messages and frames; opening a bus of any interface; its end.

A message is made slot by slot: its constructor checks what a frame of ours can't get wrong, and
would cost a good part of a control period.
"""

from operator import index
from typing import Any

import can

from bridge.frame import EFF, ERR, ID_MASK_11, ID_MASK_29, MAX_DATA, RTR, Frame, flaw
from configs.connections import Settings
from configs.errors import InfrastructureError

_Message = can.Message
_new = object.__new__


class BusClosedError(can.CanOperationError):
    """The bus was closed, at the end of its run; the text has the reason.

    Here, as a class of python-can can't be the base of a compiled one.
    """


def open_bus(user: str, settings: Settings) -> can.BusABC:
    """`can.Bus(**settings)`, verbatim: python-can checks what its interface takes.

    Raises:
        InfrastructureError: naming the user of the bus, the interface, the channel and the reason.
    """
    options: dict[str, Any] = dict(settings)
    try:
        return can.Bus(**options)
    # Interfaces raise what their libraries raise: a missing device is an OSError on SocketCAN and
    # a serial.SerialException on slcan, a wrong option a TypeError.
    except (can.CanError, OSError, TypeError, ValueError, ImportError) as error:
        named = f"{options.get('interface')} channel {options.get('channel')!r}"
        raise InfrastructureError(f"{user}: no CAN bus: {named}: {error}") from error


def to_message(
    can_id: int,
    data: bytes,
    timestamp: float = 0.0,
    channel: str | None = None,
    is_rx: bool = False,
) -> can.Message:
    """The message of a frame."""
    message = _new(_Message)
    message.timestamp = timestamp
    message.channel = channel
    message.dlc = len(data)
    message.is_rx = is_rx
    message.is_fd = message.bitrate_switch = message.error_state_indicator = False
    if can_id <= ID_MASK_11:
        message.arbitration_id = can_id
        message.is_extended_id = message.is_remote_frame = message.is_error_frame = False
        message.data = bytearray(data)
        return message
    extended = message.is_extended_id = bool(can_id & EFF)
    error = message.is_error_frame = bool(can_id & ERR)
    remote = message.is_remote_frame = bool(can_id & RTR)
    message.arbitration_id = can_id & (ID_MASK_29 if extended or error else ID_MASK_11)
    message.data = bytearray() if remote else bytearray(data)
    return message


def can_id_of(message: can.Message) -> int:
    """SocketCAN's identifier of a message, with its flags."""
    can_id = index(message.arbitration_id)
    if message.is_extended_id:
        can_id |= EFF
    if message.is_error_frame:
        can_id |= ERR
    if message.is_remote_frame:
        can_id |= RTR
    return can_id


def to_frame(message: can.Message) -> Frame:
    """The frame of a classic message: what `can.Message(check=True)` takes.

    Raises:
        ValueError: it is none, as the text says.
    """
    flagged = message.is_extended_id or message.is_remote_frame or message.is_error_frame
    if not flagged and not message.is_fd:
        can_id, data = message.arbitration_id, message.data
        if (
            type(can_id) is int
            and 0 <= can_id <= ID_MASK_11
            and type(data) is bytearray
            and len(data) == message.dlc <= MAX_DATA
        ):
            return Frame(can_id, bytes(data))
    return _checked(message)


def _checked(message: can.Message) -> Frame:
    if message.is_fd:
        raise ValueError("an FD frame: the bus is classic CAN")
    wide = message.is_extended_id or message.is_error_frame
    limit = ID_MASK_29 if wide else ID_MASK_11
    try:
        identifier, length = index(message.arbitration_id), index(message.dlc)
        data = bytes(memoryview(message.data or b""))
    except TypeError as error:
        raise ValueError(f"identifier, length or data of a wrong type: {error}") from error
    if not 0 <= identifier <= limit:
        bits = 29 if wide else 11
        raise ValueError(f"identifier {identifier:#x}: {bits} bits hold 0 to {limit:#x}")
    can_id = can_id_of(message)
    if wrong := flaw(can_id, length):
        raise ValueError(wrong)
    if message.is_remote_frame and data:
        raise ValueError(f"a remote frame with {len(data)} bytes of data: it carries none")
    if not message.is_remote_frame and len(data) != length:
        raise ValueError(f"dlc {length} and {len(data)} bytes of data: they must match")
    return Frame(can_id, data or bytes(length))
