"""What comes of one case: as much of a record as was asked for, and the events."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from configs.events import Event
from configs.scenario import Scenario
from configs.signals import (
    DISTANCE,
    PATH_DISTANCE,
    PLANT_SIGNALS,
    SPREAD,
    USED_SIGNALS,
    Signal,
    age_signals,
)
from fleetloop.record.reader import Record
from fleetloop.record.schema import row_type
from fleetloop.sweep.kernel.layout import CONTROLLER_SIGNALS

_MADE_OF: Final[Mapping[str, tuple[str, ...]]] = {
    SPREAD: ("s",),
    DISTANCE: ("x_m", "y_m"),
    PATH_DISTANCE: ("x_m", "y_m"),
}
"""Recorded signals of which those are made that expectations may be about."""
_TIME: Final = "t_s"
_PATH: Final = Path("record of the kernel")
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
    """Of the columns that the loop fills, of all that a source has: those behind tick and time."""

    @classmethod
    def of(cls, table: Sequence[Signal], wanted: Collection[str]) -> "Columns":
        """Those of a table that are wanted."""
        numbers = [n for n, it in enumerate(table) if it.name in wanted and it.name != _TIME]
        time = (one for one in table if one.name == _TIME)
        return cls((*time, *(table[n] for n in numbers)), np.array(numbers, np.int64))

    def rows(self, robots: int, ticks: int, period_ns: int) -> tuple[Rows, NDArray[np.void]]:
        """Room for the rows of all robots: as numbers, for the loop, and as rows of a record."""
        blank = _blank(self.signals, ticks, period_ns)
        numbers = np.empty((robots, ticks, len(self.signals) + 1))
        numbers[:] = blank.view(np.float64).reshape(ticks, -1)  # many times as fast as by fields
        return numbers, numbers.view(blank.dtype)[:, :, 0]


@lru_cache(maxsize=8)
def _blank(signals: tuple[Signal, ...], ticks: int, period_ns: int) -> NDArray[np.void]:
    """The rows of one robot, with tick and time."""
    rows = np.zeros(ticks, row_type(signals))
    rows["tick"] = number = np.arange(ticks)
    rows[_TIME] = number * period_ns * 1e-9
    return rows


@lru_cache(maxsize=64)
def columns(asked: frozenset[str]) -> tuple[Columns, Columns]:
    """What is kept of the plant's rows and of a controller's."""
    wanted = {made for name in asked for made in _MADE_OF.get(name, (name,))}
    return Columns.of(PLANT_SIGNALS, wanted), Columns.of(CONTROLLER_SIGNALS, wanted)


def record_of(
    scenario: Scenario,
    plant: NDArray[np.void],
    controller: Mapping[str, NDArray[np.void]],
    tables: Mapping[str, tuple[Signal, ...]],
) -> Record:
    """Rows by robot and tick as a record that was read; `tables` are those of the controllers."""
    robots = scenario.names
    return Record(
        _PATH,
        robots,
        dict(zip(robots, plant, strict=True)),
        dict(controller),
        dict(tables),
        "",
        "",
    )


def with_ages(
    rows: NDArray[np.void], signals: tuple[Signal, ...], ages: Mapping[str, NDArray[np.float64]]
) -> tuple[NDArray[np.void], tuple[Signal, ...]]:
    """The rows of a controller with ages of what it heard, in a record's order; their table."""
    used = {signal.name for signal in USED_SIGNALS}
    before = [signal for signal in signals if signal.name in used]
    table = (*before, *age_signals(tuple(ages)), *signals[len(before) :])
    made = np.empty(len(rows), row_type(table))
    for name in rows.dtype.names or ():
        made[name] = rows[name]
    for signal, values in zip(age_signals(tuple(ages)), ages.values(), strict=True):
        made[signal.name] = values
    return made, table
