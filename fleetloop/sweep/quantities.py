"""What is kept of a case: statistics of signals, the margin of each expectation, the verdict.

statistics       the columns of [keep] (`fleetloop.sweep.statistics`)
growth           by theory, and as simulated, of a study with [theory] (`fleetloop.sweep.theory`)
expect_N_margin  of the N-th expectation, from 1 on, as `fleetloop report` has it; null: unknown
margin           the least of these, and of theory; minus infinity if a robot stopped or diverged
verdict          as that of a run (`fleetloop.results.expectations`): held, failed, not checked;
                 what theory says is expected, too
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import inf
from typing import NamedTuple, get_args

import numpy as np

from configs.errors import Complaint
from configs.events import Event
from configs.expect import claim as sentence
from configs.resolve import signals_of
from configs.scenario import Scenario
from configs.signals import DERIVED_SIGNALS, DISTANCE, PATH_DISTANCE, PLANT_SIGNALS, SPREAD
from configs.wording import guess
from fleetloop.record.reader import Record
from fleetloop.results import expectations
from fleetloop.results.expectations import Judged, judge
from fleetloop.results.series import SeriesOf
from fleetloop.results.tables import claim
from fleetloop.sweep import theory
from fleetloop.sweep.statistics import TORQUE, TORQUES, UNITS, Course, Kind, parts_of, statistic
from fleetloop.sweep.study import CONTINUOUS, MEASURED, SAMPLED, Condition, Study

_MADE_OF = {
    SPREAD: ("s",),
    DISTANCE: ("x_m", "y_m"),
    PATH_DISTANCE: ("x_m", "y_m", "s"),
    TORQUE: TORQUES,
}


class Quantity(NamedTuple):
    """A column that is a statistic."""

    name: str
    unit: str
    statistic: Kind
    signal: str
    robots: tuple[str, ...]

    @property
    def sources(self) -> tuple[str, ...]:
        """The recorded signals that it is made of."""
        return _MADE_OF.get(self.signal, (self.signal,))


class Finding(NamedTuple):
    """What came of a case."""

    verdict: str
    reason: str
    margin: float | None
    values: Mapping[str, float | None]
    """By column."""


@dataclass(frozen=True, slots=True)
class Quantities:
    """All that is kept of each case of a study."""

    statistics: tuple[Quantity, ...]
    expected: tuple[str, ...]
    """Names of the columns of margins."""
    units: tuple[str, ...]
    """Of these."""
    claims: tuple[str, ...]
    """What each expectation of the base says."""
    signals: frozenset[str]
    """The recorded signals that are needed for all of it."""
    condition: Condition | None = None
    """Of theory, that each case is held against."""

    @property
    def predicted(self) -> tuple[str, ...]:
        """Columns of what theory says."""
        return () if self.condition is None else (SAMPLED, CONTINUOUS)

    @property
    def names(self) -> tuple[str, ...]:
        """All columns."""
        return (*(one.name for one in self.statistics), *self.predicted, *self.expected)

    def find(
        self,
        record: Record,
        scenario: Scenario,
        stopped: Mapping[str, str],
        events: Sequence[Event],
    ) -> Finding:
        """What came of a case that was run to its end.

        Args:
            record: of its run; it has the `signals` at least.
            scenario: of the case.
            stopped: robots that stopped themselves or diverged, and why.
            events: all of the run.
        """
        series_of = SeriesOf(record, scenario)
        judged = [judge(expect, record, scenario, events, series_of) for expect in scenario.expect]
        verdict = expectations.verdict(judged, stopped=bool(stopped), cut_short=False)
        margins = [one["margin"] for one in judged]
        seen: _Courses = {}
        values: dict[str, float | None] = {
            one.name: _value(one, series_of, scenario, seen) for one in self.statistics
        }
        values |= dict.fromkeys(self.expected)
        values |= {
            name: None if margin is None else float(margin)
            for name, margin in zip(self.expected, margins, strict=False)
        }
        reason = _reason(verdict, judged, stopped)
        if self.condition is not None:
            values |= theory.predicted(scenario)
            margins.append(theory.margin_1_s(self.condition, values))
            verdict, reason = _held_against(
                self.condition, values, verdict, reason, expects=bool(judged)
            )
        known = [float(margin) for margin in margins if margin is not None]
        return Finding(verdict, reason, -inf if stopped else min(known, default=None), values)


def _held_against(
    condition: Condition,
    values: Mapping[str, float | None],
    verdict: str,
    reason: str,
    *,
    expects: bool,
) -> tuple[str, str]:
    """Verdict and reason of a case that theory is expected of, too."""
    if verdict == "failed":
        return verdict, reason
    agrees = theory.agrees(condition, values)
    if agrees is None:
        return "not checked", "no growth is found in its run, or none by theory"
    if not agrees:
        return "failed", theory.contradiction(condition, values)
    return (verdict, reason) if expects else ("held", "")


def _reason(verdict: str, judged: Sequence[Judged], stopped: Mapping[str, str]) -> str:
    if verdict == "not checked":
        return expectations.why_not_checked(judged, {})
    if stopped:
        return "; ".join(f"{robot}: {reason}" for robot, reason in stopped.items())
    return "; ".join(claim(one) for one in judged if one["held"] is False)


_Courses = dict[tuple[str, tuple[str, ...]], list[Course]]


def _value(one: Quantity, series_of: SeriesOf, scenario: Scenario, seen: _Courses) -> float | None:
    """The value of a column; several are about the same courses, which are `seen` once."""
    about = (one.signal, one.robots)
    if about not in seen:
        signals = TORQUES if one.signal == TORQUE else (one.signal,)
        seen[about] = [
            course
            for signal in signals
            for course in _courses(signal, one.robots, series_of, scenario)
        ]
    courses = seen[about]
    if one.statistic == "growth_1_s_of":
        courses = [_when_shared(course, scenario) for course in courses]
    return statistic(one.statistic, courses)


def _when_shared(course: Course, scenario: Scenario) -> Course:
    """A course at the instants of shares: from one to the next a fleet's map is the same."""
    clock = scenario.clock
    ticks = np.rint(course.t_s / clock.control_period_s).astype(np.int64)
    here = ticks % round(clock.share_period_s / clock.control_period_s) == 0
    return Course(course.t_s[here], course.values[here])


