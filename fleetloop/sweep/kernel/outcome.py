"""What comes of one case: as much of a record as was asked for, and the events."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from configs.events import Event
from configs.resolve import signals_of
from configs.scenario import Scenario
from configs.signals import DISTANCE, PATH_DISTANCE, PLANT_SIGNALS, SPREAD, Signal
from fleetloop.record.reader import Record
from fleetloop.record.schema import row_type

_MADE_OF: Final[Mapping[str, tuple[str, ...]]] = {
    SPREAD: ("s",),
    DISTANCE: ("x_m", "y_m"),
    PATH_DISTANCE: ("x_m", "y_m"),
}
"""Recorded signals of which those are made that expectations may be about."""
_TIME: Final = "t_s"
Rows = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class KernelOutcome:
    """A case that was run."""

    record: Record
    """With the signals that were asked for, and `t_s`."""
    stopped: dict[str, str]
    """Robots that stopped themselves or whose motion diverged, and why."""
    events: list[Event]
    """Of the plant and of all controllers, each in its order."""
    left_course: str = ""
    """Why the in-process reference ran it after all, "" if the kernel ran it to its end."""


class Columns(NamedTuple):
    """What is kept of one source's rows."""

    signals: tuple[Signal, ...]
    numbers: NDArray[np.int64]
    """Of the columns, of all that a source has."""

    @classmethod
    def of(cls, table: Sequence[Signal], wanted: Collection[str]) -> "Columns":
        """Those of a table that are wanted."""
        numbers = [n for n, signal in enumerate(table) if signal.name in wanted]
        return cls(tuple(table[n] for n in numbers), np.array(numbers, np.int64))

    def rows(self, robots: int, ticks: int) -> tuple[Rows, NDArray[np.void]]:
        """Room for the rows of all robots: as numbers, and the same as rows of a record."""
        rows = np.empty((robots, ticks), row_type(self.signals))
        rows["tick"] = np.arange(ticks)
        return rows.view(np.float64).reshape(robots, ticks, len(self.signals) + 1), rows


@lru_cache(maxsize=64)
def columns(controller: tuple[Signal, ...], asked: frozenset[str]) -> tuple[Columns, Columns]:
    """What is kept of the plant's rows and of a controller's."""
    wanted = {_TIME, *(made for name in asked for made in _MADE_OF.get(name, (name,)))}
    return Columns.of(PLANT_SIGNALS, wanted), Columns.of(controller, wanted)


def controller_table(scenario: Scenario) -> tuple[Signal, ...]:
    """The signals of the controllers' rows: those of the laws that the kernel has are the same."""
    return _table(signals_of(scenario, scenario.robot[0]))


@lru_cache(maxsize=16)
def _table(signals: tuple[Signal, ...]) -> tuple[Signal, ...]:
    """The one object of equal tables: it is looked up by."""
    return signals


def record_of(
    scenario: Scenario,
    kept: tuple[Columns, Columns],
    plant: NDArray[np.void],
    controller: NDArray[np.void],
) -> Record:
    """Rows by robot and tick as a record that was read."""
    robots = scenario.names
    signals: dict[str, Any] = dict.fromkeys(robots, kept[1].signals)
    return Record(
        Path("record of the kernel"),
        robots,
        dict(zip(robots, plant, strict=True)),
        dict(zip(robots, controller, strict=True)),
        signals,
        "",
        "",
    )
