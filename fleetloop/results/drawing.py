"""Drawing over time: lines that tell robots apart, few points with every peak, panels, legends.

Robots differ by dash pattern and by lightness, so the figures stay readable in grey.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fleetloop.record.reader import Record
from fleetloop.results.decimation import drawable
from fleetloop.settling import settled_from

WIDTH_IN, HEIGHT_IN, DPI = 6.4, 3.6, 150
COLOURS = ("#08306b", "#d95f02", "#1b9e77", "#9e2a8c", "#7f7f7f", "#b8860b")
_DASHES: tuple[object, ...] = ("-", (0, (6, 2)), (0, (2, 1.2)), (0, (7, 2, 1.5, 2)))
_STRETCHES = 1500


def over_time(
    record: Record,
    series: Mapping[str, np.ndarray],
    title: str,
    ylabel: str,
    *,
    zoom: bool = False,
) -> Figure:
    """One line per entry; with `zoom`, a second panel from when all are within the settle band."""
    t = max((rows["t_s"] for rows in record.controller.values()), key=len)
    settled = _settled(list(series.values())) if zoom else None
    if not settled or t[-1] - t[settled] < 0.1 * t[-1]:
        figure, whole = axes_of()
        panels = [(whole, 0)]
    else:
        figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DPI, layout="constrained")
        whole, close = figure.subplots(1, 2, width_ratios=(3, 2))
        close.set_title(f"from {t[settled]:.1f} s on", fontsize=9)
        close.set_xlabel("t [s]")
        panels = [(whole, 0), (close, settled)]
    for n, (name, values) in enumerate(series.items()):
        colour, dash = style_of(n)
        for axes, first in panels:
            x, y = envelope(t[first : len(values)], values[first:])
            axes.plot(x, y, color=colour, linestyle=dash, label=name)
    whole.set(xlabel="t [s]", ylabel=ylabel, title=title)
    legend(panels[-1][0], len(series))
    return figure


def _settled(series: Sequence[np.ndarray]) -> int | None:
    """The first index from which all stay within the settle band, None if they don't."""
    last = max(map(settled_from, series), default=0)
    longest = max((len(values) for values in series), default=0)
    return last if last < longest - 2 else None


def envelope(
    t: np.ndarray, values: np.ndarray, stretches: int = _STRETCHES
) -> tuple[np.ndarray, np.ndarray]:
    """Few enough points to draw, with every peak: smallest and largest value of each stretch."""
    values = drawable(values)
    stretch = len(values) // stretches
    if stretch < 3:
        return t, values
    count = len(values) // stretch
    blocks = values[: count * stretch].reshape(count, stretch)
    first = np.arange(count) * stretch
    chosen = np.stack([first + blocks.argmin(axis=1), first + blocks.argmax(axis=1)])
    index = np.append(np.sort(chosen, axis=0).T.ravel(), len(values) - 1)
    return t[index], values[index]


def style_of(n: int) -> tuple[str, object]:
    """(colour, dash pattern) of the n-th line."""
    return COLOURS[n % len(COLOURS)], _DASHES[(n + n // len(COLOURS)) % len(_DASHES)]


def axes_of(height_in: float = HEIGHT_IN) -> tuple[Figure, Axes]:
    """A figure of one panel."""
    figure = Figure(figsize=(WIDTH_IN, height_in), dpi=DPI, layout="constrained")
    return figure, figure.subplots()


def legend(axes: Axes, entries: int) -> None:
    """A legend to the right of a panel, in columns if it is long; none of no lines."""
    if not axes.get_legend_handles_labels()[0]:
        return
    axes.legend(
        loc="center left",
        bbox_to_anchor=(1.0, 0.5),
        ncols=1 + (entries - 1) // 14,
        handlelength=2.8,
        frameon=False,
    )
