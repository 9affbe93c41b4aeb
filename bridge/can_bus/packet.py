"""Packets between the hub of a bus and its clients, and the frames that they carry.

    header   kind u8, flags u8, count u16, credit u32, stamp i64       little endian, 16 bytes
    frame    can_id u32, length u8, 3 bytes padding, data 8 bytes      as Linux struct can_frame
    before   u32 for each frame, after all frames; absent if all are 0

    kind         from     flags, count and body
    1 HELLO      client   flags SYNCHRONOUS, BATCHED, OWN; count = version; body = the client's
                          name; a synchronous client adds a zero byte and its secret
    2 WELCOME    hub      stamp = bus time; count = version; credit = length of the transmit queue
    3 REFUSED    hub      body = reason
    4 FRAMES     both     count frames, at most 1024; from the hub OWN: the client's own frames;
                          MORE: the next packet continues the same instant; from a synchronous
                          client DONE: its complete answer to the packet with this `stamp`
    5 BYE        hub      body = reason
    6 LOST       hub      credit = number of frames lost here: the client did not read in time

    flag         SYNCHRONOUS 1, OWN 2, DONE 4, BATCHED 8, MORE 16

`stamp` is bus time: nanoseconds since power-up of the bus; a frame ended `before` nanoseconds
earlier. Credits bound the transmit queue of a client: WELCOME grants a credit for each place in it
(0: frames take no time, the queue has no bound), and FRAMES from the hub carries the number of
credits returned since then, modulo 2³². Bytes that are no packet decode to
None. A frame that violates classic CAN (`bridge.frame.flaw`) is left out of its packet and counted.
The data of remote frames is zero.
"""

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from bridge.frame import ERR, ID_MASK_11, MAX_DATA, RTR, Frame, flaw

VERSION: Final = 3
HELLO, WELCOME, REFUSED, FRAMES, BYE, LOST = 1, 2, 3, 4, 5, 6
SYNCHRONOUS, OWN, DONE, BATCHED, MORE = 1, 2, 4, 8, 16
MAX_FRAMES: Final = 1024
MAX_BYTES: Final = 16 + 20 * MAX_FRAMES
LONGEST_BEFORE_NS: Final = 2**32 - 1

_new: Final = tuple.__new__  # of the tuples below, past their constructor: the hot path
_HEADER: Final = struct.Struct("<BBHIq")
_FRAME: Final = struct.Struct("<IB3x8s")
_ONE: Final = struct.Struct("<BBHIqIB3x8s")
_TWO: Final = struct.Struct("<BBHIqIB3x8sIB3x8s")
_ONE_SIZE: Final = 32
_TWO_SIZE: Final = 48

Key = str | int
"""A client of a bus: the name of the robot that it controls in lockstep, else a number."""
_NOBODY: Final[Mapping[Key, Frame]] = {}


class Stamped(NamedTuple):
    """A frame and the bus time at which it ended."""

    end_ns: int
    frame: Frame


class Submitted(NamedTuple):
    """A frame that a client wants to send."""

    key: Key
    frame: Frame


class Transmitted(NamedTuple):
    """A frame that ended on the bus; the key of the client that had sent it, None for a drive.

    An error frame is what a client's node tells it: `apart` has those of the nodes, `frame` is for
    clients without one. With `to` it concerns one client only.
    """

    end_ns: int
    frame: Frame
    key: Key | None = None
    to: Key | None = None
    apart: Mapping[Key, Frame] = _NOBODY

    @property
    def of_drive(self) -> bool:
        """Whether it is a frame that a drive sent."""
        return self.key is None and not self.frame.can_id & ERR

    def heard_by(self, key: Key) -> bool:
        """Whether a client hears it from the bus; its own frames it doesn't."""
        return key != self.key and self.to in (None, key)

    def as_heard_by(self, key: Key) -> Stamped:
        """What it hears, and when that ended."""
        return Stamped(self.end_ns, self.apart.get(key, self.frame) if self.apart else self.frame)


class Packet:
    """A decoded packet; `frames` for FRAMES, `text` for the others."""

    __slots__ = (
        *("before_ns", "credit", "flags", "flawed", "frames", "kind", "number", "stamp_ns", "text"),
    )

    def __init__(
        self,
        kind: int,
        flags: int,
        number: int,
        stamp_ns: int,
        credit: int,
        frames: tuple[Frame, ...] = (),
        text: str = "",
    ) -> None:
        self.kind = kind
        self.flags = flags
        self.number = number  # the header's count
        self.stamp_ns = stamp_ns
        self.credit = credit
        self.frames = frames
        self.text = text
        self.before_ns: tuple[int, ...] = ()  # of each frame; empty: all ended at `stamp_ns`
        self.flawed = 0  # frames that were none of classic CAN


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


