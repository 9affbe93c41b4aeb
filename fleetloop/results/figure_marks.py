"""Marks on the axes of time of figures for papers: faults, stops and other events, bounds."""

from collections.abc import Iterator, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fleetloop.results.palette import ROBOTS, STATE_LINES
from fleetloop.results.panel import Bound, Panel
from fleetloop.results.view import View

_FAULT, _BAD, _EVENT = ROBOTS[4], ROBOTS[1], ROBOTS[6]
_LEAST_PART = 0.003
"""A fault of an instant is as wide as this part of the axis."""


def mark(figure: Figure, view: View, signal: str) -> str:
    """Mark what happened, and what was expected of a signal ("": none); return it in words."""
    marks = view.marks
    panel = Panel("", "")
    if signal:
        view.expect(panel, signal)
    drawn = [_mark(axes, view, panel.bounds) for axes in _of_time(figure)]
    words = []
    if marks.faults and drawn:
        words.append("shaded: faults")
    if any(begin <= event.t_s for begin, _ in drawn for event in marks.events):
        words.append("dotted: events, red for those that are bad")
    if panel.bounds and drawn:
        words.append("dashed: what was expected")
    return "; ".join(words).capitalize() + "." if words else ""


def _of_time(figure: Figure) -> Iterator[Axes]:
    """The panels of a figure over time, without legends of colours and what is empty."""
    for axes in figure.axes:
        if axes.axison and axes.get_label() != "<colorbar>":
            yield axes


def _mark(axes: Axes, view: View, bounds: Sequence[Bound]) -> tuple[float, float]:
    """Mark one panel, whose limits stay; return those of its time [s]."""
    (begin_s, end_s), (low, high) = axes.get_xlim(), axes.get_ylim()
    for fault in () if axes.images else view.marks.faults:  # whose colours mean something
        until_s = max(fault.to_s, fault.from_s + _LEAST_PART * (end_s - begin_s))
        axes.axvspan(fault.from_s, until_s, color=_FAULT, alpha=0.18, linewidth=0, zorder=0)
    for bad, colour in ((False, _EVENT), (True, _BAD)):  # one artist each: there may be thousands
        times_s = sorted({event.t_s for event in view.marks.events if event.bad is bad})
        whole = axes.get_xaxis_transform()
        axes.vlines(times_s, 0, 1, colour, ":", linewidth=0.6, zorder=0.5, transform=whole)
    for bound in bounds:
        colour = STATE_LINES[bound.state]
        axes.hlines(bound.level, bound.from_s, bound.to_s, colour, "dashed", linewidth=0.7)
    axes.set_xlim(begin_s, end_s)
    axes.set_ylim(low, high)
    return begin_s, end_s
