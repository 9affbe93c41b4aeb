"""The plots of a live page as Bokeh models; their sources are filled by the page's script.

The server sends one array a frame (`fleetloop.live.frame`); the script spreads it over the sources
below. They aren't synchronised: what a browser draws doesn't come back.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from bokeh.models import (
    AdaptiveTicker,
    ColumnDataSource,
    FixedTicker,
    HoverTool,
    PanTool,
    Range1d,
    WheelZoomTool,
)
from bokeh.plotting import figure

from configs.scenario import Scenario
from fleetloop.live.course import torque_limits_wheel_N_m
from fleetloop.results.palette import RobotStyle, robot_style

LEAST_ERROR_M = 1e-5
"""Errors are drawn from here on, on a logarithmic axis."""
ERRORS = {"x_e": "|x_e| [m]", "y_e": "|y_e| [m]", "theta_e": "θ_e [rad]"}
EFFORTS = {"tau_right": "τ right [N·m]", "tau_left": "τ left [N·m]"}
_ON_DECADES = ("x_e", "y_e")
_DECADES = [1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0]
_NEUTRAL, _LIMIT = "#888888", "#b5651d"
"""Of lines that no theme decides: legible on both grounds."""
_PAIR_LABEL = "s_i − s_j [m]"


def source(name: str, columns: Mapping[str, Sequence[object]]) -> ColumnDataSource:
    """A source that only the browser fills."""
    return ColumnDataSource(name=name, data=dict(columns), syncable=False)


def _range(name: str, low: float, high: float) -> Range1d:
    return Range1d(start=low, end=high, name=name, syncable=False)


def styles(count: int) -> list[RobotStyle]:
    """Of the robots of a scenario."""
    return [robot_style(number) for number in range(count)]


def plane(robots: Sequence[str], courses: Mapping[str, np.ndarray]) -> figure:
    """The plane: paths, trails, references, edges of the graph, robots."""
    colours = [look.colour for look in styles(len(robots))]
    zoom = WheelZoomTool(zoom_on_axis=False)
    made = figure(
        name="plane",
        x_range=_range("plane_x", -1.0, 1.0),
        y_range=_range("plane_y", -1.0, 1.0),
        tools=[PanTool(), zoom],
        sizing_mode="stretch_both",
        min_height=200,
        toolbar_location="right",
        x_axis_label="x [m]",
        y_axis_label="y [m]",
        lod_threshold=None,
        output_backend="canvas",
    )
    made.toolbar.active_scroll = zoom
    paths = ColumnDataSource(
        name="paths",
        data={
            "xs": [courses[robot][:, 0] for robot in robots],
            "ys": [courses[robot][:, 1] for robot in robots],
            "colour": colours,
        },
    )
    made.multi_line("xs", "ys", source=paths, line_color="colour", line_alpha=0.32, line_width=5)
    empty: list[object] = [[] for _ in robots]
    trails = source("trails", {"xs": empty, "ys": empty, "colour": colours})
    made.multi_line("xs", "ys", source=trails, line_color="colour", line_width=1.6)
    edges = source(
        "edges",
        {"x0": [], "y0": [], "x1": [], "y1": [], "colour": [], "width": [], "dash": []},
    )
    made.segment(
        "x0",
        "y0",
        "x1",
        "y1",
        source=edges,
        line_color="colour",
        line_width="width",
        line_dash="dash",
        line_alpha=0.9,
        line_cap="round",
    )
    marks = source("edge_marks", {"x": [], "y": [], "angle": [], "marker": [], "colour": []})
    made.scatter(
        "x",
        "y",
        source=marks,
        marker="marker",
        angle="angle",
        size=9,
        line_color="colour",
        fill_color="colour",
        line_width=2,
    )
    references = source("references", {"x": [], "y": [], "colour": []})
    made.scatter(
        "x", "y", source=references, marker="cross", size=13, line_color="colour", line_width=2
    )
    bodies = source(
        "bodies",
        {
            "xs": [],
            "ys": [],
            "colour": [],
            "name": [],
            "x": [],
            "y": [],
            "label_x": [],
            "label_y": [],
        },
    )
    drawn = made.patches(
        "xs",
        "ys",
        source=bodies,
        fill_color="colour",
        fill_alpha=0.95,
        line_color={"value": "white"},
        line_width=1,
    )
    made.text(
        "label_x",
        "label_y",
        text="name",
        source=bodies,
        text_font_size="12px",
        text_font_style="bold",
        text_baseline="middle",
        text_align="center",
        text_color="label_colour",
    )
    bodies.data["label_colour"] = []
    made.add_tools(
        HoverTool(
            renderers=[drawn],
            tooltips=[("robot", "@name"), ("x, y", "@x{0.000}, @y{0.000} m")],
        )
    )
    made.xgrid.grid_line_alpha = made.ygrid.grid_line_alpha = 0.7
    return made


def charts(scenario: Scenario, robots: Sequence[str]) -> dict[str, figure]:
    """Signals over time, one figure each, by name, in two rows that are drawn in turn."""
    looks = styles(len(robots))
    whose: dict[str, Sequence[object]] = {
        "robot": list(robots),
        "colour": [look.colour for look in looks],
        "dash": [list(look.dash) for look in looks],
    }
    made: dict[str, figure] = {}
    for row, names in enumerate((ERRORS, EFFORTS)):
        time = _range(f"time_{row}", 0.0, 20.0)
        lines: dict[str, Sequence[object]] = {n: [[] for _ in robots] for n in ("t", *names)}
        series = source(f"series_{row}", lines | whose)
        if row == 1:
            pairs = source(
                "pairs", {"t": [], "difference": [], "robot": [], "colour": [], "dash": []}
            )
            made["difference"] = _chart("difference", _PAIR_LABEL, time, pairs)
        for name, label in names.items():
            made[name] = _chart(name, label, time, series, log=name in _ON_DECADES)
    _bounds(made, scenario)
    return made


def _chart(
    name: str, label: str, time: Range1d, series: ColumnDataSource, *, log: bool = False
) -> figure:
    value = _range(f"{name}_y", LEAST_ERROR_M, 10.0) if log else _range(f"{name}_y", -1.0, 1.0)
    made = figure(
        name=name,
        title=label,
        x_range=time,
        y_range=value,
        y_axis_type="log" if log else "linear",
        tools=[],
        sizing_mode="stretch_both",
        min_height=120,
        toolbar_location=None,
        lod_threshold=None,
    )
    lines = made.multi_line(
        "t",
        name,
        source=series,
        line_color="colour",
        line_dash="dash",
        line_width=1.6,
    )
    made.add_tools(
        HoverTool(
            renderers=[lines],
            line_policy="nearest",
            tooltips=[("", "@robot"), ("t", "$x{0.00} s"), (label, "$y{0.0000}")],
        )
    )
    made.min_border_left = 46
    made.min_border_right = 8
    if log:
        made.yaxis.ticker = FixedTicker(ticks=_DECADES)
    else:
        made.yaxis.ticker = AdaptiveTicker(desired_num_ticks=5, num_minor_ticks=0)
        made.hspan(y=[0.0], line_width=1, line_color=_NEUTRAL)
    made.xaxis.ticker = AdaptiveTicker(desired_num_ticks=6, num_minor_ticks=0)
    return made


def _bounds(made: Mapping[str, figure], scenario: Scenario) -> None:
    """Limits of torques, and bounds of expectations in their windows."""
    known = [it for it in torque_limits_wheel_N_m(scenario).values() if it is not None]
    levels = [sign * limit for limit in sorted(set(known)) for sign in (1.0, -1.0)]
    for name in EFFORTS if levels else ():
        made[name].hspan(y=levels, line_width=1.5, line_dash=[8, 4], line_color=_LIMIT)
    names = {"x_e_m": "x_e", "y_e_m": "y_e", "theta_e_rad": "theta_e"}
    for expect in scenario.expect:
        if expect.signal not in names:
            continue
        name = names[expect.signal]
        if expect.max_abs is None or expect.reference is not None:
            continue
        begin = expect.from_s
        end = scenario.ends_at_s if expect.to_s is None else expect.to_s
        for sign in (1.0,) if name in _ON_DECADES else (1.0, -1.0):
            bound = sign * expect.max_abs
            made[name].line([begin, end], [bound, bound], line_dash=[2, 3], line_color=_NEUTRAL)
