"""Figures of a study: a map of a result, main effects, parallel coordinates, (46) case by case.

Colours grow lighter or darker evenly, so a map reads without hue as well; verdicts differ by colour
and by mark or width.
"""

from collections.abc import Sequence
from typing import Literal

import matplotlib as mpl
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.axis import Axis as Ticks
from matplotlib.colors import AsinhNorm, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import (
    FixedLocator,
    NullFormatter,
    NullLocator,
    PercentFormatter,
)

from fleetloop.results.drawing import DPI, PAGE_IN, STYLE, legend_above
from fleetloop.results.figures import Captioned
from fleetloop.results.palette import ROBOTS, STATE_LINES
from fleetloop.sweep.report.boundary import Boundary
from fleetloop.sweep.report.columns import Column, Series, linear_width, nice_marks, wrapped
from fleetloop.sweep.report.effects import Effect
from fleetloop.sweep.report.heat import Axis, Heat
from fleetloop.sweep.report.results import RATES, Results
from fleetloop.sweep.study import CONTINUOUS, MEASURED, SAMPLED
from fleetloop.sweep.theory import NEAR_1_S, agreements

MAP, THEORY_MAP, INEQUALITY = "map", "map_with_theory", "inequality_46"
GROWTH = "growth"
_LINEAR_1_S = 1e-4
"""Growth within which its scale is linear."""
MOST_NUMBERS = 12
"""Cells of a row and of a column into which their values are written."""
MOST_PANELS = 12
_LEAST_CELL = 0.045
"""Part of an axis that a cell with its value in it takes, and that ticks of levels are apart."""
_COLUMNS, _PANEL_IN = 3, 1.75
_DECADES = 100.0
"""Ratio of positive values from which they are shown on a logarithmic scale."""
_DASHES = ("-", "--", ":")
_HALO = (patheffects.Stroke(linewidth=2.4, foreground="white"), patheffects.Normal())
_EMPTY = "#e4e4e4"
_TOPS = (0.1, 0.2, 0.5, 1.0)
"""Of the scale of a failure rate; it begins with 0."""


def heat_map(heat: Heat, found: Sequence[Boundary], name: str = MAP) -> Captioned:
    """The map, the theory's boundaries over it."""
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        figure = Figure(figsize=(0.72 * PAGE_IN, 3.6), dpi=DPI, layout="constrained")
        axes = figure.subplots()
        norm = _norm(heat.means, heat.result)
        axes.set_facecolor(_EMPTY)
        axes.grid(visible=False)
        x, y = heat.x.edges, heat.y.edges
        if heat.empty:  # hatched behind, so that no colour stands for nothing
            axes.fill_between([x[0], x[-1]], y[0], y[-1], color=_EMPTY, linewidth=0, zorder=0)
            axes.fill_between(
                [x[0], x[-1]], y[0], y[-1], hatch="////", facecolor="none",
                edgecolor="#a8a8a8", linewidth=0, zorder=0,
            )  # fmt: skip
        colours = "OrRd" if heat.result.name in RATES else "cividis"
        mesh = axes.pcolormesh(
            x, y, np.ma.masked_invalid(heat.means), norm=norm, cmap=colours, rasterized=True
        )
        bar = figure.colorbar(mesh, ax=axes, label=_plain(heat.result.label))
        if heat.result.name in RATES:
            bar.ax.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
        _scale(axes, "x", heat.x)
        _scale(axes, "y", heat.y)
        if max(heat.means.shape) <= MOST_NUMBERS:
            _write(axes, heat, norm, colours)
        _draw_boundaries(axes, found)
        axes.set_xlim(x[0], x[-1])
        axes.set_ylim(y[0], y[-1])
        axes.set_xlabel(_plain(heat.x.column.label))
        axes.set_ylabel(_plain(heat.y.column.label))
        legend_above(figure, axes, len(found))
    return Captioned(name, _caption_of_map(heat, found), figure)


def _draw_boundaries(axes: Axes, found: Sequence[Boundary]) -> None:
    for n, boundary in enumerate(found):
        dash = _DASHES[n % len(_DASHES)]
        for m, (x, y) in enumerate(boundary.lines):
            label = boundary.criterion.name if m == 0 else None
            axes.plot(
                x, y, color="black", linestyle=dash, linewidth=1.4, label=label, zorder=4,
                path_effects=_HALO,
            )  # fmt: skip


