"""The theory's boundaries on a map: what `fleetloop check` computes, over the range of two factors.

    (46)            p²/q > max Im(ζ)²/Re(ζ)                the coordination on its graph
    speed loop      k_4 h / min(m̄) < K(delay / h)          (34) sampled, the least of all robots
    age of data     mean age of path states < T            the delay at which (45) oscillates

Where an axis is the p, q, k_4 or constant delay that an inequality can be solved for, the boundary
is its value at each place of the other axis; elsewhere it is the contour of ln(limit / value) = 0
between places at which it is computed. What isn't on an axis is as in some cases, among them those
with the least and the greatest value of each factor: of several boundaries the outermost are drawn.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, log, sqrt
from typing import Any

import numpy as np

from configs.errors import FleetloopError
from configs.netem import ConstantDelay
from configs.scenario import Scenario
from fleetloop.check.graph import right_side
from fleetloop.check.network import age_margin_s, mean_ages_s
from fleetloop.check.sampling import speed_loop_gains
from fleetloop.law_facts import speed_gain_key
from fleetloop.sweep.cases import Case, Cases
from fleetloop.sweep.draws import Integers
from fleetloop.sweep.report.columns import Column, Series
from fleetloop.sweep.report.derived import LEFT, RIGHT
from fleetloop.sweep.report.results import Results

PLACES, COARSE, MOST_OTHERS = 25, 11, 4
"""Of a solved boundary along its axis; of a contour along each; cases for what is on no axis."""
_SAME = 1e-6
_QUICK = re.compile(r"coordination\.[pq]|control\.\w+")
"""Keys that are set without loading a scenario anew."""
_DELAY = "network.default.delay.delay_s"


@dataclass(frozen=True, slots=True)
class Criterion:
    """An inequality of the theory."""

    name: str
    says: str
    margin: Callable[[Scenario], float]
    """ln(limit / value): it holds above 0; NaN: not known."""
    solved: Mapping[str, Callable[[Scenario], float]]
    """By key, its value on the boundary, with the rest of a scenario; NaN: there is none."""
    about: str = ".*"
    """Keys, as a regular expression, of which one at least is on an axis."""


@dataclass(frozen=True, slots=True)
class Boundary:
    """One criterion on a map."""

    criterion: Criterion
    lines: tuple[tuple[Series, Series], ...]
    """(x, y) each: one; or of different cases the outermost."""
    everywhere: bool | None = None
    """Without a line, whether it holds all over the map."""
    cases: int = 1
    """For which the lines were computed."""

    @property
    def words(self) -> str:
        """For a caption."""
        what = f"{self.criterion.name}, {self.criterion.says}"
        if not self.lines:
            return f"{what}: {'holds' if self.everywhere else 'fails'} all over the map"
        if len(self.lines) > 1:
            return (
                f"{what}: lines of the extremes of the other factors; between, it depends on these"
            )
        return what


def boundaries(results: Results, x: Column, y: Column) -> list[Boundary]:
    """The boundaries that belong to these axes."""
    if {x.name, y.name} == {LEFT, RIGHT}:
        ends = _common_range(x, y)
        return [Boundary(_DIAGONAL, ((ends, ends),) if ends[1] > ends[0] else (), cases=0)]
    cases = results.cases
    if cases is None:
        return []
    names = [factor.name for factor in cases.factors]
    if x.name not in names or y.name not in names or x.levels or y.levels:
        return []
    window = _Map(results, cases, x, y)
    return [found for one in _criteria(cases) if (found := window.boundary(one)) is not None]


def _common_range(x: Column, y: Column) -> Series:
    low = max(float(np.nanmin(x.values)), float(np.nanmin(y.values)))
    high = min(float(np.nanmax(x.values)), float(np.nanmax(y.values)))
    return np.array([low, high])


# --- criteria -------------------------------------------------------------------------------------


def _criteria(cases: Cases) -> list[Criterion]:
    """The inequalities, and the keys of this base that they can be solved for."""
    control = cases.base.control
    found = [_SYNCHRONISATION, _AGE]
    if name := speed_gain_key(control):
        key = f"control.{name}"

        def of_gain(scenario: Scenario) -> float:
            now = float(getattr(scenario.control.parameters, name))
            return now * float(np.exp(_speed_loop(scenario)))

        says = f"{name} h / min(m̄) < K of the delay"
        return [*found, Criterion("speed loop (34) sampled", says, _speed_loop, {key: of_gain})]
    return [*found, Criterion("speed loop (34) sampled", "K < limit", _speed_loop, {})]


def _synchronisation(scenario: Scenario) -> float:
    gains, right = scenario.coordination, right_side(scenario.topology)
    return log(gains.p**2 / gains.q / right) if right > 0.0 else inf


def _p(scenario: Scenario) -> float:
    return sqrt(scenario.coordination.q * right_side(scenario.topology))


def _q(scenario: Scenario) -> float:
    right = right_side(scenario.topology)
    return scenario.coordination.p**2 / right if right > 0.0 else inf


def _speed_loop(scenario: Scenario) -> float:
    found = [speed_loop_gains(scenario, robot) for robot in scenario.robot]
    return min((log(most / gain) for gain, most in filter(None, found)), default=np.nan)


def _age(scenario: Scenario) -> float:
    ages_s = mean_ages_s(scenario)
    if not ages_s:
        return np.nan
    margin_s, most_s = age_margin_s(scenario), max(ages_s.values())
    if margin_s == inf:
        return inf
    return log(margin_s / most_s) if 0.0 < most_s < inf else -inf


def _delay_s(scenario: Scenario) -> float:
    """The constant delay with which the mean age is the margin."""
    delay = scenario.network.default.delay
    if not isinstance(delay, ConstantDelay) or not (ages_s := mean_ages_s(scenario)):
        return np.nan
    return age_margin_s(scenario) - (max(ages_s.values()) - delay.delay_s)


_SYNCHRONISATION = Criterion(
    "(46)",
    "p²/q > max Im(ζ)²/Re(ζ)",
    _synchronisation,
    {"coordination.p": _p, "coordination.q": _q},
)
_DIAGONAL = Criterion("(46)", "p²/q = max Im(ζ)²/Re(ζ)", _synchronisation, {})
_AGE = Criterion(
    "delay margin of (45)",
    "mean age of path states < T",
    _age,
    {_DELAY: _delay_s},
    r"network\..*|clock\.share_period_s",
)


# --- on a map -------------------------------------------------------------------------------------


class _Map:
    """Two factors of a study, and the cases from which the others are taken."""

    def __init__(self, results: Results, cases: Cases, x: Column, y: Column) -> None:
        self._cases = cases
        names = [factor.name for factor in cases.factors]
        self._at = names.index(x.name), names.index(y.name)
        self._keys = tuple(cases.factors[n].keys for n in self._at)
        self._axes = x, y
        self._known: dict[Case, Scenario] = {}
        self._others = _others(results, {x.name, y.name})

    def boundary(self, criterion: Criterion) -> Boundary | None:
        """Of one criterion; None if it has nothing to do with these axes."""
        if not any(re.fullmatch(criterion.about, keys[0]) for keys in self._keys):
            return None
        for n in (1, 0):
            key = self._keys[n][0]
            if len(self._keys[n]) == 1 and key in criterion.solved:
                return self._solved(criterion, n, criterion.solved[key])
        return self._contour(criterion)

    def _solved(
        self, criterion: Criterion, solved: int, limit: Callable[[Scenario], float]
    ) -> Boundary | None:
        along = _places(self._axes[1 - solved], PLACES, self._cases, self._at[1 - solved])
        middle = self._middle(solved)
        curves = [
            np.array([self._asked(limit, number, {1 - solved: v, solved: middle}) for v in along])
            for number in self._others
        ]
        low, high = np.nanmin(self._axes[solved].values), np.nanmax(self._axes[solved].values)
        seen = [curve for curve in curves if ((curve >= low) & (curve <= high)).any()]
        if not seen:
            at = {1 - solved: self._middle(1 - solved), solved: middle}
            margin = self._asked(criterion.margin, self._others[0], at)
            return None if np.isnan(margin) else Boundary(criterion, (), margin > 0.0)
        there = ~np.isnan(curves).all(axis=0)  # elsewhere no scenario is valid
        along, known = along[there], np.array(curves)[:, there]
        lines = [np.nanmin(known, axis=0), np.nanmax(known, axis=0)]
        if np.allclose(lines[0], lines[1], rtol=_SAME):
            del lines[1]
        pairs = tuple((along, line) if solved else (line, along) for line in lines)
        return Boundary(criterion, pairs, cases=len(curves))

    def _contour(self, criterion: Criterion) -> Boundary | None:
        places = [
            _places(axis, COARSE, self._cases, at)
            for axis, at in zip(self._axes, self._at, strict=True)
        ]
        number = self._others[0]
        # Two corners tell what has nothing to do with these axes, without the whole of it.
        ends = [(places[0][n], places[1][m]) for n in (0, -1) for m in (0, -1)]
        corners = [self._asked(criterion.margin, number, dict(enumerate(at))) for at in ends]
        if not _differ(corners):
            return None
        margins = np.array(
            [
                [self._asked(criterion.margin, number, {0: x, 1: y}) for x in places[0]]
                for y in places[1]
            ]
        )
        lines = contour(places[0], places[1], margins)
        if lines:
            return Boundary(criterion, lines)
        known = margins[~np.isnan(margins)]
        return Boundary(criterion, (), bool((known > 0.0).all())) if len(known) else None

    def _middle(self, n: int) -> float:
        """A value of an axis that a scenario has, whatever it is."""
        values = self._axes[n].distinct
        return float(values[len(values) // 2])

    def _asked(
        self, ask: Callable[[Scenario], float], number: int, at: Mapping[int, float]
    ) -> float:
        """What a scenario answers whose axes have these values; NaN: it is invalid."""
        values = list(self._cases.case(number).values)
        quick: dict[str, float] = {}
        for n, value in at.items():
            if _QUICK.fullmatch(self._keys[n][0]) and len(self._keys[n]) == 1:
                quick[self._keys[n][0]] = value
                value = self._middle(n)  # noqa: PLW2901
            whole = isinstance(values[self._at[n]], int)
            values[self._at[n]] = round(value) if whole else value
        try:
            scenario = self._loaded(Case(number, tuple(values)))
            for key, value in quick.items():
                scenario = _with_gain(scenario, key, value)
            return float(ask(scenario))
        except (FleetloopError, ValueError, TypeError, ArithmeticError, np.linalg.LinAlgError):
            return np.nan

    def _loaded(self, case: Case) -> Scenario:
        if case not in self._known:
            self._known[case] = self._cases.scenario(case)
        return self._known[case]


def _with_gain(scenario: Scenario, key: str, value: float) -> Scenario:
    """A scenario with another gain, which no other key depends on: loading takes ten times longer.

    Raises:
        ValueError, TypeError: it has no such gain, or not of this value.
    """
    section, _, name = key.partition(".")
    change: dict[str, Any] = {name: value}
    if section == "coordination":
        gains = replace(scenario.coordination, **change)
        return scenario.model_copy(update={"coordination": gains})
    control = scenario.control
    control = replace(control, parameters=replace(control.parameters, **change))
    return scenario.model_copy(update={"control": control})


def _others(results: Results, axes: set[str]) -> list[int]:
    """Numbers of cases, of the middle one first, then with the ends of what is on no axis."""
    numbers = results.table.column("case").to_numpy()
    chosen = [int(numbers[len(numbers) // 2])]
    for column in (*results.derived, *results.factors):
        known = np.flatnonzero(np.isfinite(column.values))
        if column.name not in axes and column.varies and column.name not in (LEFT, "seed"):
            values = column.values[known]
            chosen += [int(numbers[known[n]]) for n in (values.argmin(), values.argmax())]
    return list(dict.fromkeys(chosen))[:MOST_OTHERS]


def _places(axis: Column, count: int, cases: Cases, at: int) -> Series:
    """Places along an axis, in its range, its levels among them if they are few."""
    low, high = axis.distinct[0], axis.distinct[-1]
    if isinstance(cases.factors[at].draw, Integers):
        return np.unique(np.round(np.linspace(low, high, count)))
    even = np.linspace if not (axis.log and low > 0.0) else np.geomspace
    places: Series = even(low, high, count)
    if len(axis.distinct) <= count:  # between levels there may be no valid scenario
        places = np.unique(np.concatenate([places, axis.distinct]))
    return places


def _differ(values: Sequence[float]) -> bool:
    known = [value for value in values if not np.isnan(value)]
    finite = [value for value in known if isfinite(value)]
    return bool(known) and (
        len(finite) not in (0, len(known)) or (bool(finite) and max(finite) - min(finite) > _SAME)
    )


def contour(x: Series, y: Series, margins: Series) -> tuple[tuple[Series, Series], ...]:
    """The lines on which margins, rows along y, are 0; linear in between, infinite ones cut off."""
    from contourpy import contour_generator

    known = np.ma.masked_invalid(np.where(np.isinf(margins), np.sign(margins) * 1e3, margins))
    lines: list[Series] = contour_generator(x, y, known, line_type="Separate").lines(0.0)  # type: ignore[assignment]
    return tuple((line[:, 0], line[:, 1]) for line in lines if len(line) > 1)
