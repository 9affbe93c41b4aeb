"""The plane, animated: paths, tracks, robots with their headings, and the edges of the graph.

Robots and edges move by `report.js`, from frames at equal intervals: the tags of the plot are
"plane", the interval [s], the size of a robot [m], its outline, frames, robots, edges, and of every
edge the windows [s] in which it exists, None for always.
"""

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool
from bokeh.plotting import figure

from configs.edges import LEADER
from fleetloop.results.decimation import drawable, stride
from fleetloop.results.palette import ROBOT_OUTLINE, ROBOTS
from fleetloop.results.view import View, group_of

HEIGHT = 460
_FRAMES, _LEAST_FRAMES, _PLACES = 600, 150, 36_000
"""Frames at most and at least, and all robots' places in all frames together."""
_TRACK_POINTS, _MOST_TRACK_POINTS = 500, 12_000
_MOST_EDGES = 400
_ROBOT_PART = 0.014
"""Size of a robot, as part of the plane that is shown."""
_GREY = ROBOTS[6]


def plane(view: View) -> figure | None:
    """The plane of a run; None if no robot has a row."""
    record = view.record
    there = [robot for robot in record.robots if len(record.plant[robot])]
    if not there:
        return None
    plot = figure(
        title="",
        height=HEIGHT,
        sizing_mode="stretch_width",
        match_aspect=True,
        tools="pan,box_zoom,wheel_zoom,reset,save",
        active_drag="pan",
        active_scroll=None,
        x_axis_label="x [m]",
        y_axis_label="y [m]",
        min_border_left=50,
    )
    _tracks(plot, view, there)
    longest = max((record.plant[robot] for robot in there), key=len)
    dt_s, frames = _frames(view, there, float(longest["t_s"][-1]))
    size = max(_ROBOT_PART * _extent(view, there), 0.05)
    robots, edges, windows = _moving(plot, view, there, size)
    plot.tags = [
        "plane",
        dt_s,
        size,
        [list(c) for c in ROBOT_OUTLINE],
        frames,
        robots,
        edges,
        windows,
    ]
    return plot


