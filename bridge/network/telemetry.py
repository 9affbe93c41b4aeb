"""Rows of what is recorded of every robot at every tick (`configs.signals`), and their packing.

A row is a fixed number of float64; rows of consecutive ticks make a block, the unit that travels
over Zenoh.
"""

import struct
from collections.abc import Callable, Sequence
from typing import Final

from librt.strings import BytesWriter, write_f64_le, write_i64_le

from bridge.frame import Frame, write_frame
from bridge.network.link import Publisher
from bridge.network.messages import Rows
from configs.brief import ROWS_WITHIN_NS, UNWATCHED_ROWS_WITHIN_NS
from configs.signals import PLANT_SIGNALS, Signal


def row_of(signals: Sequence[Signal]) -> struct.Struct:
    """The row of a table of signals."""
    return struct.Struct(f"<{len(signals)}d")


PLANT_ROW: Final = row_of(PLANT_SIGNALS)

BLOCK_TICKS: Final = 128
"""Rows that are gathered before a block is sent, unless it is old before."""
LOOKS: Final = 4
"""Looks at a block's age within the time in which it is handed on."""


def put_rows(publisher: Publisher, first: int, count: int, block: bytes, final: bool) -> None:
    """Put a block as a `RowBuffer` hands it on."""
    publisher.put(Rows(first, count, block, final).encode())


def _always() -> bool:
    return True


