"""One CAN frame as a value, the same for buses, drives and controllers.

`can_id` is SocketCAN's: the identifier with flag bits on top, so an 11-bit data frame is its
plain number.

    bit 31  EFF  29-bit identifier
    bit 30  RTR  remote frame; only the length of `data` counts, its bytes are zero
    bit 29  ERR  error frame; the identifier holds error classes; never together with RTR
"""

from typing import Final

from librt.strings import BytesWriter, write_i32_le, write_i64_le

EFF: Final = 0x8000_0000
RTR: Final = 0x4000_0000
ERR: Final = 0x2000_0000
ID_MASK_11: Final = 0x7FF
ID_MASK_29: Final = 0x1FFF_FFFF
MAX_DATA: Final = 8


class Frame:
    """A classic CAN frame: up to 8 bytes of data.

    A value: equal frames are interchangeable, and the order is by identifier, then by data. A class
    of its own and no named tuple, which costs compiled modules several times as much to make.
    """

    __slots__ = ("can_id", "data")

    def __init__(self, can_id: int, data: bytes) -> None:
        self.can_id: Final = can_id
        self.data: Final = data

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Frame) and self.can_id == other.can_id and self.data == other.data

    def __lt__(self, other: "Frame") -> bool:
        if self.can_id != other.can_id:
            return self.can_id < other.can_id
        return self.data < other.data

    def __hash__(self) -> int:
        return hash((self.can_id, self.data))

    def __repr__(self) -> str:
        return f"Frame({self.can_id:#x}, {self.data!r})"


def write_u32(out: BytesWriter, value: int) -> None:
    """Add a number below 2³² in 4 bytes, little endian."""
    write_i32_le(out, value - (value >> 31 << 32))  # the signed number of the same bits


def write_frame(out: BytesWriter, frame: Frame, flags: int = 0) -> None:
    """Add a frame in 16 bytes, as Linux's `struct can_frame`, with flags in its first spare byte.

    identifier u32, length u8, flags u8, 2 bytes padding, 8 bytes of data padded by zeros;
    little endian. The frame is one of classic CAN (`flaw`), `flags` fit 8 bits.
    """
    data = frame.data
    length = len(data)
    write_i64_le(out, frame.can_id | length << 32 | flags << 40)
    out.write(data)
    for _ in range(MAX_DATA - length):
        out.append(0)


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
