"""Panels as Bokeh plots: linked time axes, one crosshair, what is marked on all of them.

A renderer's tags are the groups in which it is shown; a plot's tags are "follow", the least span of
its axis, whether it is logarithmic, and the span for the whole run: `report.js` reads them.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.models import (
    ColumnDataSource,
    CrosshairTool,
    CustomJS,
    FactorRange,
    FixedTicker,
    HoverTool,
    Range1d,
    UnionRenderers,
)
from bokeh.models.annotations import Span
from bokeh.models.glyphs import Line as LineGlyph
from bokeh.models.renderers import GlyphRenderer
from bokeh.plotting import figure

from fleetloop.results.marks import Marks
from fleetloop.results.palette import ROBOTS, STATE_LINES
from fleetloop.results.panel import Bound, Panel, Spot

HEIGHT, SMALL = 230, 190
_LEFT_BORDER = 62
"""The same in all plots, so that linked axes are below each other [px]."""
_TOOLS = "xpan,xbox_zoom,xwheel_zoom,reset,save"
_FAULT, _EVENT, _BAD = ROBOTS[4], ROBOTS[6], ROBOTS[1]
_MOST_ROWS = 24
"""Of the timeline."""
_DECADES = [10.0**n for n in range(-12, 10)]
_WITHIN_DECADES = [n * decade for decade in _DECADES for n in range(2, 10)]
"""Of a logarithmic axis: only decades have labels, others would be printed over each other."""
SEEK = "window.fleetloop?.seek(cb_obj.x)"


class TimePlots:
    """Plots over the time of one run."""

    def __init__(self, end_s: float, marks: Marks) -> None:
        begin_s = min([0.0, *(one.t_s for one in marks.events)])
        least_s = max(end_s - begin_s, 1e-3)
        pad_s = 0.01 * least_s
        self.x_range = Range1d(
            start=begin_s - pad_s,
            end=end_s + pad_s,
            bounds=(begin_s - 5 * pad_s, end_s + 5 * pad_s),
        )
        self.x_range.name = "time"
        self._cross = Span(dimension="height", line_dash="dotted", line_color=ROBOTS[6])
        self.cursor = Span(
            location=begin_s, dimension="height", line_color=ROBOTS[5], line_width=1.5, name="now"
        )
        self._marks = marks
        # Shared: a page has many plots, and Bokeh's time goes by the number of models.
        self._seek = CustomJS(code=SEEK)
        self._policy = UnionRenderers()
        self._faults = ColumnDataSource(
            {
                "x0": [one.from_s for one in marks.faults],
                # A fault of an instant is seen, too.
                "x1": [max(one.to_s, one.from_s + 0.002 * least_s) for one in marks.faults],
                "text": [one.text for one in marks.faults],
            }
        )
        self._events = ColumnDataSource(
            {
                "x": [one.t_s for one in marks.events],
                "text": [one.text for one in marks.events],
                "colour": [_BAD if one.bad else _EVENT for one in marks.events],
            }
        )

    def draw(self, panel: Panel, *, height: int = HEIGHT, brief: bool = False) -> figure:
        """A panel; a brief one has only its title above it."""
        low, high = panel.span
        plot = self._figure(
            panel.title if brief or not panel.beyond else f"{panel.title} — {panel.beyond}",
            height,
            y_range=Range1d(start=low, end=high),
            y_axis_type="log" if panel.logarithmic else "linear",
        )
        plot.tags = ["follow", panel.floor, panel.logarithmic, low, high]
        if panel.logarithmic:
            plot.yaxis.ticker = FixedTicker(ticks=_DECADES, minor_ticks=_WITHIN_DECADES)
        self._mark(plot)
        _bands(plot, panel)
        lines = self._lines(plot, panel)
        if lines:
            plot.add_tools(
                _hover(lines, [("", "$name"), ("t [s]", "@t{%.6g}"), ("value", _of(panel))])
            )
        _expectations(plot, panel)
        return plot

    def timeline(self) -> figure | None:
        """Faults and events by their sources; None without any."""
        rows = [*(one.name for one in self._marks.faults), *(e.source for e in self._marks.events)]
        rows = list(dict.fromkeys(rows))[:_MOST_ROWS]
        if not rows:
            return None
        plot = self._figure(
            "Faults and events", 70 + 20 * len(rows), y_range=FactorRange(factors=rows[::-1])
        )
        faults = ColumnDataSource(
            {**self._faults.data, "row": [one.name for one in self._marks.faults]}
        )
        events = ColumnDataSource(
            {**self._events.data, "row": [one.source for one in self._marks.events]}
        )
        bars = plot.hbar(
            y="row", left="x0", right="x1", height=0.6, source=faults, color=_FAULT, alpha=0.7
        )
        dots = plot.scatter(x="x", y="row", source=events, size=9, color="colour", marker="diamond")
        for renderer in (bars, dots):
            renderer.tags = ["marks"]
        plot.add_tools(_hover([bars, dots], [("", "@text")]))
        return plot

    def _figure(self, title: str, height: int, **more: Any) -> figure:
        plot = figure(
            title=title,
            height=height,
            sizing_mode="stretch_width",
            x_range=self.x_range,
            tools=_TOOLS,
            active_drag="xbox_zoom",
            active_scroll=None,
            min_border_left=_LEFT_BORDER,
            min_border_right=16,
            **more,
        )
        plot.add_tools(CrosshairTool(overlay=self._cross))
        plot.add_layout(self.cursor)
        plot.js_on_event("tap", self._seek)
        return plot

    def _mark(self, plot: figure) -> None:
        found: list[GlyphRenderer[Any]] = []
        if self._marks.faults:
            found.append(
                plot.vstrip(
                    "x0",
                    "x1",
                    source=self._faults,
                    fill_color=_FAULT,
                    fill_alpha=0.16,
                    line_color=_FAULT,
                    line_alpha=0.6,
                )
            )
        if self._marks.events:
            found.append(
                plot.vspan(
                    "x", source=self._events, line_color="colour", line_alpha=0.7, line_dash=[2, 3]
                )
            )
        for renderer in found:
            renderer.tags = ["marks"]
            renderer.level = "underlay"
        if found:
            plot.add_tools(_hover(found, [("", "@text")]))

    def _lines(self, plot: figure, panel: Panel) -> "list[GlyphRenderer[Any]]":
        found = []
        for one in panel.lines:
            t, values = one.points
            drawn = plot.add_glyph(
                ColumnDataSource(
                    {"t": _small(t), "v": _small(values)}, selection_policy=self._policy
                ),
                LineGlyph(
                    x="t",
                    y="v",
                    line_color=one.style.colour,
                    line_dash=list(one.style.dash),
                    line_width=one.style.width,
                ),
            )
            drawn.name, drawn.tags = one.label, list(one.groups)
            found.append(drawn)
        return found


def _of(panel: Panel) -> str:
    unit = panel.unit if panel.unit != "1" else ""
    return f"@v{{%.6g}} {unit}".rstrip()


def _bands(plot: figure, panel: Panel) -> None:
    for band in panel.bands:
        source = ColumnDataSource(
            {"t": _small(band.t), "low": _small(band.low), "high": _small(band.high)}
        )
        area = plot.varea("t", "low", "high", source=source, fill_color=band.colour, fill_alpha=0.3)
        area.name, area.tags = band.label, ["band"]


def _expectations(plot: figure, panel: Panel) -> None:
    """Bounds over their windows and the worst places, on top of the lines."""
    found: list[GlyphRenderer[Any]] = []
    if panel.bounds:
        bounds = _told(
            panel.bounds,
            x0=[one.from_s for one in panel.bounds],
            x1=[one.to_s for one in panel.bounds],
            y=[one.level for one in panel.bounds],
        )
        found.append(
            plot.segment(
                "x0",
                "y",
                "x1",
                "y",
                source=bounds,
                line_color="colour",
                line_width=2,
                line_dash=[6, 4],
            )
        )
    if panel.spots:
        spots = _told(
            panel.spots,
            x=[one.t_s for one in panel.spots],
            y=[one.value for one in panel.spots],
        )
        found.append(
            plot.scatter(
                "x",
                "y",
                source=spots,
                marker="circle_x",
                size=10,
                line_color="colour",
                fill_alpha=0.0,
                line_width=1.5,
            )
        )
    for renderer in found:
        renderer.tags = ["bounds"]
    if found:
        plot.add_tools(_hover(found, [("", "@text")]))


def _told(marks: Sequence[Bound | Spot], **places: list[float]) -> ColumnDataSource:
    """Places of marks, with the colours of their states and their texts."""
    colours, texts = [STATE_LINES[one.state] for one in marks], [one.text for one in marks]
    return ColumnDataSource({**places, "colour": colours, "text": texts})


def _hover(renderers: "Sequence[GlyphRenderer[Any]]", tooltips: list[tuple[str, str]]) -> HoverTool:
    return HoverTool(
        renderers=list(renderers),
        tooltips=tooltips,
        formatters={"@t": "printf", "@v": "printf"},
        line_policy="nearest",
        visible=False,
    )


def _small(values: np.ndarray) -> np.ndarray:
    """Seven digits are enough to draw, at half the size."""
    return np.asarray(values, dtype=np.float32)
