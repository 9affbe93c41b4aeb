"""Figures of a comparison: a line per law, of its worst robot at every tick.

Left the whole course on a logarithmic scale, metres to micrometres in one picture, at the scale of
the laws that came through; right the final part, linear, at the scale of those that have settled.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fleetloop.compare.measures import SPREAD, THETA_ERROR, TORQUE, Course
from fleetloop.compare.results import Row
from fleetloop.results.decimation import drawable
from fleetloop.results.drawing import DPI, HEIGHT_IN, PAGE_IN, STYLE, style_of
from fleetloop.results.figures import Captioned
from fleetloop.settling import FINAL_S, SETTLE_BAND

_LEGEND_IN = 0.22
"""Height of a line of the legend."""
_DECADES = 7.0
"""That the left panel shows at most below its greatest value."""


class _Quantity(NamedTuple):
    name: str
    file: str
    caption: str
    ylabel: str
    band: bool  # whether it is an error with a settle band


_QUANTITIES = (
    _Quantity(
        "x_e_m", "x_e", "Path following error x_e along the robot.", "max |x$_e$| [m]", band=True
    ),
    _Quantity(
        "y_e_m", "y_e", "Path following error y_e across the robot.", "max |y$_e$| [m]", band=True
    ),
    _Quantity(
        "theta_e_rad",
        "theta_e",
        "Path following error θ_e, the heading.",
        "max |θ$_e$| [rad]",
        band=True,
    ),
    _Quantity(
        SPREAD,
        "s_spread",
        "Spread of the path variables: the coordination's, which no law acts on.",
        "max s − min s [m]",
        band=True,
    ),
    _Quantity(
        TORQUE, "torque", "Commanded wheel torque, right or left.", "max |τ| [N·m]", band=False
    ),
    _Quantity(
        THETA_ERROR,
        "theta_hat",
        "Error of the parameter estimates, of laws that have them.",
        "max ‖Θ̂ − Θ‖ / ‖Θ‖",
        band=False,
    ),
)


def all_figures(rows: Sequence[Row], seed: int) -> list[Captioned]:
    """Every figure of a comparison, of the runs with one seed."""
    courses = {
        (n, row.label): run.courses
        for n, row in enumerate(rows)
        for run in row.outcomes
        if run is row.runs.get(seed) and run.courses is not None
    }
    sound = {row.label for row in rows if row.sound}
    figures = []
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        for quantity in _QUANTITIES:
            lines = {
                key: found[quantity.name]
                for key, found in courses.items()
                if quantity.name in found and len(found[quantity.name].t_s) > 1
            }
            if lines:
                figure = _drawn(quantity, lines, sound)
                figures.append(Captioned(quantity.file, quantity.caption, figure))
    return figures


def _drawn(
    quantity: _Quantity, lines: Mapping[tuple[int, str], Course], sound: Collection[str]
) -> Figure:
    height_in = 1.15 * HEIGHT_IN + _LEGEND_IN * -(-len(lines) // 2)
    figure = Figure(figsize=(PAGE_IN, height_in), dpi=DPI, layout="constrained")
    whole, close = figure.subplots(1, 2, width_ratios=(3, 2))
    end_s = max(float(course.t_s[-1]) for course in lines.values())
    from_s = max(end_s - FINAL_S, 0.0)
    came_through = [course for (_, label), course in lines.items() if label in sound or not sound]
    for (n, label), course in lines.items():
        colour, dash = style_of(n)
        values = np.abs(drawable(course.values))
        whole.plot(course.t_s, np.where(values > 0, values, np.nan), color=colour, linestyle=dash)
        late = course.t_s >= from_s
        close.plot(course.t_s[late], values[late], color=colour, linestyle=dash, label=label)
    _logarithmic(whole, came_through)
    if quantity.band:
        _mark_band(whole)
    close.set_ylim(0.0, _ceiling(quantity, came_through, from_s))
    close.set_title(f"final: the last {min(FINAL_S, end_s):.3g} s", fontsize=8)
    close.ticklabel_format(axis="y", style="sci", scilimits=(-3, 3))
    for axes in (whole, close):
        axes.set_xlabel("t [s]")
    whole.set(ylabel=quantity.ylabel)
    whole.set_title("worst robot, whole run", fontsize=8)
    figure.legend(loc="outside lower center", ncols=2, handlelength=3.2, frameon=False)
    return figure


def _mark_band(axes: Axes) -> None:
    """Mark it where it is in sight: a label outside of the axes would take their place."""
    low, high = axes.get_ylim()
    if not low < SETTLE_BAND < high:
        return
    axes.axhline(SETTLE_BAND, color="0.5", linewidth=0.8, linestyle=":")
    axes.annotate(
        f"settled: {SETTLE_BAND:g}",
        (1.0, SETTLE_BAND),
        xycoords=("axes fraction", "data"),
        ha="right",
        va="bottom",
        fontsize=7,
        color="0.4",
    )


def _ceiling(quantity: _Quantity, lines: Sequence[Course], from_s: float) -> float:
    """The top of the right panel: of laws that have settled, or else of all these."""
    peaks = [_peak(line.values[line.t_s >= from_s]) for line in lines]
    settled = [peak for peak in peaks if peak <= SETTLE_BAND] if quantity.band else peaks
    return 1.1 * max(settled or peaks) or 1.0


def _peak(values: np.ndarray) -> float:
    return float(np.nanmax(np.abs(drawable(values)), initial=0.0))


def _logarithmic(axes: Axes, lines: Sequence[Course]) -> None:
    """A logarithmic scale over the range of these lines; others may leave it at the top."""
    axes.set_yscale("log")
    high = 2.0 * max(_peak(line.values) for line in lines)
    if high > 0.0:
        low, _ = axes.get_ylim()
        axes.set_ylim(max(low, high * 10.0**-_DECADES), high)
