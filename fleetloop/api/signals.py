"""Signals of a run by name, as arrays of all its ticks.

A robot has NaN where its controller, or the plant, has no row, as after it ended early. Arrays
can't be written: a copy can.
"""

import difflib
from collections.abc import Iterator, Mapping
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from configs.scenario import Scenario
from configs.signals import DERIVED_SIGNALS, DISTANCE, PATH_DISTANCE, PLANT_SIGNALS, SPREAD, Signal
from fleetloop.record.reader import Record
from fleetloop.results import derived

Floats = NDArray[np.float64]
_TRUTH = frozenset(signal.name for signal in PLANT_SIGNALS)


class RobotSignals:
    """The signals of one robot, as attributes and by name: `run["r1"].x_m`, `run["r1"]["x_m"]`."""

    __slots__ = ("_signals", "name")

    def __init__(self, signals: "Signals", name: str) -> None:
        self._signals = signals
        self.name = name

    def __getitem__(self, signal: str) -> Floats:
        return self._signals.of_robot(self.name, signal)

    def __getattr__(self, signal: str) -> Floats:
        if not signal.startswith("_"):
            try:
                return self._signals.of_robot(self.name, signal)
            except KeyError as error:
                raise AttributeError(error.args[0], name=signal, obj=self) from None
        raise AttributeError(signal)

    def __iter__(self) -> Iterator[str]:
        return iter(self._signals.names_of(self.name))

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self]

    def __repr__(self) -> str:
        return f"<{self.name}: {', '.join(self)}>"


class Signals:
    """All signals of a record, and those that are made of them."""

    def __init__(self, record: Record, scenario: Scenario) -> None:
        self._record, self._scenario = record, scenario

    @cached_property
    def t_s(self) -> Floats:
        """Scenario time of every tick [s]."""
        rows = (*self._record.controller.values(), *self._record.plant.values())
        return _read_only(max(rows, key=len)["t_s"])

    @cached_property
    def table(self) -> Mapping[str, Signal]:
        """Every signal of any robot and every derived one: name, unit, meaning."""
        tables = (PLANT_SIGNALS, *self._record.signals.values(), DERIVED_SIGNALS)
        return {signal.name: signal for one in tables for signal in one}

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """All pairs of robots: the columns of `signal("robot_distance_m")`."""
        return tuple(combinations(self._record.robots, 2))

    def of_all(self, name: str) -> Floats:
        """As `Run.signal`: (ticks, robots); of the fleet (ticks,), of pairs (ticks, pairs).

        A robot whose law doesn't have the signal has NaN.

        Raises:
            KeyError: no robot has it.
        """
        self._check(name, self.table)
        if name == SPREAD:
            made = derived.spread(self._record.controller, self._scenario.members)
            return self._padded(made)
        if name == DISTANCE:
            plant = self._record.plant
            apart = [derived.distance(plant[one], plant[other]) for one, other in self.pairs]
            columns = [self._padded(one) for one in apart]
        else:
            columns = [
                self.of_robot(robot, name) if name in self.names_of(robot) else self._padded(None)
                for robot in self._record.robots
            ]
        empty = np.empty((len(self.t_s), 0))
        return _read_only(np.column_stack(columns) if columns else empty)

    def of_robot(self, robot: str, name: str) -> Floats:
        """A signal of one robot, (ticks,): `run["r1"]["x_m"]`.

        Raises:
            KeyError: it doesn't have it.
        """
        self._check(name, self.names_of(robot), f" of {robot}")
        if name == "t_s":
            return self.t_s
        if name == PATH_DISTANCE:
            plant, s = self._record.plant[robot], self._record.controller[robot]["s"]
            return self._padded(derived.path_distance(self._scenario, robot, plant, s))
        rows = self._record.plant if name in _TRUTH else self._record.controller
        return self._padded(rows[robot][name])

    def names_of(self, robot: str) -> tuple[str, ...]:
        """Signals of one robot."""
        recorded = (*PLANT_SIGNALS, *self._record.signals[robot])
        return tuple(dict.fromkeys([*(signal.name for signal in recorded), PATH_DISTANCE]))

    def _check(
        self, name: str, known: Mapping[str, object] | tuple[str, ...], of: str = ""
    ) -> None:
        if name in known:
            return
        close = difflib.get_close_matches(name, known, 3)
        hint = f"did you mean {', '.join(close)}?" if close else f"there are {', '.join(known)}"
        raise KeyError(f"no signal {name!r}{of}; {hint}")

    def _padded(self, values: NDArray[Any] | None) -> Floats:
        """Values of the first ticks, NaN where there are none."""
        ticks = len(self.t_s)
        if values is not None and len(values) == ticks:
            return _read_only(values)
        padded = np.full(ticks, np.nan)
        if values is not None:
            padded[: len(values)] = values
        return _read_only(padded)


def _read_only(values: NDArray[Any]) -> Floats:
    view: Floats = values.view()
    view.flags.writeable = False
    return view