def encode_stamped(flags: int, stamp_ns: int, frames: Sequence[Stamped], credit: int) -> bytes:
    """A FRAMES packet of frames that ended at or before `stamp_ns`, each at its own time."""
    count = len(frames)
    body = [_FRAME.pack(can_id, len(data), data) for _, (can_id, data) in frames]
    before = [min(stamp_ns - end_ns, LONGEST_BEFORE_NS) for end_ns, _ in frames]
    header = _HEADER.pack(FRAMES, flags, count, credit & 0xFFFF_FFFF, stamp_ns)
    return header + b"".join(body) + struct.pack(f"<{count}I", *before)


def split(flags: int, stamp_ns: int, frames: Sequence[Stamped], credit: int) -> Iterator[bytes]:
    """The same in as many packets as it takes, at least one."""
    last = max(len(frames) - 1, 0) // MAX_FRAMES * MAX_FRAMES
    for first in range(0, last + 1, MAX_FRAMES):
        more = MORE if first < last else 0
        yield encode_stamped(flags | more, stamp_ns, frames[first : first + MAX_FRAMES], credit)


def frames_in(packet: bytes) -> int:
    """How many frames a packet of ours has, or stands for."""
    if packet[0] == FRAMES:
        return packet[2] | packet[3] << 8
    return int.from_bytes(packet[4:8], "little") if packet[0] == LOST else 0


def encode_text(
    kind: int,
    text: str = "",
    *,
    flags: int = 0,
    count: int = 0,
    stamp_ns: int = 0,
    credit: int = 0,
) -> bytes:
    """A packet of any other kind."""
    return _HEADER.pack(kind, flags, count, credit, stamp_ns) + text.encode()[:1024]


def encode_lost(frames: int) -> bytes:
    """A packet that says how many frames are missing here."""
    return _HEADER.pack(LOST, 0, 0, min(frames, 0xFFFF_FFFF), 0)


def decode(packet: bytes) -> Packet | None:
    """The packet in the bytes, None if there is none."""
    size = len(packet)
    if size == _TWO_SIZE and packet[0] == FRAMES and packet[2] == 2 and packet[3] == 0:
        kind, flags, count, credit, stamp, id_1, n_1, data_1, id_2, n_2, data_2 = _TWO.unpack(
            packet
        )
        if n_1 <= MAX_DATA and n_2 <= MAX_DATA and id_1 <= ID_MASK_11 and id_2 <= ID_MASK_11:
            both = (_frame(id_1, n_1, data_1), _frame(id_2, n_2, data_2))
            return Packet(kind, flags, count, stamp, credit, both)
    if size == _ONE_SIZE and packet[0] == FRAMES and packet[2] == 1 and packet[3] == 0:
        kind, flags, count, credit, stamp, can_id, n, data = _ONE.unpack(packet)
        if n <= MAX_DATA and can_id <= ID_MASK_11:
            return Packet(kind, flags, count, stamp, credit, (_frame(can_id, n, data),))
    if size < _HEADER.size:
        return None
    kind, flags, count, credit, stamp = _HEADER.unpack_from(packet)
    found = Packet(kind, flags, count, stamp, credit)
    body = packet[_HEADER.size :]
    if kind == FRAMES:
        return found if _decode_frames(found, body) else None
    if HELLO <= kind <= LOST:
        found.text = body.decode("utf-8", "replace")
        return found
    return None


def _frame(can_id: int, length: int, data: bytes) -> Frame:
    return _new(Frame, (can_id, data if length == MAX_DATA else data[:length]))


def _decode_frames(found: Packet, body: bytes) -> bool:
    """Put the frames in the bytes into their packet; False: it is none."""
    count = found.number
    end = count * _FRAME.size
    if count > MAX_FRAMES or len(body) not in (end, end + 4 * count):
        return False
    before = struct.unpack(f"<{count}I", body[end:]) if len(body) > end else ()
    frames, kept = [], []
    for n, (can_id, length, data) in enumerate(_FRAME.iter_unpack(body[:end])):
        if (can_id > ID_MASK_11 or length > MAX_DATA) and flaw(can_id, length):
            continue
        content = bytes(length) if can_id & RTR else data[:length]
        frames.append(Frame(can_id, content))
        kept.append(n)
    found.flawed = count - len(kept)
    if found.flawed and before:
        before = tuple(before[n] for n in kept)
    found.frames, found.before_ns = tuple(frames), before
    return True
