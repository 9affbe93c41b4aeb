"""Rows in, record out: the same file whatever the order in which blocks arrive.

Blocks of one source (a robot's plant or controller rows) come in order; those of different sources
as they like. A group of `CHUNK_TICKS` ticks is written once every source has delivered it or said
that nothing follows, in the order of the robots; the rest at the end. So the file depends on the
run alone, and a source that ends early holds no other source's rows back.

Views are written once there are `VIEW_INSTANTS` instants of them. If a recorder is killed, what it
held is lost: rows that have not come of all sources yet, and of the rows in the file the views of
the last instants, fewer than `VIEW_INSTANTS`; early in a run that is all views, the paths too.
"""

import contextlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

import numpy as np

from configs.brief import NO_DRAWING, Drawing
from configs.errors import InfrastructureError
from configs.signals import Signal
from fleetloop.record.chunks import CHUNK_TICKS, Block
from fleetloop.record.mcap_file import McapFile
from fleetloop.record.messages import pose_messages, row_messages
from fleetloop.record.schema import Kind, Layout, channel_id
from fleetloop.record.views import Views

VIEW_INSTANTS = 40
"""Least instants of the views that are written together, as each chunk costs time: 2 s of scenario
time, or more where a tick is longer than their period."""
Source = Literal["plant", "controller"]
_KINDS: dict[str, Kind] = {"plant": Kind.PLANT, "controller": Kind.CONTROLLER}


class _Rows:
    """Rows of one source that aren't written yet."""

    __slots__ = ("blocks", "count", "ended", "first_tick")

    def __init__(self) -> None:
        self.ended = False
        self.first_tick = 0
        self.count = 0
        self.blocks: list[np.ndarray] = []

    def add(self, block: np.ndarray) -> None:
        self.blocks.append(block)
        self.count += len(block)

    def pop(self, count: int) -> np.ndarray:
        """Remove and return the first `count` rows, or all if there are fewer."""
        rows = np.concatenate(self.blocks) if self.blocks else np.empty((0, 0))
        self.blocks = [rows[count:]] if len(rows) > count else []
        taken = rows[:count]
        self.first_tick += len(taken)
        self.count -= len(taken)
        return taken


class RecordWriter:
    """Writes one record; a context manager that completes the file.

    Args:
        path: of the file.
        robots: in their order, each with the table of its controller's rows.
        scenario_toml: the scenario, for readers of the record.
        period_ns: of the rows.
        drawing: for the views.
    """

    def __init__(
        self,
        path: str | Path,
        robots: Mapping[str, Sequence[Signal]],
        scenario_toml: str,
        period_ns: int,
        *,
        drawing: Drawing = NO_DRAWING,
    ) -> None:
        self._path = Path(path)
        self._robots = tuple(robots)
        self._period_ns = period_ns
        self._layout = Layout.of(robots)
        self._views = Views(self._layout, drawing, period_ns)
        self._file = McapFile.create(self._path, self._layout, scenario_toml)
        self._sources = {
            (number, kind): _Rows()
            for number in range(len(self._robots))
            for kind in _KINDS.values()
        }
        self._numbers = {robot: number for number, robot in enumerate(self._robots)}
        self._lost = ""

    def next_tick(self, robot: str, source: Source) -> int | None:
        """The tick of the row that a source owes next, None if it has said its last."""
        held = self._sources[self._numbers[robot], _KINDS[source]]
        return None if held.ended else held.first_tick + held.count

    @property
    def written(self) -> int:
        """Ticks of which every source has delivered its row or said its last."""
        ends = [held.first_tick + held.count for held in self._sources.values() if not held.ended]
        return min(ends, default=max(held.first_tick for held in self._sources.values()))

    def add(self, robot: str, source: Source, first_tick: int, rows: bytes) -> None:
        """Add rows of consecutive ticks, float64 as `bridge.network.telemetry` packs them.

        Raises:
            InfrastructureError: ticks are missing or come twice, or the disk is full.
        """
        kind = _KINDS[source]
        held = self._sources[self._numbers[robot], kind]
        if held.ended:
            raise InfrastructureError(
                f"{self._path}: rows of {source} {robot} at tick {first_tick}, after its last"
            )
        expected = held.first_tick + held.count
        if first_tick != expected:
            raise InfrastructureError(
                f"{self._path}: rows of {source} {robot} begin at tick {first_tick},"
                f" expected {expected}"
            )
        width = len(self._layout.signals(channel_id(self._numbers[robot], kind)))
        held.add(np.frombuffer(rows, "<f8").reshape(-1, width))
        if held.count >= CHUNK_TICKS:
            self._write_groups()

    def end(self, robot: str, source: Source) -> None:
        """Take note that no row of this source follows. Idempotent."""
        self._sources[self._numbers[robot], _KINDS[source]].ended = True
        self._write_groups()

    def _write_groups(self) -> None:
        """Write the groups that every source has delivered."""
        while all(rows.ended or rows.count >= CHUNK_TICKS for rows in self._sources.values()):
            if not any(rows.count for rows in self._sources.values()):
                return
            self._write_group(CHUNK_TICKS)

    def note_lost(self, what: str) -> None:
        """Have the file say that something is missing in it."""
        self._lost = what

    def check_place(self) -> None:
        """See whether the file is still where it was made.

        Raises:
            InfrastructureError: it, or the folder that it is in, was removed or moved.
        """
        if not self._file.in_place:
            raise InfrastructureError(
                f"{self._path} was removed or moved during the run, or its folder: what was"
                " recorded until then is in it, wherever it is now"
            )

    def close(self) -> None:
        """Write what is left and complete the file.

        Raises:
            InfrastructureError: not everything could be written; what could is a complete file.
        """
        try:
            while any(rows.count for rows in self._sources.values()):
                self._write_group(CHUNK_TICKS)
            self._write_views()
        except InfrastructureError as error:
            self._lost = str(error)
            raise
        finally:
            self._file.finish(self._lost)

    def discard(self) -> None:
        """Close and remove the file: nothing is in it."""
        self._file.discard()

    def _write_group(self, ticks: int) -> None:
        """Write the next ticks of every source: rows and poses of each robot; then views."""
        first = 0
        taken: dict[Kind, list[np.ndarray]] = {kind: [] for kind in _KINDS.values()}
        for (number, kind), held in self._sources.items():
            rows = held.pop(ticks)
            taken[kind].append(rows)
            if not len(rows):
                continue
            first = held.first_tick - len(rows)
            channel = channel_id(number, kind)
            self._chunk(channel, row_messages(self._layout, channel, first, rows, self._period_ns))
            if kind is Kind.PLANT:
                channel = channel_id(number, Kind.POSE)
                self._chunk(channel, pose_messages(channel, first, rows, self._period_ns))
        self._views.take(first, taken[Kind.PLANT], taken[Kind.CONTROLLER])
        if self._views.taken >= VIEW_INSTANTS:
            self._write_views()

    def _write_views(self) -> None:
        for view, messages in self._views.messages():
            self._chunk(view, *messages)

    def _chunk(self, channel: int, *messages: np.ndarray) -> None:
        self._file.chunk(Block.of(channel, *messages))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if value is None:
            self.close()
            return
        self.note_lost(str(value) or type(value).__name__)
        with contextlib.suppress(InfrastructureError):  # what ended it says more
            self.close()


def finish_truncated(path: Path) -> None:
    """Complete a record whose writer was killed, so that any reader opens it.

    Raises:
        RecordError: its head isn't whole, or it is damaged.
        InfrastructureError: it can't be written.
    """
    McapFile.resume(path).finish("its recorder ended before it did")