def _caption_of_map(heat: Heat, found: Sequence[Boundary]) -> str:
    counts = heat.counts[heat.counts > 0]
    many = (
        f"{counts.min()}" if counts.min() == counts.max() else f"{counts.min()} to {counts.max()}"
    )
    kinds = {heat.x.exact, heat.y.exact}
    cells = "levels" if kinds == {True} else "equal parts of the range"
    if kinds == {True, False}:
        cells = "levels, or equal parts of the range"
    text = f"Mean {_words(heat.result)} over {_words(heat.x.column)} and {_words(heat.y.column)};"
    if heat.result.name in RATES:
        text = f"{heat.result.label.capitalize()}{text.removeprefix(f'Mean {heat.result.label}')}"
    text += f" cells: {cells}, {many} cases each"
    if heat.empty:
        text += f"; hatched: {heat.empty} of {heat.counts.size} cells without a value"
    for boundary in found:
        text += f". Theory: {boundary.words}"
    return f"{text}."


def _write(axes: Axes, heat: Heat, norm: Normalize, colours: str) -> None:
    """Each cell's value in it."""
    shades = mpl.colormaps[colours]
    middles = [_middles(axis) for axis in (heat.x, heat.y)]
    wide, high = (_parts(axis) > _LEAST_CELL for axis in (heat.x, heat.y))
    for (row, column), value in np.ndenumerate(heat.means):
        if np.isfinite(value) and wide[column] and high[row]:
            red, green, blue, _ = shades(norm(value))
            ink = "black" if 0.3 * red + 0.59 * green + 0.11 * blue > 0.5 else "white"
            text = f"{100 * value:.0f}" if heat.result.name in RATES else f"{value:.3g}"
            axes.text(
                float(middles[0][column]), float(middles[1][row]), text, color=ink,
                ha="center", va="center", fontsize=6,
            )  # fmt: skip


def _middles(axis: Axis) -> Series:
    edges = axis.edges
    found: Series = 0.5 * (edges[1:] + edges[:-1])
    return np.sqrt(edges[1:] * edges[:-1]) if axis.column.log and edges[0] > 0 else found


def _parts(axis: Axis) -> Series:
    """How much of the axis each cell takes."""
    log = axis.column.log and axis.edges[0] > 0.0
    edges = np.log(axis.edges) if log else axis.edges
    parts: Series = np.diff(edges) / (edges[-1] - edges[0])
    return parts


def _scale(axes: Axes, side: Literal["x", "y"], axis: Axis) -> None:
    """Levels of texts by name; few levels of numbers as they are; else as matplotlib has it."""
    column, ticks = axis.column, axes.xaxis if side == "x" else axes.yaxis
    if column.levels:
        ticks.set_major_locator(FixedLocator(axis.ticks.tolist()))
        labels = [_plain(column.shown(n)) for n in range(len(column.levels))]
        ticks.set_ticklabels(labels)
        if side == "x" and sum(map(len, labels)) > 40:
            ticks.set_tick_params(labelrotation=30)
        return
    if column.log and axis.edges[0] > 0.0:
        axes.set(**{f"{side}scale": "log"})
        _decades(ticks, column.distinct)
    elif axis.exact and axis.cells <= MOST_NUMBERS:
        levels, least = column.distinct, _LEAST_CELL * (axis.edges[-1] - axis.edges[0])
        marks = [float(levels[0])]
        for one in levels[1:].tolist():
            if one - marks[-1] >= least:
                marks.append(one)
        ticks.set_major_locator(FixedLocator(marks))
        ticks.set_major_formatter("{x:.4g}")


def _norm(values: Series, result: Column) -> Normalize:
    known = values[np.isfinite(values)]
    if result.name in RATES:
        highest = float(known.max(initial=0.0))
        return Normalize(0.0, next((top for top in _TOPS if highest <= top), 1.0))
    if not len(known):
        return Normalize(0.0, 1.0)
    low, high = float(known.min()), float(known.max())
    if low > 0.0 and high > _DECADES * low:
        return LogNorm(low, high)
    if width := linear_width(known):
        return AsinhNorm(width, low, high)
    return Normalize(low, high if high > low else low + (abs(low) or 1.0))


