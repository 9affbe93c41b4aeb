"""Figures of a run for papers: the paper's and a few more; matplotlib only, no files.

    graph               the directed graph             parameter_errors  s_i − s_j over the edges
    positions           positions and orientations     path_variables, speed_estimates, torques
    x_e, y_e, theta_e   path following errors          law_signals       whatever the laws record
    ages, edge_states   age of the data of each edge   clock             lateness, round trips

No figure has a title: its caption names the scenario. Lines and widths are
`fleetloop.results.drawing`'s.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from configs.loading import load
from configs.scenario import Scenario
from configs.signals import law_table
from fleetloop.record.reader import Record
from fleetloop.results.decimation import decimated, drawable, stride
from fleetloop.results.drawing import (
    COLOURS,
    DPI,
    HEIGHT_IN,
    MOST_LABELS,
    PAGE_IN,
    STYLE,
    WIDTH_IN,
    axes_of,
    legend_above,
    over_time,
    style_of,
    torque_scale,
    widen,
)
from fleetloop.results.figure_marks import mark
from fleetloop.results.graph_drawing import drawn
from fleetloop.results.network import ages_of
from fleetloop.results.network_figures import ages, edge_states
from fleetloop.results.panel import FLOORS, span
from fleetloop.results.summary import Summary, leader_profile
from fleetloop.results.view import View

_COLUMNS, _PANEL_IN, _TITLE_IN, _POINTS = 4, 1.05, 0.3, 300
"""Of the figure of the laws' signals."""
_TRACK_POINTS = 800
PAPER, PAPERS_PARTS = "paper", ("robot", "graph", "path", "leader", "control", "coordination")
"""The shipped scenario that is the paper's experiment, and what makes it that."""


@dataclass(frozen=True, slots=True)
class Captioned:
    """A figure, its file name without extension, and its caption."""

    name: str
    caption: str
    figure: Figure


def all_figures(
    record: Record, scenario: Scenario, summary: Summary | None = None
) -> list[Captioned]:
    """Every figure of a run; the record holds at least one tick of a controller.

    Each robot is drawn up to its own end; an edge's difference while both its ends are there. With
    the run's summary, faults and events are marked on axes of time, and what was expected of errors
    is drawn.
    """
    view = None if summary is None else View(record, scenario, summary)
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        chosen = list(_FIGURES)
        if any(map(law_table, record.signals.values())):
            chosen.append(_LAW)
        if any(map(ages_of, record.controller.values())):
            chosen += _NETWORK
        if scenario.clock.mode == "realtime":
            chosen.append(_CLOCK)
        papers = is_papers(scenario)
        made = []
        for one in chosen:
            figure, caption = one.draw(record, scenario), one.caption_of(scenario, papers=papers)
            if view is not None and one.over_time and (words := mark(figure, view, one.signal)):
                caption = f"{caption} {words}"
            made.append(Captioned(one.name, caption, figure))
        return made


def is_papers(scenario: Scenario) -> bool:
    """Whether a scenario is the paper's experiment: its figures have the paper's numbers."""
    if scenario.name != PAPER:
        return False
    papers = load(PAPER)
    return all(getattr(scenario, part) == getattr(papers, part) for part in PAPERS_PARTS)


# --- the graph and the plane ----------------------------------------------------------------------


def graph(_: Record, scenario: Scenario) -> Figure:
    """The directed graph, arrows along the flow of information."""
    return drawn(scenario.topology, "")


def positions(record: Record, _: Scenario) -> Figure:
    """Tracks in the plane with the heading at regular times, over the reference paths."""
    figure, axes = axes_of(height_in=3.1)
    for n, robot in enumerate(record.robots):
        truth, used = record.plant[robot], record.controller[robot]
        if not len(truth):
            continue
        colour, dash = style_of(n)
        pick = stride(len(used), _TRACK_POINTS)
        x, y = drawable(used["x_d_m"][pick]), drawable(used["y_d_m"][pick])
        axes.plot(x, y, color="0.8", linewidth=2.4, zorder=1)
        pick = stride(len(truth), _TRACK_POINTS)
        x, y = drawable(truth["x_m"]), drawable(truth["y_m"])
        axes.plot(x[pick], y[pick], color=colour, linestyle=dash, label=robot)
        at = np.linspace(0, len(truth) - 1, 9).astype(int)
        heading = truth["theta_rad"][at]
        axes.quiver(
            x[at],
            y[at],
            np.cos(heading),
            np.sin(heading),
            color=colour,
            angles="xy",
            scale=20,
            width=0.008,
            zorder=3,
        )
        axes.plot(x[0], y[0], "o", color=colour, markersize=3.5)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="datalim")
    legend_above(figure, axes, len(record.robots))
    return figure


