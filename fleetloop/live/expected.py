"""The expectations of a scenario while the run goes on, on the rows that were heard. Pure.

They are `fleetloop.results.expectations`' own: on the same rows the verdict is the same. What was
not heard from its beginning on, because the page came later or rows found no room, stays open.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from configs.events import Event
from configs.expect import claim, window_of
from configs.scenario import Scenario
from configs.signals import PLANT_SIGNALS, Signal
from fleetloop.record.reader import Record
from fleetloop.results.expectations import judge

Source = Literal["plant", "controller"]
MOST_BYTES = 1 << 27
"""Of the rows that are kept; what needs more is judged after the run only."""
_FIRST_TICKS = 1 << 12
_ALWAYS: Mapping[Source, tuple[str, ...]] = {"plant": ("x_m", "y_m"), "controller": ("s",)}


class _Kept:
    """The columns that expectations are about, of one source, from tick 0 on."""

    __slots__ = ("_columns", "_dtype", "_rows", "heard_from", "ticks")

    def __init__(self, names: Sequence[str], table: Sequence[Signal]) -> None:
        places = {signal.name: at for at, signal in enumerate(table)}
        self._columns = [(name, places[name]) for name in dict.fromkeys(names) if name in places]
        self._dtype = np.dtype([(name, np.float64) for name, _ in self._columns])
        self._rows = np.empty(0, self._dtype)
        self.ticks = 0
        self.heard_from = -1

    @property
    def rows(self) -> np.ndarray:
        return self._rows[: self.ticks]

    @property
    def row_bytes(self) -> int:
        return self._dtype.itemsize

    def add(self, first_tick: int, rows: np.ndarray) -> None:
        rows = rows[max(0, self.ticks - first_tick) :] if self.heard_from >= 0 else rows
        first_tick = max(first_tick, self.ticks)
        if not len(rows):
            return
        if self.heard_from < 0:
            self.heard_from = first_tick
        end = first_tick + len(rows)
        if end > len(self._rows):
            grown = np.empty(max(end, 2 * len(self._rows), _FIRST_TICKS), self._dtype)
            grown[: self.ticks] = self._rows[: self.ticks]
            self._rows = grown
        for name, column in self._columns:
            self._rows[name][self.ticks : first_tick] = np.nan
            self._rows[name][first_tick:end] = rows[:, column]
        self.ticks = end


class LiveExpectations:
    """Judges the expectations of one run as it goes on.

    Args:
        scenario: of the run.
        tables: of the rows of each robot's controller.
    """

    def __init__(self, scenario: Scenario, tables: Mapping[str, Sequence[Signal]]) -> None:
        self._scenario = scenario
        self._tables = tables
        named = [it.signal for it in scenario.expect if it.signal is not None]
        self._kept: dict[tuple[str, Source], _Kept] = {}
        for robot, table in tables.items():
            self._kept[robot, "plant"] = _Kept([*_ALWAYS["plant"], *named], PLANT_SIGNALS)
            self._kept[robot, "controller"] = _Kept([*_ALWAYS["controller"], *named], table)
        period_s = scenario.clock.control_period_s
        ticks = round(scenario.ends_at_s / period_s)
        self._wanted = ticks * sum(kept.row_bytes for kept in self._kept.values()) <= MOST_BYTES
        self._wanted = self._wanted and bool(scenario.expect)
        self._lost = False
        self.judged = [self._open(number) for number in range(len(scenario.expect))]
        """As `fleetloop.results.expectations` has them; `held` is None while it is open."""

    def add(self, robot: str, source: Source, first_tick: int, rows: np.ndarray) -> None:
        """Keep what the expectations need of rows of consecutive ticks."""
        if not self._wanted or not len(rows):
            return
        kept = self._kept[robot, source]
        self._lost |= kept.heard_from >= 0 and first_tick > kept.ticks
        kept.add(first_tick, rows)

    def judge(self, events: Sequence[Event] | None) -> bool:
        """Judge what is open; return whether anything is there to judge.

        Counts of events are judged anew each time: word of an event may come after later rows.

        Args:
            events: all of the run up to now; None: they aren't known.
        """
        if not self._wanted:
            return False
        expect = self._scenario.expect
        going = [n for n, one in enumerate(self.judged) if one["held"] is None or expect[n].event]
        record = self._record()
        for number in going:
            one = expect[number]
            window = window_of(one, self._scenario, self._scenario.ends_at_s)
            begun = window is not None and any(k.ticks > window.first for k in self._kept.values())
            whole = not self._lost and (window is None or window.first >= self._heard_from())
            if not begun or not whole:
                continue
            if one.event is not None and events is None:
                continue
            with np.errstate(all="ignore"):
                self.judged[number] = judge(one, record, self._scenario, events)
        return True

    def _heard_from(self) -> int:
        return max(kept.heard_from for kept in self._kept.values())

    def _record(self) -> Record:
        robots = tuple(self._tables)
        return Record(
            Path(),
            robots,
            {robot: self._kept[robot, "plant"].rows for robot in robots},
            {robot: self._kept[robot, "controller"].rows for robot in robots},
            {robot: tuple(table) for robot, table in self._tables.items()},
            "",
            "",
        )

    def _open(self, number: int) -> dict[str, Any]:
        expect, scenario = self._scenario.expect[number], self._scenario
        window = window_of(expect, scenario, scenario.ends_at_s)
        period_s = scenario.clock.control_period_s
        first, last = (0, -1) if window is None else window
        stated = {**expect.stated, "claim": claim(expect), "held": None, "margin": None}
        within = {"from_s": round(first * period_s, 9), "to_s": round(last * period_s, 9)}
        return stated | {"window": within}
