"""Series of a record: the values of a signal by tick, and when they count."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from configs.membership import ALWAYS, Membership
from configs.scenario import Scenario
from configs.signals import DISTANCE, PATH_DISTANCE, PLANT_SIGNALS, SPREAD
from fleetloop.record.reader import Record
from fleetloop.results.derived import counted, distance, mask, path_distance, spread

_OF_PLANT = {signal.name for signal in PLANT_SIGNALS} - {"t_s"}


class Series(NamedTuple):
    """Values of a signal by tick, from tick 0 on."""

    robots: tuple[str, ...]
    member: Membership  # when it counts
    values: np.ndarray
    known: np.ndarray
    all_known: bool


class Alike(NamedTuple):
    """Series of a recorded signal that are known at the same ticks, all of which count."""

    robots: tuple[str, ...]
    values: np.ndarray
    """A row for each robot."""
    known: np.ndarray

    def series(self, row: int) -> Series:
        """One of them."""
        return Series((self.robots[row],), ALWAYS, self.values[row], self.known, True)


class _Known(NamedTuple):
    """Ticks at which a signal is known."""

    there: np.ndarray
    everywhere: bool

    @classmethod
    def at(cls, there: np.ndarray) -> "_Known":
        return cls(there, bool(there.all()))


class SeriesOf:
    """The series of one record, each made once: not to be changed, and gone with this.

    Args:
        record: of the run.
        scenario: of the run.
    """

    def __init__(self, record: Record, scenario: Scenario) -> None:
        self._record, self._scenario = record, scenario
        self._members = scenario.members
        self._made: dict[tuple[str, tuple[str, ...]], tuple[Series, ...]] = {}
        self._counted: dict[str, _Known] = {}
        self._always: dict[int, _Known] = {}
        self._alike: dict[tuple[str, tuple[str, ...]], Alike | None] = {}

    def __call__(self, signal: str, robots: Sequence[str]) -> tuple[Series, ...]:
        """A signal of each of these robots, of each pair, or of all together; () stands for all."""
        key = signal, tuple(robots)
        made = self._made.get(key)
        if made is None:
            made = self._made[key] = tuple(self._make(signal, tuple(robots or self._record.robots)))
        return made

    def alike(self, signal: str, robots: Sequence[str]) -> Alike | None:
        """A recorded signal of each of these robots; None if not all of its ticks count."""
        key = signal, tuple(robots)
        if key not in self._alike:
            self._alike[key] = self._make_alike(signal, tuple(robots or self._record.robots))
        return self._alike[key]

    def _make_alike(self, signal: str, robots: tuple[str, ...]) -> Alike | None:
        if not self._all_count:
            return None
        rows = self._record.plant if signal in _OF_PLANT else self._record.controller
        some = [rows[robot] for robot in robots]
        if any(signal not in (one.dtype.names or ()) for one in some):
            return None
        values = [one[signal] for one in some]
        if any(one.dtype != np.float64 for one in values):
            return None
        return Alike(robots, np.array(values), self._known_always(len(values[0])).there)

    @cached_property
    def _all_count(self) -> bool:
        """Whether all robots count at all ticks, and have as many."""
        record = self._record
        if not record.robots or any(self._members[one] != ALWAYS for one in record.robots):
            return False
        sources = (*record.plant.values(), *record.controller.values())
        if len({len(rows) for rows in sources}) > 1:
            return False
        s = np.array([record.controller[robot]["s"] for robot in record.robots])
        return not np.isnan(s).any()

    def _make(self, signal: str, robots: tuple[str, ...]) -> Iterator[Series]:
        record, members = self._record, self._members
        if signal == SPREAD:
            yield self._spread(robots)
        elif signal == DISTANCE:
            for one, other in combinations(dict.fromkeys(robots), 2):
                values = distance(record.plant[one], record.plant[other])
                both = Membership(
                    max(members[one].joins_tick, members[other].joins_tick),
                    min(members[one].leaves_tick, members[other].leaves_tick),
                )
                yield Series((one, other), both, values, *self._known_always(len(values)))
        else:
            for robot in robots:
                if (found := self._of_robot(signal, robot)) is not None:
                    values, known = found
                    yield Series((robot,), members[robot], values, *known)

    def _spread(self, robots: tuple[str, ...]) -> Series:
        alike = self.alike("s", robots)
        if alike is not None:
            s = alike.values
            return Series(robots, ALWAYS, s.max(axis=0) - s.min(axis=0), alike.known, True)
        rows = {robot: self._record.controller[robot] for robot in robots}
        values = spread(rows, self._members)
        known = np.ones(len(values), dtype=bool)
        for robot, part in rows.items():
            outside = ~mask(self._members[robot], len(part))
            known &= (self._known_of(robot).there | outside)[: len(values)]
        return Series(robots, ALWAYS, values, *_Known.at(known))

    def _of_robot(self, signal: str, robot: str) -> tuple[np.ndarray, _Known] | None:
        """A signal of one robot and where it is known; None if it has none of this name."""
        plant, controller = self._record.plant[robot], self._record.controller[robot]
        if signal == PATH_DISTANCE:
            values = path_distance(self._scenario, robot, plant, controller["s"])
            return values, self._known_always(len(values))
        if signal in _OF_PLANT:
            return plant[signal], self._known_always(len(plant))
        if signal in (controller.dtype.names or ()):
            return controller[signal], self._known_of(robot)
        return None

    def _known_of(self, robot: str) -> _Known:
        """Where the rows of a robot's controller count."""
        known = self._counted.get(robot)
        if known is None and self._all_count:
            known = self._counted[robot] = self._known_always(len(self._record.controller[robot]))
        if known is None:
            there = counted(self._record.controller[robot], self._members[robot])
            known = self._counted[robot] = _Known.at(there)
        return known

    def _known_always(self, ticks: int) -> _Known:
        known = self._always.get(ticks)
        if known is None:
            known = self._always[ticks] = _Known(np.ones(ticks, dtype=bool), True)
        return known
