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
from typing import Final

from librt.strings import BytesWriter, read_i32_le, read_i64_le, write_i64_le

from bridge.frame import ERR, ID_MASK_11, MAX_DATA, RTR, Frame, flaw, write_frame, write_u32

VERSION: Final = 3
HELLO: Final = 1
WELCOME: Final = 2
REFUSED: Final = 3
FRAMES: Final = 4
BYE: Final = 5
LOST: Final = 6
SYNCHRONOUS: Final = 1
OWN: Final = 2
DONE: Final = 4
BATCHED: Final = 8
MORE: Final = 16
MAX_FRAMES: Final = 1024
MAX_BYTES: Final = 16 + 20 * MAX_FRAMES
LONGEST_BEFORE_NS: Final = 2**32 - 1

_HEADER: Final = struct.Struct("<BBHIq")
_HEADER_SIZE: Final = 16
_FRAME_SIZE: Final = 16

Key = str | int
"""A client of a bus: the name of the robot that it controls in lockstep, else a number."""
_NOBODY: Final[Mapping[Key, Frame]] = {}


class Stamped:
    """A frame and the bus time at which it ended."""

    __slots__ = ("end_ns", "frame")

    def __init__(self, end_ns: int, frame: Frame) -> None:
        self.end_ns: Final = end_ns
        self.frame: Final = frame

    def __repr__(self) -> str:
        return f"{self.frame} at {self.end_ns} ns"


class Submitted:
    """A frame that a client wants to send."""

    __slots__ = ("frame", "key")

    def __init__(self, key: Key, frame: Frame) -> None:
        self.key: Final = key
        self.frame: Final = frame


class Transmitted(Stamped):
    """A frame that ended on the bus; the key of the client that had sent it, None for a drive.

    An error frame is what a client's node tells it: `apart` has those of the nodes, `frame` is for
    clients without one. With `to` it concerns one client only.
    """

    __slots__ = ("apart", "key", "to")

    def __init__(
        self,
        end_ns: int,
        frame: Frame,
        key: Key | None = None,
        to: Key | None = None,
        apart: Mapping[Key, Frame] = _NOBODY,
    ) -> None:
        super().__init__(end_ns, frame)
        self.key: Final = key
        self.to: Final = to
        self.apart: Final = apart

    @property
    def of_drive(self) -> bool:
        """Whether it is a frame that a drive sent."""
        return self.key is None and not self.frame.can_id & ERR

    def heard_by(self, key: Key) -> bool:
        """Whether a client hears it from the bus; its own frames it doesn't."""
        if self.key is not None and self.key == key:
            return False
        return self.to is None or self.to == key

    def as_heard_by(self, key: Key) -> Stamped:
        """What it hears, and when that ended."""
        if not self.apart:
            return self
        return Stamped(self.end_ns, self.apart.get(key, self.frame))


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
    packet = BytesWriter()
    write_i64_le(packet, FRAMES | flags << 8 | len(frames) << 16)
    write_i64_le(packet, stamp_ns)
    for frame in frames:
        write_frame(packet, frame)
    return packet.getvalue()


def encode_stamped(flags: int, stamp_ns: int, frames: Sequence[Stamped], credit: int) -> bytes:
    """A FRAMES packet of frames that ended at or before `stamp_ns`, each at its own time."""
    packet = BytesWriter()
    write_u32(packet, FRAMES | flags << 8 | len(frames) << 16)
    write_u32(packet, credit & 0xFFFF_FFFF)
    write_i64_le(packet, stamp_ns)
    for stamped in frames:
        write_frame(packet, stamped.frame)
    for stamped in frames:
        write_u32(packet, min(stamp_ns - stamped.end_ns, LONGEST_BEFORE_NS))
    return packet.getvalue()


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
    if size < _HEADER_SIZE:
        return None
    kind, count = packet[0], packet[2] | packet[3] << 8
    credit = int(read_i32_le(packet, 4)) & 0xFFFF_FFFF
    found = Packet(kind, packet[1], count, int(read_i64_le(packet, 8)), credit)
    if kind == FRAMES:
        return found if _decode_frames(found, packet) else None
    if HELLO <= kind <= LOST:
        found.text = packet[_HEADER_SIZE:].decode("utf-8", "replace")
        return found
    return None


def _decode_frames(found: Packet, packet: bytes) -> bool:
    """Put the frames in the bytes into their packet; False: it is none."""
    count = found.number
    end = _HEADER_SIZE + count * _FRAME_SIZE
    stamped = len(packet) != end
    if count > MAX_FRAMES or (stamped and len(packet) != end + 4 * count):
        return False
    frames: list[Frame] = []
    before: list[int] = []
    for n in range(count):
        at = _HEADER_SIZE + n * _FRAME_SIZE
        can_id, length = int(read_i32_le(packet, at)) & 0xFFFF_FFFF, packet[at + 4]
        if (can_id > ID_MASK_11 or length > MAX_DATA) and flaw(can_id, length):
            continue
        data = bytes(length) if can_id & RTR else packet[at + 8 : at + 8 + length]
        frames.append(Frame(can_id, data))
        if stamped:
            before.append(int(read_i32_le(packet, end + 4 * n)) & 0xFFFF_FFFF)
    found.frames, found.flawed = tuple(frames), count - len(frames)
    found.before_ns = tuple(before)
    return True
