"""Figures of a tuning: how its objective went, which parameters decide, where good values are.

A dot is a feasible trial, a cross one that misses a constraint. Trials that are far worse than the
others are beyond the axes.
"""

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

from fleetloop.results.drawing import COLOURS, DPI, HEIGHT_IN, PAGE_IN, STYLE, WIDTH_IN
from fleetloop.results.figures import Captioned
from fleetloop.tune.scores import Trial
from fleetloop.tune.tuning import Tuning

_FEASIBLE, _INFEASIBLE, _BEST, _BASELINE = COLOURS[0], COLOURS[6], COLOURS[1], COLOURS[2]
_COLUMNS = 3
_BEYOND = 0.15
"""Of the range of the feasible trials, that is shown beside it."""
_DECADE = 10.0
"""A scale is logarithmic if its numbers span more."""


def all_figures(
    tuning: Tuning,
    trials: Sequence[Trial],
    best: Trial,
    importances: Mapping[str, float],
    cases: Mapping[str, Sequence[float | None]],
) -> list[Captioned]:
    """Every figure of a tuning.

    Args:
        tuning: what was asked.
        trials: all that are done.
        best: of them.
        importances: of the parameters, none if they aren't known.
        cases: the objective's quantity in each case, of the baseline and of the best.
    """
    label = tuning.objective.label
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        found = [
            Captioned(
                "history",
                f"Objective of each trial ({label}); the line is the best feasible one so far,"
                " crosses miss a constraint.",
                _history(tuning, trials),
            ),
            Captioned(
                "slices",
                f"Objective ({label}) over each parameter. Crosses miss a constraint; the square"
                " is the baseline, the diamond the best trial.",
                _slices(tuning, trials, best),
            ),
        ]
        if importances:
            caption = "How much each parameter decides whether a trial is among the best tenth."
            found.append(Captioned("importances", caption, _importances(importances)))
        if len(cases) == 2:
            caption = (
                f"{tuning.objective.quantity} in each case: under the best gains over under the"
                " baseline's. Cases off the line are better on its one side, worse on the other."
            )
            found.append(Captioned("cases", caption, _cases(tuning, cases)))
    return found


def _history(tuning: Tuning, trials: Sequence[Trial]) -> Figure:
    figure = Figure(figsize=(PAGE_IN, HEIGHT_IN), dpi=DPI, layout="constrained")
    axes = figure.subplots()
    _scatter(axes, trials, [trial.number for trial in trials])
    sign, so_far, line = tuning.objective.sign, np.inf, []
    for trial in trials:
        value = trial.score.objective
        if trial.score.feasible and value is not None:
            so_far = min(so_far, sign * value)
        line.append(sign * so_far if np.isfinite(so_far) else np.nan)
    numbers = [trial.number for trial in trials]
    axes.plot(numbers, line, color=_BEST, drawstyle="steps-post", label="best so far")
    if tuning.baseline is not None and (first := trials[0].score.objective) is not None:
        axes.axhline(first, color=_BASELINE, linestyle="--", label="baseline")
    axes.set(xlabel="trial", ylabel=tuning.objective.label)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    _bound(axes, trials)
    axes.legend(loc="upper right")
    return figure


def _slices(tuning: Tuning, trials: Sequence[Trial], best: Trial) -> Figure:
    count = len(tuning.parameter)
    columns = min(_COLUMNS, count)
    lines = -(-count // columns)
    size = (PAGE_IN, HEIGHT_IN * lines)
    figure = Figure(figsize=size, dpi=DPI, layout="constrained")
    panels = figure.subplots(lines, columns, sharey=True, squeeze=False)
    for n, axes in enumerate(panels.flat):
        if n >= count:
            axes.set_axis_off()
            continue
        parameter = tuning.parameter[n]
        name = parameter.column
        texts = any(isinstance(trial.values[name], str | bool) for trial in trials)
        places = [str(t.values[name]) if texts else t.values[name] for t in trials]
        if parameter.logarithmic:
            _logarithmic(axes)
        _scatter(axes, trials, places)
        marked = [(best, "D", _BEST)]
        if tuning.baseline is not None:
            marked.insert(0, (trials[0], "s", _BASELINE))
        for trial, marker, colour in marked:
            if trial.score.objective is not None:
                place = places[trial.number]
                axes.plot([place], [trial.score.objective], marker, color=colour, markersize=5)
        axes.set(xlabel=name)
        if n % columns == 0:
            axes.set(ylabel=tuning.objective.label)
        _bound(axes, trials)
    return figure


def _importances(importances: Mapping[str, float]) -> Figure:
    names = list(importances)[::-1]
    height_in = 0.5 + 0.22 * len(names)
    figure = Figure(figsize=(WIDTH_IN, height_in), dpi=DPI, layout="constrained")
    axes = figure.subplots()
    axes.barh(names, [importances[name] for name in names], color=_FEASIBLE)
    axes.set(xlabel="importance (PED-ANOVA)", xlim=(0.0, 1.0))
    return figure


def _cases(tuning: Tuning, cases: Mapping[str, Sequence[float | None]]) -> Figure:
    (x_name, x), (y_name, y) = (
        (name, np.array(values, dtype=float)) for name, values in cases.items()
    )
    figure = Figure(figsize=(WIDTH_IN, WIDTH_IN), dpi=DPI, layout="constrained")
    axes = figure.subplots()
    axes.plot(x, y, "o", color=_FEASIBLE, markersize=3)
    both = np.concatenate([x, y])
    if np.isfinite(both).any():
        least, most = np.nanmin(both), np.nanmax(both)
        axes.plot([least, most], [least, most], color="0.5", linewidth=0.8)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(5))
    quantity = tuning.objective.quantity
    axes.set(xlabel=f"{quantity}, {x_name}", ylabel=f"{quantity}, {y_name}")
    return figure


def _logarithmic(axes: Axes) -> None:
    """A logarithmic scale whose numbers are written out."""
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())


def _scatter(axes: Axes, trials: Sequence[Trial], places: Sequence[object]) -> None:
    for feasible, colour, marker in ((True, _FEASIBLE, "o"), (False, _INFEASIBLE, "x")):
        some = [
            (place, trial.score.objective)
            for place, trial in zip(places, trials, strict=True)
            if trial.score.feasible is feasible and trial.score.objective is not None
        ]
        if some:
            x, y = zip(*some, strict=True)
            axes.plot(x, y, marker, color=colour, markersize=3, linestyle="none")


def _bound(axes: Axes, trials: Sequence[Trial]) -> None:
    """Show the feasible trials, and as many of the others as are no further away."""
    shown = [
        trial.score.objective
        for trial in trials
        if trial.score.objective is not None and (trial.score.feasible or trial.number == 0)
    ]
    least, most = min(shown, default=0.0), max(shown, default=0.0)
    if least > 0.0 and most > _DECADE * least:
        axes.set_yscale("log")
        axes.set_ylim(least / (1.0 + _BEYOND), most * (1.0 + _BEYOND))
    elif most > least:
        span = most - least
        axes.set_ylim(least - _BEYOND * span, most + _BEYOND * span)
