"""A record that is kept in memory: rows as a run in this process hands them on, no file."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from configs.signals import PLANT_SIGNALS, Signal
from fleetloop.record.reader import Record
from fleetloop.record.schema import row_type
from fleetloop.record.writer import Source


@dataclass(slots=True)
class MemoryRecord:
    """Takes rows in the place of a file's writer; traffic and inputs aren't kept."""

    blocks: dict[tuple[str, Source], list[bytes]] = field(default_factory=dict)

    def add(self, robot: str, source: Source, first_tick: int, rows: bytes) -> None:  # noqa: ARG002
        """Take the rows of consecutive ticks, the first ones from tick 0 on."""
        self.blocks.setdefault((robot, source), []).append(rows)

    def end(self, robot: str, source: Source) -> None:
        """Nothing follows from this source."""

    def traffic(self, bus: str, frames: bytes) -> None:
        """Let it go."""

    def inputs(self, robot: str, first: int, block: bytes, final: bool) -> None:
        """Let them go."""

    def record(self, signals: dict[str, tuple[Signal, ...]], scenario_toml: str) -> Record:
        """The rows so far as a record that was read; `signals` of each robot's controller."""
        return Record(
            Path("record in memory"),
            tuple(signals),
            {robot: self.rows(robot, "plant", PLANT_SIGNALS) for robot in signals},
            {robot: self.rows(robot, "controller", own) for robot, own in signals.items()},
            signals,
            scenario_toml,
            "",
        )

    def rows(self, robot: str, source: Source, signals: Sequence[Signal]) -> np.ndarray:
        """The rows of one source so far, by signal."""
        matrix = np.frombuffer(b"".join(self.blocks.get((robot, source), [])), "<f8")
        matrix = matrix.reshape(-1, len(signals))
        rows = np.zeros(len(matrix), row_type(tuple(signals)))
        rows["tick"] = np.arange(len(matrix))
        for column, signal in enumerate(signals):
            rows[signal.name] = matrix[:, column]
        return rows
