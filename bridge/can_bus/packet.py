"""Packets between a bus's hub and its clients: frames of one instant travel together.

    header   kind u8, flags u8, count u16, room u32, stamp i64         little endian, 16 bytes
    frame    can_id u32, length u8, 3 bytes padding, data 8 bytes      as Linux struct can_frame
    before   u32 for each frame, after all frames; absent if all are 0

    kind       from     flags, count and body
    HELLO      client   flags PACED, GATHERED, OWN; count = version; body = the client's name
    WELCOME    hub      stamp = bus time; count = version; room = the client's transmit queue
    REFUSED    hub      body = reason
    FRAMES     both     count frames; from the hub OWN: the client's own come back;
                        from a paced client DONE: all it had to say until `stamp`, which it echoes
    BYE        hub      body = reason

`stamp` is bus time: nanoseconds since the bus was powered up; a frame ended `before` nanoseconds
earlier. `room` in WELCOME is how many frames may wait at the client's node, 0 for a bus on which
frames take no time; in FRAMES from the hub it says how many of the client's frames have left its
queue since it came, modulo 2³². What isn't a packet decodes to None.
"""

import struct
from collections.abc import Sequence
from typing import NamedTuple

from bridge.can_bus.traffic import Stamped
from bridge.frame import MAX_DATA, Frame

VERSION = 2
HELLO, WELCOME, REFUSED, FRAMES, BYE = 1, 2, 3, 4, 5
PACED, OWN, DONE, GATHERED = 1, 2, 4, 8
MAX_FRAMES = 1024
MAX_BYTES = 16 + 20 * MAX_FRAMES
LONGEST_BEFORE_NS = 2**32 - 1

_new = tuple.__new__  # of the named tuples below, past their constructor: this is the hot path
_HEADER = struct.Struct("<BBHIq")
_FRAME = struct.Struct("<IB3x8s")
_ONE = struct.Struct("<BBHIqIB3x8s")
_TWO = struct.Struct("<BBHIqIB3x8sIB3x8s")


class Packet(NamedTuple):
    """A decoded packet; `frames` for FRAMES, `text` for the others."""

    kind: int
    flags: int
    number: int  # the header's count
    stamp_ns: int
    frames: tuple[Frame, ...]
    text: str
    room: int = 0
    before_ns: tuple[int, ...] = ()  # of each frame; empty: all of them ended at `stamp_ns`


def encode_frames(flags: int, stamp_ns: int, frames: Sequence[Frame]) -> bytes:
    """A FRAMES packet of one instant: `MAX_FRAMES` frames of 8 bytes at most."""
    count = len(frames)
    if count == 2:
        (id_1, data_1), (id_2, data_2) = frames
        return _TWO.pack(
            FRAMES, flags, 2, 0, stamp_ns, id_1, len(data_1), data_1, id_2, len(data_2), data_2
        )
    if count == 1:
        ((can_id, data),) = frames
        return _ONE.pack(FRAMES, flags, 1, 0, stamp_ns, can_id, len(data), data)
    body = [_FRAME.pack(can_id, len(data), data) for can_id, data in frames]
    return _HEADER.pack(FRAMES, flags, count, 0, stamp_ns) + b"".join(body)


def encode_stamped(flags: int, stamp_ns: int, frames: Sequence[Stamped], room: int) -> bytes:
    """A FRAMES packet of frames that ended at or before `stamp_ns`, each at its own time."""
    count = len(frames)
    body = [_FRAME.pack(can_id, len(data), data) for _, (can_id, data) in frames]
    before = [min(stamp_ns - end_ns, LONGEST_BEFORE_NS) for end_ns, _ in frames]
    header = _HEADER.pack(FRAMES, flags, count, room & 0xFFFF_FFFF, stamp_ns)
    return header + b"".join(body) + struct.pack(f"<{count}I", *before)


def encode_text(
    kind: int,
    text: str = "",
    *,
    flags: int = 0,
    count: int = 0,
    stamp_ns: int = 0,
    room: int = 0,
) -> bytes:
    """A packet of any other kind."""
    return _HEADER.pack(kind, flags, count, room, stamp_ns) + text.encode()[:1024]


def decode(packet: bytes) -> Packet | None:
    """The packet in the bytes, None if there is none."""
    size = len(packet)
    if size == _TWO.size and packet[0] == FRAMES and packet[2] == 2 and packet[3] == 0:
        kind, flags, count, room, stamp, id_1, n_1, data_1, id_2, n_2, data_2 = _TWO.unpack(packet)
        if n_1 > MAX_DATA or n_2 > MAX_DATA:
            return None
        both = (_new(Frame, (id_1, data_1[:n_1])), _new(Frame, (id_2, data_2[:n_2])))
        return _new(Packet, (kind, flags, count, stamp, both, "", room, ()))
    if size < _HEADER.size:
        return None
    kind, flags, count, room, stamp = _HEADER.unpack_from(packet)
    body = packet[_HEADER.size :]
    if kind == FRAMES:
        end = count * _FRAME.size
        if count > MAX_FRAMES or len(body) not in (end, end + 4 * count):
            return None
        parts = list(_FRAME.iter_unpack(body[:end]))
        if any(length > MAX_DATA for _, length, _ in parts):
            return None
        frames = tuple(Frame(can_id, data[:length]) for can_id, length, data in parts)
        before = struct.unpack(f"<{count}I", body[end:]) if len(body) > end else ()
        return Packet(kind, flags, count, stamp, frames, "", room, before)
    if HELLO <= kind <= BYE:
        return Packet(kind, flags, count, stamp, (), body.decode("utf-8", "replace"), room)
    return None