# --- over time ------------------------------------------------------------------------------------


def error_of(signal: str, symbol: str, unit: str) -> "Draw":
    """A figure of one path following error; below it the settled part at its own scale."""

    def draw(record: Record, _: Scenario) -> Figure:
        series = {robot: rows[signal] for robot, rows in record.controller.items()}
        return over_time(record, series, f"{symbol} [{unit}]", unit, zoom=True)

    return draw


def parameter_errors(record: Record, scenario: Scenario) -> Figure:
    """s_i − s_j for every edge j → i."""
    s = {robot: rows["s"] for robot, rows in record.controller.items()}
    series = {}
    for speaker, hearer in scenario.topology.edges:
        both = min(len(s[hearer]), len(s[speaker]))
        series[f"{hearer} − {speaker}"] = s[hearer][:both] - s[speaker][:both]
    return over_time(record, series, "s$_i$ − s$_j$ [m]", "m", zoom=True)


def path_variables(record: Record, _: Scenario) -> Figure:
    """The path variable of every robot."""
    series = {robot: rows["s"] for robot, rows in record.controller.items()}
    return over_time(record, series, "s [m]", "m")


def speed_estimates(record: Record, scenario: Scenario) -> Figure:
    """v̂_r of every robot and the leader's speed."""
    series = {robot: rows["v_r_hat"] for robot, rows in record.controller.items()}
    figure = over_time(record, series, "v̂$_r$ [m/s]", "m/s")
    axes = figure.axes[0]
    end = max(rows["t_s"][-1] for rows in record.controller.values() if len(rows))
    times_s, speeds = leader_profile(scenario, float(end))
    axes.plot(times_s, speeds, color="black", linewidth=0.7, label="leader v$_r$")
    low, high = axes.get_ylim()
    floor = FLOORS["m/s"]
    axes.set_ylim(min(low, float(speeds.min()) - floor), max(high, float(speeds.max()) + floor))
    for legend in figure.legends:
        legend.remove()
    legend_above(figure, axes, len(series) + 1)
    return figure


