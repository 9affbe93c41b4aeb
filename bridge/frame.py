"""One CAN frame as a value, the same for buses, drives and controllers.

`can_id` is SocketCAN's: the identifier with flag bits on top, so an 11-bit data frame is its
plain number.

    bit 31  EFF  29-bit identifier
    bit 30  RTR  remote frame; only the length of `data` counts, its bytes are zero
    bit 29  ERR  error frame; the identifier holds error classes
"""

from typing import NamedTuple

EFF = 0x8000_0000
RTR = 0x4000_0000
ERR = 0x2000_0000
ID_MASK_11 = 0x7FF
ID_MASK_29 = 0x1FFF_FFFF
MAX_DATA = 8


class Frame(NamedTuple):
    """A classic CAN frame: up to 8 bytes of data."""

    can_id: int
    data: bytes
