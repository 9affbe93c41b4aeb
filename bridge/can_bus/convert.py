"""Between python-can's messages and frames as values: the same on every interface.

A message is made slot by slot: its constructor checks what a frame of ours can't get wrong, and
would cost a good part of a control period.
"""

import can

from bridge.frame import EFF, ERR, ID_MASK_11, ID_MASK_29, RTR, Frame


def to_message(
    can_id: int,
    data: bytes,
    *,
    timestamp: float = 0.0,
    channel: str | None = None,
    is_rx: bool = False,
) -> can.Message:
    """The message of a frame."""
    message = can.Message.__new__(can.Message)
    extended = bool(can_id & EFF)
    error = bool(can_id & ERR)
    remote = bool(can_id & RTR)
    message.timestamp = timestamp
    message.arbitration_id = can_id & (ID_MASK_29 if extended or error else ID_MASK_11)
    message.is_extended_id = extended
    message.is_remote_frame = remote
    message.is_error_frame = error
    message.channel = channel
    message.dlc = len(data)
    message.data = bytearray() if remote else bytearray(data)
    message.is_fd = False
    message.is_rx = is_rx
    message.bitrate_switch = False
    message.error_state_indicator = False
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
