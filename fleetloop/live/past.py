"""Rows from before the viewer heard any, from the record that is being written.

A viewer is started when a run goes on already. It keeps the blocks that it hears until the record,
whose groups of ticks reach the file one after the other, has all rows before them. Then a picture
is made anew: first the rows of the record, then the blocks that were kept.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fleetloop.live.expected import Source
from fleetloop.live.state import MOST_WAITING_BYTES, LiveState
from fleetloop.record.scan import scan
from fleetloop.record.schema import Kind, kind_of, robot_number_of

MOST_KEPT_BYTES = 1 << 26
_SETTLE_BYTES = MOST_WAITING_BYTES // 8
"""What waits is decoded once it is so much."""
_SOURCES: Mapping[Kind, Source] = {Kind.PLANT: "plant", Kind.CONTROLLER: "controller"}


class Block(NamedTuple):
    """Rows of consecutive ticks as they travel."""

    robot: str
    source: Source
    first_tick: int
    rows: bytes


class Kept:
    """Blocks from the first one that was heard on; beyond `MOST_KEPT_BYTES` there are none."""

    def __init__(self) -> None:
        self.blocks: list[Block] = []
        self._bytes = 0
        self._first: dict[tuple[str, str], int] = {}
        self.over = False
        """Nothing is kept any more."""

    def add(self, block: Block) -> None:
        """One more."""
        if self.over:
            return
        self._bytes += len(block.rows)
        if self._bytes > MOST_KEPT_BYTES:
            self.end()
            return
        self.blocks.append(block)
        self._first.setdefault((block.robot, block.source), block.first_tick)

    def follow(self, ends: Mapping[tuple[str, str], int]) -> bool:
        """Whether there are blocks, and none before them is missing.

        Args:
            ends: by source, the tick before which all rows are there.
        """
        return bool(self._first) and all(
            first <= ends.get(source, 0) for source, first in self._first.items()
        )

    def end(self) -> None:
        """Keep nothing any more."""
        self.over = True
        self.blocks.clear()


def feed(state: LiveState, blocks: Iterable[Block]) -> None:
    """Make blocks part of a picture."""
    held = 0
    for block in blocks:
        state.hear(*block)
        held += len(block.rows)
        if held >= _SETTLE_BYTES:
            state.settle()
            held = 0
    state.settle()


def recorded(path: Path, state: LiveState) -> dict[tuple[str, str], int]:
    """Make the rows that a record has so far part of a new picture.

    Returns:
        By source, the tick before which all rows are there.

    Raises:
        RecordError: its head isn't written yet, or it can't be read.
    """
    ends: dict[tuple[str, str], int] = {}
    held, group = 0, 0

    def keep(channel: int, messages: np.ndarray) -> None:
        nonlocal held, group
        source = _SOURCES.get(kind_of(channel))
        if source is None:
            return
        robot = state.robots[robot_number_of(channel)]
        payload = np.ascontiguousarray(messages["payload"])
        rows = payload.view("<f8").reshape(len(payload), -1)[:, 1:].tobytes()  # without the tick
        first = int(payload["tick"][0])
        if first != group:  # all sources are equally far
            state.settle()
            held, group = 0, first
        state.hear(robot, source, first, rows)
        ends[robot, source] = first + len(payload)
        held += len(rows)
        if held >= _SETTLE_BYTES:
            state.decode()
            held = 0

    scan(path, keep)
    state.settle()
    return ends
