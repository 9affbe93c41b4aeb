"""What a report shows: which result, over which axes, and what comes of it, as numbers.

The same numbers are on the page, in the terminal and in `--json`.
"""

from collections import Counter
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from configs.errors import ScenarioError
from fleetloop.sweep.report.boundary import Boundary, boundaries
from fleetloop.sweep.report.columns import Column
from fleetloop.sweep.report.derived import RIGHT
from fleetloop.sweep.report.effects import (
    MEASURE,
    Effect,
    effect_of,
    ranking,
    varying_result,
)
from fleetloop.sweep.report.heat import Heat, heat_of
from fleetloop.sweep.report.results import MARGIN, Results
from fleetloop.sweep.stopping import Rate
from fleetloop.sweep.theory import Agreement, agreements
from fleetloop.sweep.worst import place_of, worst_in

METHOD = "Wilson"
MOST_PAIRED = 4
"""Factors whose pairs are looked at for a boundary."""
MOST_REASONS = 20
"""Different reasons that are listed."""


@dataclass(frozen=True, slots=True)
class Choice:
    """What was asked for; None: what suits."""

    x: str | None = None
    y: str | None = None
    color: str | None = None
    worst: int = 20


@dataclass(frozen=True, slots=True)
class Worst:
    """One of the worst cases."""

    case: int
    verdict: str
    reason: str
    margin: float | None
    factors: dict[str, Any]
    command: str
    record: str
    """Where its whole run is, from the study's folder; "" if it wasn't kept."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A report."""

    results: Results
    result: Column
    rate: Rate
    effects: tuple[Effect, ...]
    """On the result, the largest first."""
    heat: Heat | None
    """None: there are no two factors for one, `no_map` says why."""
    no_map: str
    found: tuple[Boundary, ...]
    more: tuple[tuple[Heat, tuple[Boundary, ...]], ...]
    """Another map, where theory has a boundary, if it has none on the first."""
    worst: tuple[Worst, ...]
    against: tuple[Agreement, ...] = ()
    """Simulation against theory, of a study that is held against it."""

    @property
    def factors(self) -> list[Column]:
        """Those that have an effect at all, the largest first."""
        return [one.factor for one in self.effects]

    def shares(self) -> list[tuple[Column, list[float]]]:
        """ε² of all results that vary, of each factor in the order of `factors`."""
        results = self.results
        confidence = results.confidence
        return [
            (result, [effect_of(one, result, confidence).share for one in self.factors])
            for result in (*results.rates, *results.quantities)
            if result.varies
        ]

    def engines(self) -> list[tuple[str, str, int]]:
        """Engine, why not the kernel, cases; most cases first."""
        pairs = zip(self.results.texts("engine"), self.results.texts("engine_reason"), strict=True)
        counts = Counter(pairs)
        return [(engine, why, n) for (engine, why), n in counts.most_common()]

    def without_result(self) -> list[tuple[str, str, int, int, str]]:
        """Verdict, reason, cases, the first of them and its command, of those without result."""
        results = self.results
        numbers = results.table.column("case").to_pylist()
        reasons, commands = results.texts("reason"), results.texts("command")
        found: dict[tuple[str, str], list[int]] = {}
        for row, verdict in enumerate(results.verdicts):
            if verdict not in ("held", "failed", "not checked"):
                reason = reasons[row].replace(f"case {numbers[row]}: ", "")
                found.setdefault((verdict, reason), []).append(row)
        ordered = sorted(found.items(), key=lambda one: -len(one[1]))
        return [
            (verdict, reason, len(rows), numbers[rows[0]], commands[rows[0]])
            for (verdict, reason), rows in ordered[:MOST_REASONS]
        ]


def view_of(results: Results, choice: Choice) -> View:
    """What a report shows.

    Raises:
        ScenarioError: a column isn't there, or doesn't suit.
    """
    result = varying_result(results) if choice.color is None else results.result(choice.color)
    factors = ranked(results)
    effects = tuple(ranking(factors, result, results.confidence))
    x, y, why_not = _axes(results, choice, [one.factor for one in effects])
    known = np.isfinite(results.failed)
    rate = Rate(int((results.failed == 1.0).sum()), int(known.sum()), results.confidence)
    heat: Heat | None = None
    found: tuple[Boundary, ...] = ()
    if x is not None and y is not None:
        heat = heat_of(x, y, result)
        if heat.counts.any():
            found = tuple(boundaries(results, x, y))
        else:
            heat, why_not = None, f"no case has a value of {result.label}"
    more: tuple[tuple[Heat, tuple[Boundary, ...]], ...] = ()
    unasked = heat is not None and choice.x is None and choice.y is None
    if unasked and not any(one.lines for one in found):
        more = _with_theory(results, result, [one.factor for one in effects])
    worst = _worst(results, choice.worst)
    against: tuple[Agreement, ...] = ()
    if results.condition is not None:
        against = tuple(agreements(results.condition, results.growths))
    return View(results, result, rate, effects, heat, why_not, found, more, worst, against)