def torques(record: Record, _: Scenario) -> Figure:
    """Commanded wheel torques; large ones logarithmic beyond 1 N·m."""
    figure = Figure(figsize=(WIDTH_IN, 1.6 * HEIGHT_IN), dpi=DPI, layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    for axes, side in ((upper, "right"), (lower, "left")):
        for n, robot in enumerate(record.robots):
            rows = record.controller[robot]
            colour, dash = style_of(n)
            t, values = decimated(rows["t_s"], rows[f"tau_{side}_wheel_N_m"])
            axes.plot(t, values, color=colour, linestyle=dash, linewidth=0.8, label=robot)
        widen(axes, "N·m")
        torque_scale(axes)
        axes.set(ylabel=f"τ {side} [N·m]")
    lower.set_xlabel("t [s]")
    legend_above(figure, upper, len(record.robots))
    return figure


def law_signals(record: Record, _: Scenario) -> Figure:
    """What the laws record beside the errors (8): a panel for each signal, a line per robot."""
    units = {one.name: one.unit for table in record.signals.values() for one in law_table(table)}
    rows = -(-len(units) // _COLUMNS)
    height_in = _TITLE_IN + 0.25 + _PANEL_IN * rows
    figure = Figure(figsize=(PAGE_IN, height_in), dpi=DPI)
    figure.subplots_adjust(  # a computed layout of many panels takes long
        left=0.075,
        right=0.99,
        bottom=0.35 / height_in,
        top=1.0 - (_TITLE_IN + 0.15) / height_in,
        wspace=0.42,
        hspace=0.6,
    )
    panels = figure.subplots(rows, _COLUMNS, sharex=True, squeeze=False).ravel()
    for axes, (name, unit) in zip(panels, units.items(), strict=False):
        shown = []
        for n, robot in enumerate(record.robots):
            series = record.controller[robot]
            if name in (series.dtype.names or ()):
                colour, dash = style_of(n)
                t, values = decimated(series["t_s"], series[name], _POINTS)
                axes.plot(t, values, color=colour, linestyle=dash, linewidth=0.8, label=robot)
                shown.append(values)
        axes.set_ylim(span(shown, unit))
        axes.set_title(f"{name} [{unit}]", fontsize=7, pad=3, parse_math=False)
    for axes in panels[len(units) :]:
        axes.set_axis_off()
    for axes in panels[len(units) - _COLUMNS : len(units)]:
        axes.set_xlabel("t [s]", labelpad=1)
        axes.tick_params(labelbottom=True)
    lines = {
        str(line.get_label()): line for axes in panels[: len(units)] for line in axes.get_lines()
    }
    order = [robot for robot in record.robots if robot in lines]
    if len(order) <= MOST_LABELS:
        found = [lines[robot] for robot in order]
        figure.legend(found, order, loc="upper center", ncols=8, frameon=False, handlelength=2.4)
    return figure


def clock_figures(record: Record, _: Scenario) -> Figure:
    """Histograms of wake-up lateness and round trip of a real-time run."""
    figure = Figure(figsize=(WIDTH_IN, 1.8 * HEIGHT_IN), dpi=DPI, layout="constrained")
    panels = figure.subplots(2, 1)
    names = (("late_s", "wake-up lateness [µs]"), ("round_trip_s", "torque to feedback [µs]"))
    for axes, (signal, title) in zip(panels, names, strict=True):
        values = np.concatenate([rows[signal] for rows in record.controller.values()])
        values = np.clip(values[np.isfinite(values)] * 1e6, 1.0, 1e12)
        bins = np.geomspace(1.0, values.max(initial=10.0), 60)
        axes.hist(values, bins=bins, color=COLOURS[0])
        for share, dash in ((50, "-"), (99, "--"), (99.9, ":")) if len(values) else ():
            at = float(np.percentile(values, share))
            axes.axvline(at, color=COLOURS[1], linestyle=dash, label=f"p{share:g} {at:.0f} µs")
        axes.set(xscale="log", yscale="log", xlabel=title, ylabel="ticks")
        if len(values):
            axes.legend()
    return figure


Draw = Callable[[Record, Scenario], Figure]
ERRORS: Mapping[str, Draw] = {
    "x_e_m": error_of("x_e_m", "x$_e$", "m"),
    "y_e_m": error_of("y_e_m", "y$_e$", "m"),
    "theta_e_rad": error_of("theta_e_rad", "θ$_e$", "rad"),
}


class Drawing(NamedTuple):
    """A figure that can be drawn of a run."""

    name: str
    caption: str
    draw: Draw
    number: int | None = None
    """Of the paper's figure."""
    over_time: bool = True
    signal: str = ""
    """What is expected of it is drawn."""

    def caption_of(self, scenario: Scenario, *, papers: bool) -> str:
        """The caption, which names the scenario, and the paper's figure if it is its experiment."""
        number = f" (the paper's Figure {self.number})" if papers and self.number else ""
        return f"{self.caption}, scenario {scenario.name}{number}."


_FIGURES: Sequence[Drawing] = (
    Drawing(
        "graph", "The directed graph: arrows from sender to receiver", graph, 3, over_time=False
    ),
    Drawing(
        "positions",
        "Robot positions and orientations; dots: start; grey: reference",
        positions,
        4,
        over_time=False,
    ),
    Drawing("x_e", "Path following errors x_e", ERRORS["x_e_m"], 5, signal="x_e_m"),
    Drawing("y_e", "Path following errors y_e", ERRORS["y_e_m"], 6, signal="y_e_m"),
    Drawing("theta_e", "Path following errors θ_e", ERRORS["theta_e_rad"], 7, signal="theta_e_rad"),
    Drawing(
        "parameter_errors", "Path parameter errors s_i − s_j over the edges", parameter_errors, 8
    ),
    Drawing("path_variables", "Path variables s", path_variables),
    Drawing("speed_estimates", "Estimates of the reference speed, equation (38)", speed_estimates),
    Drawing("torques", "Commanded wheel torques, equation (34)", torques),
)
_LAW = Drawing("law_signals", "What the robots' laws record of themselves", law_signals)
_NETWORK = (
    Drawing("ages", "Age of the data that each edge gave, below the errors over the edges", ages),
    Drawing("edge_states", "Mean age of what came over each edge", edge_states, over_time=False),
)
_CLOCK = Drawing(
    "clock",
    "How the wall clock was kept: all ticks of all controllers",
    clock_figures,
    over_time=False,
)