# --- main effects ---------------------------------------------------------------------------------


def main_effects(effects: Sequence[Effect], confidence: float) -> Captioned:
    """A panel per factor: the mean of the result by level or bin, and its interval."""
    shown = effects[:MOST_PANELS]
    rows = -(-len(shown) // _COLUMNS)
    columns = min(len(shown), _COLUMNS)
    result = shown[0].result
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        figure = Figure(
            figsize=(PAGE_IN * columns / _COLUMNS, _PANEL_IN * rows + 0.1),
            dpi=DPI,
            layout="constrained",
        )
        panels = figure.subplots(rows, columns, sharey=True, squeeze=False)
        for axes, effect in zip(panels.ravel(), shown, strict=False):
            _effect(axes, effect)
        for axes in panels.ravel()[len(shown) :]:
            axes.set_axis_off()
        for axes in panels[:, 0]:
            axes.set_ylabel(_plain(_short(result)))
        if result.name in RATES:
            panels[0, 0].yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
    left_out = len(effects) - len(shown)
    more = f"; {left_out} factors with less effect are left out" if left_out else ""
    interval = "Wilson's" if result.name in RATES else "Student's"
    caption = (
        f"Main effects on {_words(result)}: its mean by level or quantile bin of each factor, with"
        f" {interval} {100 * confidence:g} % intervals; ε² is the share of the"
        f" variance of its ranks that the factor explains{more}."
    )
    return Captioned("main_effects", caption, figure)


def _effect(axes: Axes, effect: Effect) -> None:
    bins, factor = effect.bins, effect.factor
    at = np.array([one.at for one in bins])
    means = np.array([one.mean for one in bins])
    below = np.nan_to_num(means - [one.low for one in bins])
    above = np.nan_to_num([one.high for one in bins] - means)
    errors = np.clip([below, above], 0.0, None)
    axes.errorbar(
        at, means, errors, color="#0072b2", marker="o", markersize=3, linewidth=0.9,
        elinewidth=0.8, capsize=2, linestyle="none" if factor.levels else "-",
    )  # fmt: skip
    if factor.levels:
        most = max(6, 30 // len(bins))
        axes.set_xticks(at, ["\n".join(map(_plain, wrapped(one.label, most))) for one in bins])
        axes.set_xlim(at.min() - 0.5, at.max() + 0.5)
    elif factor.log and at.min() > 0:
        axes.set_xscale("log")
        _decades(axes.xaxis, at)
    axes.set_xlabel(_plain(factor.label))
    share = "unknown" if np.isnan(effect.share) else f"{effect.share:.2f}"
    axes.set_title(f"ε² {share}", fontsize=7, pad=3)


def _decades(ticks: Ticks, values: Series) -> None:
    """Plain numbers on a logarithmic axis, some of them if it has less than two decades."""
    inside = nice_marks(float(values.min()), float(values.max()), log=True)
    ticks.set_major_locator(FixedLocator(inside))
    ticks.set_major_formatter("{x:.3g}")
    ticks.set_minor_formatter(NullFormatter())


# --- (46) -----------------------------------------------------------------------------------------


def synchronisation(results: Results) -> Captioned | None:
    """Both sides of (46) of each case, its verdict as a mark; None where neither varies."""
    if not results.derived:
        return None
    left, right = results.derived
    grows = results.rates[0] if results.condition is not None else None
    marks = results.failed if grows is None else grows.values
    if not (left.varies or right.varies) or np.isnan(marks).all():
        return None
    words = ("held", "failed") if grows is None else ("stable as simulated", "unstable")
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        figure = Figure(figsize=(0.6 * PAGE_IN, 3.0), dpi=DPI, layout="constrained")
        axes = figure.subplots()
        for state, value, mark in (("held", 0.0, "o"), ("failed", 1.0, "x")):
            here = marks == value
            if here.any():
                axes.plot(
                    right.values[here], left.values[here], mark, color=STATE_LINES[state],
                    markersize=3.0, markeredgewidth=0.8, alpha=0.7, linestyle="none",
                    label=f"{words[int(value)]}: {here.sum()}", rasterized=True,
                )  # fmt: skip
        low, high = 0.0, float(np.nanmax(right.values))
        line = np.linspace(low, 1.1 * high or 1.0, 200)
        axes.plot(line, line, color="black", linewidth=1.2, label="(46)", path_effects=_HALO)
        known = left.values[np.isfinite(left.values) & (left.values > 0)]
        if len(known) and known.max() > _DECADES * known.min():
            axes.set_yscale("log")
            axes.set_ylim(known.min() / 1.5, known.max() * 1.5)
        axes.set_xlabel("max Im(ζ)²/Re(ζ) of the graph")
        axes.set_ylabel("p²/q")
        legend_above(figure, axes, 3)
    caption = f"Both sides of (46) in every case that held or failed: {agreement(results)}."
    caption += " (46) says what becomes of the path variables in the end, not how soon."
    if results.condition is not None:
        said = "; ".join(one.words for one in agreements(results.condition, results.growths))
        caption = f"Both sides of (46) in every case, and what simulation says: {said}."
    return Captioned(INEQUALITY, caption, figure)


def growth(results: Results) -> Captioned | None:
    """Growth as simulated over growth by theory; None of a study that isn't held against it."""
    if results.condition is None:
        return None
    columns = results.growths
    ours = columns[MEASURED]
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        figure = Figure(figsize=(0.6 * PAGE_IN, 3.0), dpi=DPI, layout="constrained")
        axes = figure.subplots()
        largest = max(float(np.nanmax(np.abs(one), initial=0.0)) for one in columns.values())
        reach = 2.0 * (largest or 1.0)
        for x, y in ((-reach, reach), (reach, -reach)):
            axes.fill_between([0.0, x], 0.0, y, color=_EMPTY, linewidth=0, zorder=0)
        kinds = ((CONTINUOUS, "x", "(46), continuous"), (SAMPLED, ".", "as sampled"))
        for n, (name, mark, label) in enumerate(kinds):
            axes.plot(
                columns[name], ours, mark, color=ROBOTS[1 - n], markersize=3.0, alpha=0.6,
                markeredgewidth=0.7, linestyle="none", label=label, rasterized=True,
            )  # fmt: skip
        for set_scale in (axes.set_xscale, axes.set_yscale):
            set_scale("symlog", linthresh=_LINEAR_1_S)
        axes.set_xlim(-reach, reach)
        axes.set_ylim(-reach, reach)
        for ticks in (axes.xaxis, axes.yaxis):
            ticks.set_major_locator(FixedLocator([-1.0, -0.01, -0.0001, 0.0, 0.0001, 0.01, 1.0]))
            ticks.set_minor_locator(NullLocator())
            ticks.set_major_formatter("{x:g}")
        axes.set_xlabel("growth by theory [1/s]")
        axes.set_ylabel("growth as simulated [1/s]")
        legend_above(figure, axes, 2)
    first = agreements(results.condition, columns)[0]
    caption = (
        "Growth of the path variables' disagreement, as simulated, over that by theory; scales are"
        f" linear within ±{_LINEAR_1_S:g} 1/s. Shaded: they contradict each other. The least growth"
        f" of any case is {first.least_1_s:.2g} 1/s; within {NEAR_1_S:g} 1/s of the boundary"
        f" simulation and the condition that judges ({first.condition}) are at most"
        f" {first.off_1_s:.2g} 1/s apart."
    )
    return Captioned(GROWTH, caption, figure)


def agreement(results: Results) -> str:
    """In how many cases verdict and (46) say the same."""
    left, right = results.derived
    known = np.isfinite(results.failed) & np.isfinite(left.values) & np.isfinite(right.values)
    stable = left.values[known] > right.values[known]
    failed = results.failed[known] == 1.0
    parts = [
        f"it holds in {stable.sum()}, of which {(stable & failed).sum()} failed",
        f"it doesn't in {(~stable).sum()}, of which {(~stable & ~failed).sum()} held",
    ]
    return "; ".join(parts)


# --- words ----------------------------------------------------------------------------------------


def _words(column: Column) -> str:
    """A column in a caption."""
    return column.label


def _short(column: Column) -> str:
    """A label for a small panel: long ones by the column's name."""
    return column.label if len(column.label) <= 32 else column.name


def _plain(text: str) -> str:
    """A text of the user's, whose dollar signs begin no formula."""
    return text.replace("$", r"\$")
