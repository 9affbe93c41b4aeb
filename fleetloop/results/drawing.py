"""Drawing over time for papers: lines that tell robots apart, panels in column width, legends.

Robots differ by dash pattern and by colour, so the figures stay readable in grey. Fonts have 7 to
9 points in a column of 88 mm or a page of 180 mm.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import SymmetricalLogLocator

from fleetloop.record.reader import Record
from fleetloop.results.decimation import decimated
from fleetloop.results.palette import ROBOTS
from fleetloop.results.panel import FLOORS, span
from fleetloop.settling import settled_from

WIDTH_IN, PAGE_IN = 88.0 / 25.4, 180.0 / 25.4
HEIGHT_IN, DPI = 2.2, 300
COLOURS = ROBOTS
_DASHES: tuple[object, ...] = ("-", (0, (6, 2)), (0, (2, 1.2)), (0, (7, 2, 1.5, 2)))
_POINTS = 1200
_CLOSER = 2.0
"""A second panel spans less than the first by this at least."""
_LOGARITHMIC_FROM, _FEW_DECADES = 4.0, 30.0
"""Of torques [N·m]."""
STYLE: Any = {
    "font.size": 8,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.5,
    "axes.linewidth": 0.6,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "lines.linewidth": 1.0,
    "legend.fontsize": 7,
    "legend.framealpha": 0.9,
    "figure.constrained_layout.h_pad": 0.02,
    "figure.constrained_layout.w_pad": 0.02,
    # Text stays text, so that a paper's editor may set it.
    "svg.fonttype": "none",
    "svg.hashsalt": "fleetloop",
    "pdf.fonttype": 42,
}


def over_time(
    record: Record,
    series: Mapping[str, np.ndarray],
    ylabel: str,
    unit: str,
    *,
    zoom: bool = False,
) -> Figure:
    """One line per entry; with `zoom`, a second panel from when all are within the settle band.

    No axis spans less than the floor of its unit, `fleetloop.results.panel.FLOORS`.
    """
    t = max((rows["t_s"] for rows in record.controller.values()), key=len)
    settled = _settled(list(series.values())) if zoom else None
    if not settled or not _closer(list(series.values()), unit, settled):
        figure, whole = axes_of()
        panels = [(whole, 0)]
    else:
        figure = Figure(figsize=(WIDTH_IN, 1.6 * HEIGHT_IN), dpi=DPI, layout="constrained")
        whole, close = figure.subplots(2, 1)
        close.set_title(f"from {t[settled]:.1f} s on")
        close.set(xlabel="t [s]", ylabel=ylabel)
        panels = [(whole, 0), (close, settled)]
    for axes, first in panels:
        for n, (name, values) in enumerate(series.items()):
            colour, dash = style_of(n)
            x, y = decimated(t[first : len(values)], values[first:], _POINTS)
            axes.plot(x, y, color=colour, linestyle=dash, label=name)
        axes.set_ylim(span([values[first:] for values in series.values()], unit))
    whole.set(ylabel=ylabel, xlabel="" if len(panels) > 1 else "t [s]")
    legend_above(figure, whole, len(series))
    return figure


def _settled(series: Sequence[np.ndarray]) -> int | None:
    """The first index from which all stay within the settle band, None if they don't."""
    last = max(map(settled_from, series), default=0)
    longest = max((len(values) for values in series), default=0)
    return last if last < longest - 2 else None


def _closer(series: Sequence[np.ndarray], unit: str, settled: int) -> bool:
    """Whether the rest from an index on is long enough, and shows more on an axis of its own."""
    longest = max(map(len, series))
    if longest - settled < 0.1 * longest:
        return False
    whole, rest = (span([values[first:] for values in series], unit) for first in (0, settled))
    return whole.high - whole.low > _CLOSER * (rest.high - rest.low)


def widen(axes: Axes, unit: str) -> None:
    """Let the axis of values span the floor of its unit at least."""
    low, high = axes.get_ylim()
    missing = max(0.0, FLOORS.get(unit, 0.0) - (high - low)) / 2.0
    axes.set_ylim(low - missing, high + missing)


def torque_scale(axes: Axes) -> None:
    """Linear, or beyond 1 N·m logarithmic if the values get far beyond."""
    peak_N_m = max(map(abs, axes.get_ylim()))
    if peak_N_m > _LOGARITHMIC_FROM:
        axes.set_yscale("symlog", linthresh=1.0, linscale=2.0, subs=[2, 5])
        ticks = SymmetricalLogLocator(
            base=10.0, linthresh=1.0, subs=[1.0, 2.0, 5.0] if peak_N_m < _FEW_DECADES else [1.0]
        )
        axes.yaxis.set_major_locator(ticks)
        axes.yaxis.set_major_formatter("{x:g}")


def style_of(n: int) -> tuple[str, object]:
    """(colour, dash pattern) of the n-th line."""
    return COLOURS[n % len(COLOURS)], _DASHES[(n + n // len(COLOURS)) % len(_DASHES)]


def axes_of(height_in: float = HEIGHT_IN, width_in: float = WIDTH_IN) -> tuple[Figure, Axes]:
    """A figure of one panel."""
    figure = Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained")
    return figure, figure.subplots()


def legend_above(figure: Figure, axes: Axes, entries: int) -> None:
    """One legend of a figure above its panels; none of no lines, none of too many."""
    handles, labels = axes.get_legend_handles_labels()
    if handles and entries <= MOST_LABELS:
        columns = min(len(labels), 4)
        figure.legend(
            handles,
            labels,
            loc="outside upper center",
            ncols=columns,
            handlelength=2.4,
            frameon=False,
            columnspacing=1.2,
        )


MOST_LABELS = 16
"""Of a legend."""