def _courses(
    signal: str, robots: Sequence[str], series_of: SeriesOf, scenario: Scenario
) -> Iterator[Course]:
    period_s = scenario.clock.control_period_s
    alike = series_of.alike(signal, robots)
    if alike is not None:
        t_s = _times_s(alike.values.shape[1], period_s)
        yield from (Course(t_s, values) for values in alike.values)
        return
    for series in series_of(signal, robots):
        t_s = _times_s(len(series.values), period_s)[series.member.ticks]
        values = series.values[series.member.ticks]
        if series.all_known:
            yield Course(t_s, values)
            continue
        known = series.known[series.member.ticks]
        yield Course(t_s, values) if known.all() else Course(t_s[known], values[known])


@lru_cache(maxsize=8)
def _times_s(ticks: int, period_s: float) -> np.ndarray:
    times_s = np.arange(ticks) * period_s
    times_s.flags.writeable = False
    return times_s


# --- of a study -----------------------------------------------------------------------------------


def quantities_of(study: Study, base: Scenario, name: str) -> tuple[Quantities, list[Complaint]]:
    """What a study keeps of each case, and what is wrong with that.

    Args:
        study: that is to be done.
        base: its scenario; one of another law may lack some of its signals: then there is no value.
        name: of the study's file.
    """
    units = _units(base)
    found: list[Complaint] = []
    made: list[Quantity] = []
    for n, text in enumerate(study.keep.quantities):
        parts = parts_of(text)
        if parts is None:
            kinds = ", ".join(f"{kind}_" for kind in get_args(Kind))
            remedy = f"must begin with a statistic ({kinds}), a signal behind it"
            found.append(Complaint(name, f"keep.quantities.{n}", text, remedy))
            continue
        made.append(Quantity(text, "", *parts, ()))
    if study.theory is not None:
        found += theory.unfit(base, name)
        made.append(Quantity(MEASURED, "", "growth_1_s_of", "mu", ()))
    made += [
        Quantity(one.name, "", one.statistic, one.signal, one.robots or ())
        for one in study.keep.quantity
    ]
    for one in made:
        if one.signal not in units:
            hint = guess(one.signal, list(units), 0.5)
            remedy = f"no such signal{hint} (known: {', '.join(units)})"
            found.append(Complaint(name, f"keep: {one.name}", one.signal, remedy))
        for robot in one.robots:
            if robot not in base.names:
                remedy = f"no such robot; known: {', '.join(base.names)}"
                found.append(Complaint(name, f"keep: {one.name}", robot, remedy))
    kept = tuple(
        one._replace(unit=UNITS.get(one.statistic) or units.get(one.signal, "")) for one in made
    )
    condition = None if study.theory is None else study.theory.stability
    return _with_expectations(kept, base, units, condition), found


def _with_expectations(
    kept: tuple[Quantity, ...],
    base: Scenario,
    units: Mapping[str, str],
    condition: Condition | None,
) -> Quantities:
    of_expectations = [expect.signal for expect in base.expect if expect.signal is not None]
    sources = [_MADE_OF.get(signal, (signal,)) for signal in of_expectations]
    needed = {source for some in (*sources, *(one.sources for one in kept)) for source in some}
    return Quantities(
        kept,
        tuple(f"expect_{n}_margin" for n in range(1, len(base.expect) + 1)),
        tuple(
            "s" if expect.settle_within_s is not None else units.get(expect.signal or "", "")
            for expect in base.expect
        ),
        tuple(sentence(expect) for expect in base.expect),
        frozenset({"s", *needed}),
        condition,
    )


def _units(base: Scenario) -> dict[str, str]:
    """The signals of a scenario and their units."""
    tables = [PLANT_SIGNALS, DERIVED_SIGNALS, *(signals_of(base, robot) for robot in base.robot)]
    units = {signal.name: signal.unit for table in tables for signal in table}
    del units["t_s"]
    return {**units, TORQUE: "N·m"}
