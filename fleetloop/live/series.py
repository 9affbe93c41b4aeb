"""Signals over time in bounded memory, few points with every peak. Pure.

Ticks are gathered into bins of `stride` ticks. A bin keeps of a peak signal the value farthest from
zero, of any other its last. A history that is full halves the resolution of its older half, and
goes on doing so: the past gets coarser, and no peak is lost.
"""

from collections.abc import Sequence

import numpy as np

CAPACITY = 2400
"""Bins that a history holds."""


def merged(rows: np.ndarray, stride: int, peaks: np.ndarray) -> np.ndarray:
    """Rows (n stride, m) as (n, m): of columns where `peaks` holds the value farthest from zero.

    A value that isn't known is NaN, and counts only where none is.
    """
    bins = rows.reshape(-1, stride, rows.shape[1])
    kept: np.ndarray = bins[:, -1, :].copy()
    if stride > 1 and peaks.any():
        sizes = np.abs(bins[:, :, peaks])
        sizes[np.isnan(sizes)] = -1.0
        at = sizes.argmax(axis=1)[:, None, :]
        kept[:, peaks] = np.take_along_axis(bins[:, :, peaks], at, axis=1)[:, 0, :]
    return kept


class Track:
    """The rows of one source as bins; a row may be missing, none comes twice.

    Args:
        columns: of the rows that are kept.
        peaks: by column kept, whether it is a peak signal.
        stride: ticks of a bin.
    """

    __slots__ = ("_columns", "_open", "_peaks", "_stride", "last", "last_tick", "ready")

    def __init__(self, columns: Sequence[int], peaks: Sequence[bool], stride: int) -> None:
        self._columns = np.array(columns, dtype=np.intp)
        self._peaks = np.array(peaks, dtype=bool)
        self._stride = stride
        self._open = np.empty((0, len(columns)))  # rows of the bin that isn't whole
        self.last = np.full(len(columns), np.nan)
        """The newest row."""
        self.last_tick = -1
        self.ready: list[tuple[int, np.ndarray]] = []
        """Whole bins since `take`: number of the first, values."""

    @property
    def bins(self) -> int:
        """The bin in which the next row is."""
        return (self.last_tick + 1) // self._stride

    def add(self, first_tick: int, rows: np.ndarray) -> None:
        """Add rows of consecutive ticks; what isn't later than the newest row is passed over."""
        rows = rows[max(0, self.last_tick + 1 - first_tick) :, self._columns]
        if not len(rows):
            return
        first_tick = max(first_tick, self.last_tick + 1)
        begin = first_tick - len(self._open)
        if first_tick != self.last_tick + 1:  # some did not come
            self._open = self._open[:0]
            begin = first_tick
        held = np.concatenate([self._open, rows]) if len(self._open) else rows
        pad = begin % self._stride
        if pad:
            held = np.concatenate([np.full((pad, held.shape[1]), np.nan), held])
            begin -= pad
        whole = len(held) // self._stride
        if whole:
            values = merged(held[: whole * self._stride], self._stride, self._peaks)
            self.ready.append((begin // self._stride, values))
        self._open = held[whole * self._stride :].copy()
        self.last, self.last_tick = rows[-1], first_tick + len(rows) - 1


class History:
    """Rows of bins in the order of time.

    Args:
        peaks: by column, whether it is a peak signal; column 0 is the time.
        capacity: the most rows; even.
    """

    __slots__ = ("_count", "_number", "_peaks", "_rows", "begin", "end")

    def __init__(self, peaks: Sequence[bool], capacity: int = CAPACITY) -> None:
        self._peaks = np.array(peaks, dtype=bool)
        self._rows = np.empty((capacity, len(peaks)))
        self._number = np.empty(capacity, dtype=np.int64)
        self._count = 0
        self.begin = 0
        """Number of the first bin that was appended."""
        self.end = 0
        """Behind the number of the last bin."""

    def __len__(self) -> int:
        return self._count

    def append(self, first: int, rows: np.ndarray) -> None:
        """Append bins of consecutive numbers, behind those that are there."""
        capacity = len(self._rows)
        if not self._count:
            self.begin = first
        for begin in range(0, len(rows), capacity // 4):
            block = rows[begin : begin + capacity // 4]
            while self._count + len(block) > capacity:
                self._halve()
            upto = self._count + len(block)
            self._rows[self._count : upto] = block
            self._number[self._count : upto] = first + begin + np.arange(len(block))
            self._count = upto
        self.end = max(self.end, first + len(rows))

    def since(self, number: int) -> np.ndarray:
        """Bins from this number on."""
        at = int(np.searchsorted(self._number[: self._count], number))
        return self._rows[at : self._count]

    def _halve(self) -> None:
        """Two bins of the older half become one."""
        half = self._count // 4 * 2
        self._rows[: half // 2] = merged(self._rows[:half], 2, self._peaks)
        self._number[: half // 2] = self._number[1:half:2]
        rest = self._count - half
        self._rows[half // 2 : half // 2 + rest] = self._rows[half : self._count].copy()
        self._number[half // 2 : half // 2 + rest] = self._number[half : self._count].copy()
        self._count = half // 2 + rest