def _with_theory(
    results: Results, result: Column, factors: list[Column]
) -> tuple[tuple[Heat, tuple[Boundary, ...]], ...]:
    """The map of the first pair of factors, by their effects, on which theory has a boundary."""
    order = [one.name for one in results.factors]
    fit = [one for one in factors if one.name in order and not one.levels][:MOST_PAIRED]
    for pair in combinations(fit, 2):
        x, y = sorted(pair, key=lambda one: order.index(one.name))
        found = tuple(boundaries(results, x, y))
        if any(one.lines for one in found):
            return ((heat_of(x, y, result), found),)
    return ()


def ranked(results: Results) -> list[Column]:
    """Factors with a main effect: of too many different graphs, the right side of (46)."""
    fit = [one for one in results.factors if one.is_axis]
    many = any(len(one.levels) > 1 and not one.is_axis for one in results.factors)
    return fit + [one for one in results.derived if many and one.name == RIGHT and one.varies]


def _axes(
    results: Results, choice: Choice, factors: list[Column]
) -> tuple[Column | None, Column | None, str]:
    """The axes of the map, or why there is none."""
    x = None if choice.x is None else results.axis("--x", choice.x)
    y = None if choice.y is None else results.axis("--y", choice.y)
    if x is not None and y is not None and x.name == y.name:
        raise ScenarioError(f"--x {x.name} --y {y.name}: a map needs two different columns")
    taken = {one.name for one in (x, y) if one is not None}
    names = [one.name for one in results.factors]
    own = sorted(factors, key=lambda one: one.name not in names)  # what is derived comes last
    left = iter([one for one in own if one.name not in taken])
    x = x or next(left, None)
    y = y or next(left, None)
    if x is None or y is None:
        few = len(factors)
        what = f"{few} factor has" if few == 1 else "no factor has"
        return x, y, f"{what} several values here: a map needs two"
    if choice.x is None and choice.y is None:
        # As they are in the study, so that a map looks the same whichever has the larger effect.
        order = [one.name for one in (*results.factors, *results.derived)]
        x, y = sorted((x, y), key=lambda one: order.index(one.name))
    return x, y, ""


def _worst(results: Results, most: int) -> tuple[Worst, ...]:
    table = results.table
    numbers = table.column("case").to_pylist()
    margins = table.column(MARGIN).to_pylist()
    chosen = worst_in(numbers, results.verdicts, margins, most=most)
    rows = {number: row for row, number in enumerate(numbers)}
    found = []
    for number in chosen:
        (row,) = table.slice(rows[number], 1).to_pylist()
        kept = place_of(results.folder, number)
        found.append(
            Worst(
                number,
                row["verdict"],
                row["reason"] or "",
                row[MARGIN],
                {one.name: row[one.name] for one in results.factors},
                row["command"],
                str(kept.relative_to(results.folder)) if kept.is_dir() else "",
            )
        )
    return tuple(found)


def numbers_of(view: View) -> dict[str, Any]:
    """All of it for programs."""
    results, rate = view.results, view.rate
    return {
        "study": results.title,
        "base": results.told.get("base"),
        "design": results.told.get("design"),
        "cases": results.total,
        "done": len(results),
        "running": results.running,
        "ended": results.ended,
        "damaged_parts": list(results.damaged),
        "counts": dict(results.counts),
        "engines": [
            {"engine": engine, "reason": why, "cases": n} for engine, why, n in view.engines()
        ],
        "failed": rate.failed,
        "judged": rate.judged,
        "failure_rate": rate.value,
        "failure_rate_interval": list(rate.interval),
        "theory_agreement": [one._asdict() for one in view.against],
        "interval": {"method": METHOD, "confidence": rate.confidence},
        "result": view.result.name,
        "measure": MEASURE,
        "effects": [
            {
                "factor": one.factor.name,
                "share": one.share,
                "bins": [found._asdict() for found in one.bins],
            }
            for one in view.effects
        ],
        "map": None
        if view.heat is None
        else {"x": view.heat.x.column.name, "y": view.heat.y.column.name},
        "theory": [
            one.words for found in (view.found, *(found for _, found in view.more)) for one in found
        ],
        "worst": [{name: getattr(one, name) for name in Worst.__slots__} for one in view.worst],
    }
