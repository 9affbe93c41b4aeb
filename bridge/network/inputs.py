"""The input log of a controller: everything that its outputs depend on, in order, and its answers.

An entry is its head, then its payload. Times are bus times [ns]: of a frame that of its reception,
of all others that of the newest tick.

    head      payload's length u32   kind u8   time i64                     little endian

    kind      payload
    BEGIN     rejoins u8, first tick i64              a controller was started, perhaps again;
                                                      the tick: of one that re-joins in lockstep
    FRAME     identifier u32, data                    from the bus
    PATH      in-neighbour, NUL, `PathState`          as over the network
    POSE      NUL, `PoseFix`
    PLACE     in-neighbour, NUL, `PoseFix`            for the emulated network
    LEADER    NUL, `LeaderSpeed`
    CLOSING   tick i64                                the closing tick, if it isn't the scenario's
    CLOCK     now_ns i64, late_s f64, round_trip_s f64    real time, before every tick
    TROUBLE   source, NUL, text; none: it is over     of the bus, the launcher, the machine
    UNSENT    tick i64                                its frames were not sent
    TICK      tick i64, then of every frame sent      a period was computed; the answer
              identifier u32, length u8, data
    STOP      as after the tick of a TICK             told to stop before the closing tick
    ORDER     NUL, `FaultOrder`                       with the tick at which it acts
    LEADER_ORDER  NUL, `LeaderOrder`                  likewise

A replay feeds a controller what is left of its answers, and compares the answers. Whatever else may
reach a controller is a kind more: here, where the controller takes it
(`agents.inputs.LoggedAgent`), and where a replay gives it (`agents.inputs.feed`).
"""

import struct
from collections.abc import Callable, Iterator, Sequence
from enum import IntEnum
from typing import Final, NamedTuple

from librt.strings import BytesWriter, write_f64_le, write_i64_le

from bridge.frame import Frame, write_u32

BLOCK_BYTES: Final = 8192
"""Bytes that are gathered before they are handed on."""

_HEAD: Final = struct.Struct("<IBq")
_IDENTIFIER: Final = struct.Struct("<I")
_IDENTIFIER_BYTES: Final = 4
_TICK: Final = struct.Struct("<q")
_TICK_BYTES: Final = 8
_BEGIN: Final = struct.Struct("<?q")
_CLOCK: Final = struct.Struct("<qdd")
_CLOCK_BYTES: Final = 24
_SENT: Final = struct.Struct("<IB")
_SENT_BYTES: Final = 5  # of a frame sent, before its data
_NUL: Final = b"\0"


class Kind(IntEnum):
    """Kinds of entries."""

    BEGIN = 0
    FRAME = 1
    PATH = 2
    POSE = 3
    PLACE = 4
    LEADER = 5
    CLOSING = 6
    CLOCK = 7
    TROUBLE = 8
    UNSENT = 9
    TICK = 10
    STOP = 11
    ORDER = 12
    LEADER_ORDER = 13


_FRAME: Final = int(Kind.FRAME)
_OF_CLOCK: Final = int(Kind.CLOCK)
_OF_TICK: Final = int(Kind.TICK)
_STOP: Final = int(Kind.STOP)


class Input(NamedTuple):
    """One entry."""

    kind: Kind
    time_ns: int
    payload: bytes

    def begin(self) -> tuple[bool, int]:
        """Of a BEGIN, whether the controller re-joins, and its first tick if it does in lockstep.

        Raises:
            InputsError: it is of another version.
        """
        if len(self.payload) != _BEGIN.size:
            raise InputsError("the log begins as none of this version")
        rejoins, resumes_tick = _BEGIN.unpack(self.payload)
        return rejoins, resumes_tick

    def frame(self) -> Frame:
        """The frame of a FRAME."""
        return Frame(_IDENTIFIER.unpack_from(self.payload)[0], self.payload[_IDENTIFIER.size :])

    def named(self) -> tuple[str, bytes]:
        """Source and content of PATH, POSE, PLACE, LEADER, ORDER and TROUBLE."""
        source, _, content = self.payload.partition(_NUL)
        return source.decode(), content

    def tick(self) -> int:
        """The tick of CLOSING, UNSENT and TICK."""
        tick: int = _TICK.unpack_from(self.payload)[0]
        return tick

    def clock(self) -> tuple[int, float, float]:
        """now_ns, late_s and round_trip_s of a CLOCK."""
        now_ns, late_s, round_trip_s = _CLOCK.unpack(self.payload)
        return now_ns, late_s, round_trip_s

    def sent(self) -> list[Frame]:
        """The frames that were sent at a TICK or a STOP."""
        frames, at = [], _TICK.size if self.kind is Kind.TICK else 0
        while at < len(self.payload):
            can_id, length = _SENT.unpack_from(self.payload, at)
            at += _SENT.size + length
            frames.append(Frame(can_id, self.payload[at - length : at]))
        return frames