class RowBuffer:
    """Gathers the rows of consecutive ticks and hands them on as blocks.

    `hand_on(first_tick, count, rows, final)` gets a block whenever `BLOCK_TICKS` rows are there,
    or some have been there for a while, and a last, perhaps empty one from `finish`. Where rows
    begin and end in blocks changes nothing in a record.

    A row is added as it is, or begun, put number by number, and ended.

    Args:
        row: of the table of signals.
        hand_on: called with each block.
        within_ns: a block is handed on so long after its first row, if `look` is called `LOOKS`
            times in that time.
        watched: whether somebody waits for the rows, asked once a block; one that nobody waits for
            is handed on after `UNWATCHED_ROWS_WITHIN_NS`.
    """

    __slots__ = (
        *("_age_ns", "_block", "_count", "_due_ns", "_first_tick", "_hand_on", "_handed_on"),
        *("_late_ns", "_row", "_seen", "_size", "_unwatched_age_ns", "_watched"),
    )

    def __init__(
        self,
        row: struct.Struct,
        hand_on: Callable[[int, int, bytes, bool], None],
        within_ns: int = ROWS_WITHIN_NS,
        watched: Callable[[], bool] = _always,
    ) -> None:
        self._hand_on = hand_on
        self._watched = watched
        self._age_ns = within_ns * (LOOKS - 1) // LOOKS
        self._unwatched_age_ns = max(UNWATCHED_ROWS_WITHIN_NS - within_ns // LOOKS, self._age_ns)
        self._seen = False  # whether it is known since when there is a row, and so:
        self._due_ns = 0  # when the block goes on if somebody watches
        self._late_ns = 0  # and when in any case
        self._row = row
        self._size = row.size
        self._block = BytesWriter()
        self._handed_on = b""  # the block before
        self._first_tick = 0
        self._count = 0

    def add(self, tick: int, row: Sequence[float]) -> None:
        """Add the row of one tick.

        Raises:
            ValueError: it has more or fewer values than the table of signals.
        """
        self.begin(tick)
        for value in row:
            write_f64_le(self._block, value)
        self.end()

    def begin(self, tick: int) -> None:
        """Begin the row of one tick; its numbers follow, in the order of the signals."""
        if self._count == 0:
            self._first_tick = tick

    def put(self, value: float) -> None:
        """Put one number of the row."""
        write_f64_le(self._block, value)

    def end(self) -> None:
        """The row is complete.

        Raises:
            ValueError: it has more or fewer values than the table of signals.
        """
        self._count = count = self._count + 1
        if len(self._block) != count * self._size:
            tick, values = self._first_tick + count - 1, len(self._block) // 8
            raise ValueError(
                f"tick {tick}: a row of {values - (count - 1) * self._size // 8} values instead of"
                f" {self._size // 8}"
            )
        if count == BLOCK_TICKS:
            self._flush(final=False)

    @property
    def newest(self) -> tuple[float, ...]:
        """The values of the newest row; empty before there is one."""
        block = self._block.getvalue() if self._count else self._handed_on
        return self._row.unpack(block[-self._row.size :]) if block else ()

    def look(self, now_ns: int) -> None:
        """Hand on what has been there for so long, by a clock [ns]."""
        if not self._count:
            return
        if not self._seen:
            self._seen = True
            self._due_ns = now_ns + self._age_ns
            self._late_ns = now_ns + self._unwatched_age_ns
        elif now_ns >= self._due_ns:
            if now_ns >= self._late_ns or self._watched():
                self._flush(final=False)
            else:
                self._due_ns = self._late_ns

    def hand_on(self) -> None:
        """Hand on what is there."""
        if self._count:
            self._flush(final=False)

    def finish(self) -> None:
        """Hand on what is left and say that nothing follows."""
        self._flush(final=True)

    def leave(self, ticks: int, *, final: bool) -> None:
        """Hand on what is left and say that the rows up to the run's `ticks` may not follow.

        `final`: nobody waits for them; otherwise a process of the same robot will have more.
        """
        self.hand_on()
        self._hand_on(ticks, 0, b"", final)

    def announce(self) -> None:
        """Say that rows follow, after a process of the same robot has left."""
        self._hand_on(self._first_tick, 0, b"", False)

    def _flush(self, *, final: bool) -> None:
        rows = self._block.getvalue()
        if rows:
            self._handed_on = rows
        self._block.truncate(0)
        self._hand_on(self._first_tick, self._count, rows, final)
        self._first_tick += self._count
        self._count = 0
        self._seen = False


class RowLooks:
    """Looks at the ages of several buffers' blocks, `LOOKS` times within a time.

    Args:
        buffers: of rows.
        within_ns: of these.
    """

    __slots__ = ("_buffers", "_every_ns", "every_s", "next_ns")

    def __init__(self, buffers: Sequence[RowBuffer], within_ns: int) -> None:
        self._buffers = buffers
        self._every_ns = within_ns // LOOKS
        self.every_s = self._every_ns * 1e-9
        """Longest wait between two looks [s]."""
        self.next_ns = 0
        """When to look next."""

    def look(self, now_ns: int) -> None:
        """Look at all, if it is time."""
        if now_ns < self.next_ns:
            return
        self.next_ns = now_ns + self._every_ns
        for buffer in self._buffers:
            buffer.look(now_ns)


FRAME_ROW: Final = struct.Struct("<qIBB2x8s")
"""A frame that crossed a bus: end in bus time [ns], SocketCAN's identifier, length, flags, data."""
FROM_DRIVE: Final = 1
"""Flag of a frame that a drive sent."""
BLOCK_FRAMES: Final = 1024


class FrameBuffer:
    """Gathers the frames of one bus and hands them on as blocks: (first, count, frames, final)."""

    __slots__ = ("_block", "_count", "_first", "_hand_on")

    def __init__(self, hand_on: Callable[[int, int, bytes, bool], None]) -> None:
        self._hand_on = hand_on
        self._block = BytesWriter()
        self._first = 0
        self._count = 0

    def add(self, end_ns: int, frames: list[Frame], flags: int) -> None:
        """Add frames that ended at one bus time."""
        block = self._block
        for frame in frames:
            write_i64_le(block, end_ns)
            write_frame(block, frame, flags)
            self._count += 1
            if self._count == BLOCK_FRAMES:
                self._flush(final=False)

    def finish(self) -> None:
        """Hand on what is left and say that nothing follows."""
        self._flush(final=True)

    def _flush(self, *, final: bool) -> None:
        self._hand_on(self._first, self._count, self._block.getvalue(), final)
        self._block.truncate(0)
        self._first += self._count
        self._count = 0