def _tracks(plot: figure, view: View, there: list[str]) -> None:
    points = max(60, min(_TRACK_POINTS, _MOST_TRACK_POINTS // len(there)))
    for robot in there:
        truth, used = view.record.plant[robot], view.record.controller[robot]
        own = robot in view.robots
        if own and len(used):
            pick = stride(len(used), points)
            reference = plot.line(
                drawable(used["x_d_m"][pick]).astype(np.float32),
                drawable(used["y_d_m"][pick]).astype(np.float32),
                line_color=_GREY,
                line_alpha=0.35,
                line_width=5,
            )
            reference.tags, reference.name = [group_of(robot)], f"{robot}: reference"
        pick = stride(len(truth), points)
        style = view.style(robot)
        track = plot.line(
            drawable(truth["x_m"][pick]).astype(np.float32),
            drawable(truth["y_m"][pick]).astype(np.float32),
            line_color=style.colour if own else _GREY,
            line_dash=list(style.dash) if own else [],
            line_width=1.3 if own else 0.6,
        )
        track.tags, track.name = [group_of(robot)] if own else ["band"], robot


def _frames(view: View, there: list[str], end_s: float) -> tuple[float, ColumnDataSource]:
    """Interval and places of all robots, frame by frame; where a robot's rows end it stays."""
    count = int(np.clip(_PLACES // len(there), _LEAST_FRAMES, _FRAMES))
    t = np.linspace(0.0, end_s, count)
    columns: dict[str, np.ndarray] = {}
    for column in ("x_m", "y_m", "theta_rad"):
        table = np.empty((count, len(there)), dtype=np.float32)
        for n, robot in enumerate(there):
            rows = view.record.plant[robot]
            at = np.minimum(np.searchsorted(rows["t_s"], t), len(rows) - 1)
            table[:, n] = drawable(rows[column][at])
        columns[column] = table.ravel()
    return end_s / max(count - 1, 1), ColumnDataSource(columns, name="frames")


def _extent(view: View, there: list[str]) -> float:
    """The longer side of the plane that the tracks need [m]."""
    sides = []
    for column in ("x_m", "y_m"):
        values = np.concatenate([drawable(view.record.plant[robot][column]) for robot in there])
        known = values[np.isfinite(values)]
        sides.append(float(known.max() - known.min()) if len(known) else 0.0)
    return max(sides)


def _moving(
    plot: figure, view: View, there: list[str], size: float
) -> tuple[ColumnDataSource, ColumnDataSource, list[list[list[float]] | None]]:
    """What moves: edges below, robots above; at the places of the first frame."""
    rows = {robot: view.record.plant[robot][0] for robot in there}
    topology = view.scenario.topology
    pairs = [
        (edge, windows)
        for edge, windows in topology.windows.items()
        if edge[0] != LEADER and edge[0] in rows and edge[1] in rows
    ][:_MOST_EDGES]
    period_s, last_s = view.scenario.clock.control_period_s, view.end_s
    windows_s = [
        None
        if spans is None
        else [[a * period_s, min(b * period_s, last_s + 1.0)] for a, b in spans]
        for _, spans in pairs
    ]
    edges = ColumnDataSource(
        {
            "x0": [float(rows[a]["x_m"]) for (a, _), _ in pairs],
            "y0": [float(rows[a]["y_m"]) for (a, _), _ in pairs],
            "x1": [float(rows[b]["x_m"]) for (_, b), _ in pairs],
            "y1": [float(rows[b]["y_m"]) for (_, b), _ in pairs],
            "xm": [float(0.4 * rows[a]["x_m"] + 0.6 * rows[b]["x_m"]) for (a, b), _ in pairs],
            "ym": [float(0.4 * rows[a]["y_m"] + 0.6 * rows[b]["y_m"]) for (a, b), _ in pairs],
            "angle": [0.0 for _ in pairs],
            "alpha": [0.8 if s is None or (s and s[0][0] <= 0.0) else 0.0 for s in windows_s],
            "a": [there.index(a) for (a, _), _ in pairs],
            "b": [there.index(b) for (_, b), _ in pairs],
            "name": [f"{a} → {b}" for (a, b), _ in pairs],
        },
        name="edges",
    )
    shafts = plot.segment(
        "x0", "y0", "x1", "y1", source=edges, line_color=_GREY, line_alpha="alpha"
    )
    heads = plot.scatter(
        "xm",
        "ym",
        source=edges,
        marker="triangle",
        angle="angle",
        size=8,
        line_color=None,
        fill_color=_GREY,
        fill_alpha="alpha",
    )
    for renderer in (shafts, heads):
        renderer.tags = ["edges"]
    corners = np.array(ROBOT_OUTLINE) * size
    turned = [
        (np.array([[np.cos(h), np.sin(h)], [-np.sin(h), np.cos(h)]]), x, y)
        for h, x, y in ((row["theta_rad"], row["x_m"], row["y_m"]) for row in rows.values())
    ]
    robots = ColumnDataSource(
        {
            "xs": [list(map(float, (corners @ turn)[:, 0] + x)) for turn, x, _ in turned],
            "ys": [list(map(float, (corners @ turn)[:, 1] + y)) for turn, _, y in turned],
            "colour": [view.style(r).colour if r in view.robots else _GREY for r in there],
            "name": there,
            "group": [group_of(r) if r in view.robots else "band" for r in there],
            "alpha": [0.85] * len(there),
            "x": [float(row["x_m"]) for row in rows.values()],
            "y": [float(row["y_m"]) for row in rows.values()],
        },
        name="robots",
    )
    bodies = plot.patches(
        "xs",
        "ys",
        source=robots,
        fill_color="colour",
        line_color="colour",
        fill_alpha="alpha",
        line_alpha="alpha",
    )
    plot.add_tools(
        HoverTool(
            renderers=[bodies],
            tooltips=[("", "@name"), ("x [m]", "@x{0.000}"), ("y [m]", "@y{0.000}")],
            visible=False,
        )
    )
    return robots, edges, windows_s
