"""Rows of a run that goes on → the messages that are in its record, as far as it has got. Pure.

Rows come in blocks of consecutive ticks, of each source on its own; messages are made of those
ticks that all sources have, but for sources that have fallen silent. Of a robot's rows those are
shown that have a pose in the record; poses, scenes, frames and differences of s are the record's.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from configs.brief import Drawing
from configs.signals import Signal
from fleetloop.record.messages import POSE_PERIOD_NS, pose_messages, row_messages
from fleetloop.record.schema import Kind, Layout, View, channel_id, view_of
from fleetloop.record.views import VIEW_PERIOD_NS, Views
from fleetloop.record.writer import Source

BEHIND_TICKS = 512
"""A source that is so far behind the farthest one has no rows any more that others wait for."""
MOST_WAITING_BYTES = 1 << 25
"""Of rows between two looks; what comes then is passed over."""
_KINDS: Mapping[str, Kind] = {"plant": Kind.PLANT, "controller": Kind.CONTROLLER}
Messages = Iterator[tuple[int, np.ndarray]]
"""By channel, as arrays of `fleetloop.record.messages`; a channel may come several times."""


class _Held:
    """The newest rows of one source, in blocks."""

    def __init__(self, width: int) -> None:
        self.width = width
        self.blocks: list[tuple[int, np.ndarray]] = []
        self.end = 0
        """The tick after its newest row; before there is one, the first one of any source."""

    def add(self, first_tick: int, rows: bytes) -> None:
        block = np.frombuffer(rows, "<f8").reshape(-1, self.width)
        self.blocks.append((first_tick, block))
        self.end = max(self.end, first_tick + len(block))

    def between(self, begin: int, end: int) -> np.ndarray:
        """Its rows of these ticks, NaN where it has none."""
        rows = np.full((end - begin, self.width), np.nan)
        for first, block in self.blocks:
            left, right = max(first, begin), min(first + len(block), end)
            if left < right:
                rows[left - begin : right - begin] = block[left - first : right - first]
        return rows

    def drop(self, until: int) -> None:
        """Forget blocks that end before this tick."""
        self.blocks = [it for it in self.blocks if it[0] + len(it[1]) > until]


class Feed:
    """The messages of one run.

    Args:
        robots: in their order, each with the table of its controller's rows.
        drawing: for the views.
        period_ns: of the rows.
        lifetime_ns: what is drawn vanishes after this scenario time; None: as in the record.
    """

    def __init__(
        self,
        robots: Mapping[str, Sequence[Signal]],
        drawing: Drawing,
        period_ns: int,
        *,
        lifetime_ns: int | None = None,
    ) -> None:
        self.layout = Layout.of(robots)
        self._period_ns = period_ns
        self._views = Views(self.layout, drawing, period_ns, lifetime_ns)
        self._numbers = {robot: number for number, robot in enumerate(robots)}
        self._every = max(1, POSE_PERIOD_NS // period_ns)
        self._kept_ticks = 2 * max(1, VIEW_PERIOD_NS // period_ns)
        self._room = MOST_WAITING_BYTES
        self._first: int | None = None  # tick from which on there are rows, None: not known yet
        self._next = 0  # the first tick of which there were no messages yet
        self._held = {
            (number, kind): _Held(len(self.layout.signals(channel_id(number, kind))))
            for number in range(len(robots))
            for kind in _KINDS.values()
        }

    @property
    def time_ns(self) -> int:
        """Scenario time of the newest tick of which there were messages."""
        return max(self._next - 1, 0) * self._period_ns

    def hear(self, robot: str, source: Source, first_tick: int, rows: bytes) -> None:
        """Take a block of rows as it travels."""
        if len(rows) > self._room:
            return
        self._room -= len(rows)
        if not any(held.end for held in self._held.values()):
            for held in self._held.values():
                held.end = first_tick
        self._held[self._numbers[robot], _KINDS[source]].add(first_tick, rows)

    def skip(self) -> None:
        """Nobody looks: forget all but the newest instants, with which `messages` goes on."""
        self._room = MOST_WAITING_BYTES
        begin = max(held.end for held in self._held.values()) - self._kept_ticks
        if begin > self._next:
            self._first = self._next = begin
        for held in self._held.values():
            held.drop(begin)

    def messages(self, wanted: Collection[int]) -> Messages:
        """Messages of these channels, of the ticks that have become complete."""
        self._room = MOST_WAITING_BYTES
        farthest = max(held.end for held in self._held.values())
        alive = [it for it in self._held.values() if it.end > farthest - BEHIND_TICKS]
        end = min(held.end for held in alive)
        if self._first is None:
            firsts = [held.blocks[0][0] for held in alive if held.blocks]
            if len(firsts) < len(alive):
                return
            self._first = self._next = max(firsts)
        begin = self._next
        if begin >= end:
            return
        self._next = end
        self._first = max(self._first, end - self._kept_ticks)
        yield from self._made(begin, end, wanted)
        for held in self._held.values():
            held.drop(self._first)

    def newest(self, wanted: Collection[int]) -> Messages:
        """Messages of these channels once more, of the newest instants of which there were any."""
        if self._first is not None and self._first < self._next:
            yield from self._made(self._first, self._next, wanted)

    def paths(self) -> Messages:
        """The message of the robots' paths, which is said once; none if no path is known."""
        return ((View.PATHS, part) for part in self._views.paths())

    def _made(self, begin: int, end: int, wanted: Collection[int]) -> Messages:
        rows = {key: held.between(begin, end) for key, held in self._held.items()}
        for (number, kind), of_source in rows.items():
            channel = channel_id(number, kind)
            if channel in wanted:
                yield channel, self._shown(channel, begin, of_source)
            channel = channel_id(number, Kind.POSE)
            if kind is Kind.PLANT and channel in wanted:
                poses = pose_messages(channel, begin, of_source, self._period_ns)
                yield channel, poses[np.isfinite(poses["payload"]["position"]).all(axis=1)]
        if any(view_of(channel) is not None for channel in wanted):
            robots = range(len(self._numbers))
            self._views.take(
                begin,
                [rows[number, Kind.PLANT] for number in robots],
                [rows[number, Kind.CONTROLLER] for number in robots],
            )
            for view, parts in self._views.messages():
                if view in wanted and view is not View.PATHS:
                    yield from ((view, part) for part in parts)

    def _shown(self, channel: int, begin: int, rows: np.ndarray) -> np.ndarray:
        """Messages of the rows of one source, but for ticks of which it has none."""
        ticks = np.arange(begin, begin + len(rows))
        chosen = (ticks % self._every == 0) & ~np.isnan(rows).all(axis=1)
        messages = row_messages(self.layout, channel, begin, rows, self._period_ns)
        shown: np.ndarray = messages[chosen]
        return shown
