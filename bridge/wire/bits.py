"""Length of a classic CAN frame on the wire in bits, by ISO 11898-1.

    field        11-bit identifier           29-bit identifier                    stuffed
    start        0                           0                                    yes
    arbitration  identifier, RTR             base, SRR 1, IDE 1, extension, RTR   yes
    control      IDE 0, r0 0, length (4)     r1 0, r0 0, length (4)               yes
    data         8 n bits                    8 n bits                             yes
    CRC          15 bits, x¹⁵ + 0x4599       15 bits                              yes
    delimiter 1, acknowledge 1, delimiter 1, end of frame 1111111                 no
    intermission 111                                                              no

After five equal bits in a row, stuff bits included, a complementary one is inserted. So a frame has

    F = 47 + 8 n  (29-bit: 67 + 8 n)  ≤  bits  ≤  F + ⌊(F − 14) / 4⌋

with its intermission; n is 0 for remote frames. The upper bound is the one of response-time
analysis (Davis, Burns, Bril, Lukkien 2007, equation 1); no real frame is longer.
"""

from typing import Final

from bridge.frame import EFF, ERR, ID_MASK_11, ID_MASK_29, RTR, Frame, flaw

INTERMISSION_BITS: Final = 3
END_BITS: Final = 7  # end of frame
TRAILER_BITS: Final = 10  # delimiter, acknowledge, delimiter, end of frame
ERROR_FLAG_BITS: Final = 6
LONGEST_ERROR_FLAG_BITS: Final = 12  # of nodes that notice one after the other
ERROR_DELIMITER_BITS: Final = 8
ERROR_FRAME_BITS: Final = LONGEST_ERROR_FLAG_BITS + ERROR_DELIMITER_BITS + INTERMISSION_BITS
"""Of a flag that all others notice by its six dominant bits in a row, intermission included."""
SUSPEND_BITS: Final = 8  # an error passive transmitter's pause after its frame
CRC_POLYNOMIAL: Final = 0x4599
_CRC_BITS: Final = 15


def least_bits(length: int, *, extended: bool = False) -> int:
    """Bits of a frame with `length` bytes on the wire and no stuff bit, intermission included."""
    return (67 if extended else 47) + 8 * length


def most_bits(length: int, *, extended: bool = False) -> int:
    """Upper bound of the bits of a frame with `length` bytes, intermission included."""
    bits = least_bits(length, extended=extended)
    return bits + (bits - 14) // 4


def frame_bits(frame: Frame) -> int:
    """Exact number of bits of a frame on the wire, from its start through its intermission.

    Raises:
        ValueError: an error frame, or no frame of classic CAN.
    """
    head, size, data = _fields(frame)
    width = size + 7 >> 3
    crc = 0
    for byte in head.to_bytes(width, "big") + data:
        crc = (crc << 8 & 0x7FFF) ^ _CRC_TABLE[crc >> 7 ^ byte]
    # What fills the first byte up must add no stuff bit: bits in turn, the last one recessive like
    # the idle bus before a start of frame. The CRC leaves one bit of the last byte, so all are
    # looked at one bit late.
    filled = (0xAA >> (size & 7) << size) | head
    state, left, stuffed = _IDLE, 0, 0
    for byte in filled.to_bytes(width, "big") + data + (crc << 1).to_bytes(2, "big"):
        after = _STUFF_TABLE[state << 8 | left << 7 | byte >> 1]
        left = byte & 1
        state = after >> 2
        stuffed += after & 3
    return size + 8 * len(data) + _CRC_BITS + stuffed + TRAILER_BITS + INTERMISSION_BITS


def stuffed_bits(frame: Frame) -> str:
    """A frame as it is on the wire, "0" dominant, from its start through the last bit of its CRC.

    Stuff bits are in. For the rare case that one bit decides; to count, `frame_bits` is faster.
    """
    head, size, data = _fields(frame)
    content = head << 8 * len(data) | int.from_bytes(data, "big")
    raw = f"{content:0{size + 8 * len(data)}b}"
    crc = 0
    for bit in raw:
        crc = (crc << 1 & 0x7FFF) ^ (CRC_POLYNOMIAL if (crc >> 14) ^ (bit == "1") else 0)
    wire: list[str] = []
    last, run = "1", 0
    for bit in f"{raw}{crc:015b}":
        run = run + 1 if bit == last else 1
        last = bit
        wire.append(bit)
        if run == 5:
            last, run = ("0" if bit == "1" else "1"), 1
            wire.append(last)
    return "".join(wire)


def arbitration_key(can_id: int) -> int:
    """The arbitration field as a number: whose is lower wins the bus.

    From bit 31: identifier or base (11), RTR or SRR, IDE, and of 29-bit ones extension (18), RTR.
    """
    if can_id <= ID_MASK_11:
        return can_id << 21
    remote = 1 if can_id & RTR else 0
    if can_id & EFF:
        identifier = can_id & ID_MASK_29
        return identifier >> 18 << 21 | 0b11 << 19 | (identifier & 0x3FFFF) << 1 | remote
    return (can_id & ID_MASK_11) << 21 | remote << 20


def _fields(frame: Frame) -> tuple[int, int, bytes]:
    """Start through control field as a number, its bits, and the data that follow."""
    can_id, data = frame.can_id, frame.data
    length = len(data)
    if wrong := flaw(can_id, length) or ("an error frame has no length" if can_id & ERR else ""):
        raise ValueError(f"frame 0x{can_id:X}: {wrong}")
    if can_id <= ID_MASK_11:
        return can_id << 7 | length, 19, data
    if can_id & RTR:
        data = b""
    key = arbitration_key(can_id)
    if can_id & EFF:
        return key << 6 | length, 39, data
    return key >> 20 << 6 | length, 19, data


def _crc_of(byte: int) -> int:
    crc = byte << 7
    for _ in range(8):
        crc = (crc << 1) ^ (CRC_POLYNOMIAL if crc & 0x4000 else 0)
    return crc & 0x7FFF


def _stuffed(last: int, run: int, byte: int) -> int:
    """State 4 last + run − 1 after a byte; in 2 bits below the stuff bits that it brought."""
    stuffed = 0
    for n in range(7, -1, -1):
        bit = byte >> n & 1
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            last, run = 1 - bit, 1
            stuffed += 1
    return (4 * last + run - 1) << 2 | stuffed


_CRC_TABLE: Final = [_crc_of(byte) for byte in range(256)]
_STUFF_TABLE: Final = bytes(
    [_stuffed(last, run, byte) for last in (0, 1) for run in (1, 2, 3, 4) for byte in range(256)]
)
_IDLE: Final = 4  # after a single recessive bit