class InputsError(ValueError):
    """Bytes that are no input log; the text says where and why."""


def entries(log: bytes) -> Iterator[Input]:
    """The entries of a log; one that is cut at its end is left out.

    Raises:
        InputsError: an entry has no kind that is known.
    """
    at, end = 0, len(log)
    while at + _HEAD.size <= end:
        length, kind, time_ns = _HEAD.unpack_from(log, at)
        begin, at = at, at + _HEAD.size + length
        if kind >= len(Kind):
            raise InputsError(f"byte {begin}: no entry has the kind {kind}")
        if at <= end:
            yield Input(Kind(kind), time_ns, log[at - length : at])


class InputBuffer:
    """Gathers entries and hands their bytes on, at the end of a tick.

    `hand_on(first, block, final)` gets a block whenever `BLOCK_BYTES` are there, from byte
    `first` of the log, and a last, perhaps empty one from `finish`.
    """

    __slots__ = ("_block", "_first", "_hand_on", "_now_ns")

    def __init__(self, hand_on: Callable[[int, bytes, bool], None]) -> None:
        self._hand_on = hand_on
        self._block = BytesWriter()
        self._first = 0
        self._now_ns = 0

    def begin(self, *, rejoins: bool, resumes_tick: int = 0) -> None:
        """A controller begins."""
        self._add(Kind.BEGIN, _BEGIN.pack(rejoins, resumes_tick))

    def frame(self, can_id: int, data: bytes | bytearray, at_ns: int) -> None:
        """A frame was received."""
        self._head(_IDENTIFIER_BYTES + len(data), _FRAME, at_ns)
        write_u32(self._block, can_id)
        self._block.write(data)

    def named(self, kind: Kind, source: str, content: bytes) -> None:
        """A message was received, or a trouble noted."""
        self._add(kind, source.encode() + _NUL + content)

    def clock(self, now_ns: int, late_s: float, round_trip_s: float) -> None:
        """The wall clock before a tick."""
        self._head(_CLOCK_BYTES, _OF_CLOCK, self._now_ns)
        write_i64_le(self._block, now_ns)
        write_f64_le(self._block, late_s)
        write_f64_le(self._block, round_trip_s)

    def about(self, kind: Kind, tick: int) -> None:
        """A CLOSING or UNSENT tick."""
        self._add(kind, _TICK.pack(tick))

    def tick(self, tick: int, now_ns: int, sent: Sequence[Frame]) -> None:
        """A tick of this bus time was computed."""
        self._now_ns = now_ns
        self._head(_TICK_BYTES + _size(sent), _OF_TICK, now_ns)
        write_i64_le(self._block, tick)
        self._sent(sent)
        if len(self._block) >= BLOCK_BYTES:
            self._flush(final=False)

    def stop(self, sent: Sequence[Frame]) -> None:
        """The controller was told to stop."""
        self._head(_size(sent), _STOP, self._now_ns)
        self._sent(sent)

    def hand_on(self) -> None:
        """Hand on what is there."""
        if len(self._block):
            self._flush(final=False)

    def finish(self) -> None:
        """Hand on what is left and say that nothing follows."""
        self._flush(final=True)

    def _add(self, kind: Kind, payload: bytes) -> None:
        self._head(len(payload), kind, self._now_ns)
        self._block.write(payload)

    def _head(self, length: int, kind: int, at_ns: int) -> None:
        block = self._block
        write_u32(block, length)
        block.append(kind)
        write_i64_le(block, at_ns)

    def _sent(self, frames: Sequence[Frame]) -> None:
        block = self._block
        for frame in frames:
            write_u32(block, frame.can_id)
            block.append(len(frame.data))
            block.write(frame.data)

    def _flush(self, *, final: bool) -> None:
        block = self._block.getvalue()
        self._block.truncate(0)
        whole = range(0, len(block) - BLOCK_BYTES, BLOCK_BYTES)
        for begin in whole:  # a start message may be long
            self._pass_on(block[begin : begin + BLOCK_BYTES], final=False)
        self._pass_on(block[len(whole) * BLOCK_BYTES :], final=final)

    def _pass_on(self, block: bytes, *, final: bool) -> None:
        self._hand_on(self._first, block, final)
        self._first += len(block)


def _size(frames: Sequence[Frame]) -> int:
    """Bytes of frames that were sent."""
    return sum([_SENT_BYTES + len(frame.data) for frame in frames])
