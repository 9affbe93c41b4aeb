"""Between python-can's messages and frames as values: the same on every interface.

A message is made slot by slot: its constructor checks what a frame of ours can't get wrong, and
would cost a good part of a control period.
"""

import can

from bridge.frame import EFF, ERR, ID_MASK_11, ID_MASK_29, RTR, Frame

_Message = can.Message
_new = object.__new__


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
    can_id = message.arbitration_id
    if message.is_extended_id:
        can_id |= EFF
    if message.is_error_frame:
        can_id |= ERR
    if message.is_remote_frame:
        can_id |= RTR
    return can_id


def to_frame(message: can.Message) -> Frame:
    """The frame of a classic message."""
    if message.is_remote_frame:
        return Frame(can_id_of(message), bytes(message.dlc))
    return Frame(can_id_of(message), bytes(message.data))
