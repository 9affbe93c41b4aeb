"""One CAN frame as a value, the same for buses, drives and controllers.

`can_id` is SocketCAN's: the identifier with flag bits on top, so an 11-bit data frame is its
plain number.

    bit 31  EFF  29-bit identifier
    bit 30  RTR  remote frame; only the length of `data` counts, its bytes are zero
    bit 29  ERR  error frame; the identifier holds error classes; never together with RTR
"""

from typing import Final, NamedTuple

EFF: Final = 0x8000_0000
RTR: Final = 0x4000_0000
ERR: Final = 0x2000_0000
ID_MASK_11: Final = 0x7FF
ID_MASK_29: Final = 0x1FFF_FFFF
MAX_DATA: Final = 8


class Frame(NamedTuple):
    """A classic CAN frame: up to 8 bytes of data."""

    can_id: int
    data: bytes


def flaw(can_id: int, length: int) -> str:
    """What keeps such a frame from being one of classic CAN; "" if nothing does."""
    if not 0 <= length <= MAX_DATA:
        return f"{length} bytes of data: classic CAN carries 0 to {MAX_DATA}"
    if not 0 <= can_id < 1 << 32:
        return f"identifier {can_id:#x}: out of range"
    if can_id & ERR:
        return "a frame can't be remote and an error frame at once" if can_id & RTR else ""
    if not can_id & EFF and can_id & ID_MASK_29 > ID_MASK_11:
        return f"11-bit identifier {can_id & ID_MASK_29:#x}: the largest is {ID_MASK_11:#x}"
    return ""
