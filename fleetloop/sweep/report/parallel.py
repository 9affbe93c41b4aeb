"""Parallel coordinates: a line per case through its factors to its result, coloured by verdict."""

from collections.abc import Sequence
from dataclasses import replace

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fleetloop.results.drawing import DPI, PAGE_IN, STYLE
from fleetloop.results.figures import Captioned
from fleetloop.results.palette import STATE_LINES
from fleetloop.sweep.report.columns import (
    Column,
    Series,
    linear_width,
    nice_marks,
    shortened,
    wrapped,
)
from fleetloop.sweep.report.results import Results

MOST_LINES, MOST_AXES = 600, 9
_STATES = {0.0: ("held", 0.6), 1.0: ("failed", 0.9)}
"""By `Results.failed`: state and width of its lines."""
_OTHER = ("neither", 0.6)
_DECADES = 100.0
_TICKS, _GAP = 8, 0.055
"""Levels that are all told; least distance of two texts."""
_BELOW = -0.13
"""Where a case without a value is."""


def parallel_coordinates(
    results: Results, factors: Sequence[Column], result: Column
) -> Captioned | None:
    """The figure; None if there is nothing to join.

    Args:
        results: of the study.
        factors: those with the largest effects first.
        result: the last axis.
    """
    shown = [*factors[: MOST_AXES - 1], _logarithmic(result)]
    if len(shown) < 2:
        return None
    heights = np.array([_heights(column) for column in shown])
    missing = np.isnan(heights)
    chosen = _chosen(results.failed, np.arange(len(results)))
    heights = np.where(missing, _BELOW, heights)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(PAGE_IN, 2.9), dpi=DPI, layout="constrained")
        axes = figure.subplots()
        handles = _lines(axes, heights, results.failed, chosen)
        _axes(axes, shown, missing.any(axis=1).tolist())
        figure.legend(
            handles=handles, loc="outside upper center", ncols=3, frameon=False, handlelength=2.4
        )
    caption = f"Parallel coordinates: a line per case from its factors to {result.label}"
    if len(chosen) < len(results):
        caption += f"; {len(chosen)} of {len(results)} cases, failed ones first"
    if count := int(missing.any(axis=0).sum()):
        caption += f"; without a value, below the axis: {count}"
    return Captioned("parallel_coordinates", f"{caption}.", figure)


def _logarithmic(column: Column) -> Column:
    values = column.values[np.isfinite(column.values)]
    wide = len(values) and values.min() > 0.0 and values.max() > _DECADES * values.min()
    return replace(column, log=bool(wide))


def _chosen(failed: Series, numbers: np.ndarray) -> np.ndarray:
    """Cases that are drawn: half of the lines at least for those that failed, evenly chosen."""
    if len(numbers) <= MOST_LINES:
        return numbers
    bad, good = numbers[failed == 1.0], numbers[failed != 1.0]
    most_bad = min(len(bad), max(MOST_LINES // 2, MOST_LINES - len(good)))
    parts = ((bad, most_bad), (good, min(len(good), MOST_LINES - most_bad)))
    return np.concatenate(
        [some[np.linspace(0, len(some) - 1, most).astype(int)] for some, most in parts if most]
    )


def _heights(column: Column) -> Series:
    """Values from 0 to 1 over the range."""
    values = _scaled(column, column.values)
    low, high = np.nanmin(values, initial=np.inf), np.nanmax(values, initial=-np.inf)
    if not high > low:
        return np.where(np.isfinite(values), 0.5, np.nan)
    return (values - low) / (high - low)


def _scaled(column: Column, values: Series) -> Series:
    with np.errstate(all="ignore"):
        if column.log and column.distinct[0] > 0.0:
            return np.log(values)
        width = 0.0 if column.levels else linear_width(column.distinct)
        return np.arcsinh(values / width) if width else values


def _lines(axes: Axes, heights: np.ndarray, failed: Series, chosen: np.ndarray) -> list[Line2D]:
    """The lines, those that failed above; their legend."""
    handles = []
    places = np.arange(len(heights))
    for value in (np.nan, 0.0, 1.0):
        here = chosen[np.isnan(failed[chosen]) if np.isnan(value) else failed[chosen] == value]
        if not len(here):
            continue
        name, width = _STATES.get(value, _OTHER)
        colour = STATE_LINES.get(name, "#7d7d7d")
        alpha = float(np.clip(40.0 / len(here), 0.25, 0.8))
        segments = [np.column_stack([places, heights[:, n]]) for n in here]
        lines = LineCollection(segments, colors=colour, linewidths=width, alpha=alpha)
        lines.set_rasterized(True)
        axes.add_collection(lines)
        count = int(np.isnan(failed).sum() if np.isnan(value) else (failed == value).sum())
        handles.append(Line2D([], [], color=colour, linewidth=2 * width, label=f"{name}: {count}"))
    return handles


def _axes(axes: Axes, shown: Sequence[Column], missing: Sequence[bool]) -> None:
    axes.set_xlim(-0.25, len(shown) - 0.75)
    axes.set_ylim(_BELOW - 0.04 if any(missing) else -0.04, 1.04)
    axes.set_yticks([])
    axes.grid(visible=False)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.set_xticks(range(len(shown)), [_wrapped(column) for column in shown])
    axes.tick_params(axis="x", length=0)
    for n, column in enumerate(shown):
        axes.plot([n, n], [0.0, 1.0], color="0.3", linewidth=0.8, zorder=3)
        marks = [*_ticks(column), *([(_BELOW, "no value")] if missing[n] else [])]
        for height, text in marks:
            axes.plot([n - 0.015, n + 0.015], [height] * 2, color="0.3", linewidth=0.8, zorder=3)
            axes.text(
                n + 0.03, height, text.replace("$", r"\$"), fontsize=6.5, va="center", zorder=5,
                bbox={"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 0.6},
            )  # fmt: skip


def _ticks(column: Column) -> list[tuple[float, str]]:
    """Heights and texts: levels, or some values of the range."""
    distinct = column.distinct
    if not len(distinct):
        return []
    marks: Sequence[float] = distinct.tolist()
    if len(distinct) > _TICKS and not column.levels:
        log = column.log and distinct[0] > 0.0
        marks = nice_marks(float(distinct[0]), float(distinct[-1]), log=log)
        if not log and linear_width(distinct):
            decades = [10.0**e for e in range(-9, 13)]
            signed = [-one for one in reversed(decades)] + [0.0] + decades
            marks = [one for one in signed if distinct[0] <= one <= distinct[-1]]
    ends = _scaled(column, distinct[[0, -1]])
    heights = (
        [0.5]
        if len(distinct) == 1
        else (_scaled(column, np.array(marks)) - ends[0]) / (ends[1] - ends[0])
    )
    found: list[tuple[float, str]] = []
    for height, mark in zip(heights, marks, strict=True):
        if not found or height - found[-1][0] >= _GAP:
            found.append((float(height), shortened(column.shown(mark))))
    return found


def _wrapped(column: Column) -> str:
    """A label below an axis, its unit and long words on a line of their own."""
    name = column.label if len(column.label) <= 24 else column.name
    return "\n".join(wrapped(name, 14)).replace("$", r"\$")
