"""Figures of a run, as the paper shows them and a few more; matplotlib only, no files.

    fig3  the directed graph                     fig8  path parameter errors s_i − s_j over edges
    fig4  positions and orientations             s, v_r_hat, torques: what the fleet agreed on and
    fig5, fig6, fig7  x_e, y_e, θ_e                    what it cost
    law_signals  whatever else the laws record   clock  lateness and round trips, in real time
    ages, edge_states  age of the data of each edge, where it varies

Lines, colours and panels are `fleetloop.results.drawing`'s.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from configs.scenario import Scenario
from configs.signals import law_table
from fleetloop.record.reader import Record
from fleetloop.results.decimation import drawable, stride
from fleetloop.results.drawing import (
    COLOURS,
    DPI,
    HEIGHT_IN,
    WIDTH_IN,
    axes_of,
    envelope,
    legend,
    over_time,
    style_of,
)
from fleetloop.results.graph_drawing import drawn
from fleetloop.results.network import ages_of
from fleetloop.results.network_figures import ages, edge_states
from fleetloop.results.summary import leader_profile

_COLUMNS, _PANEL_IN, _TITLE_IN, _STRETCHES = 3, 1.1, 0.5, 300
"""Of the figure of the laws' signals."""
STYLE: Any = {
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.titlesize": 10,
    "lines.linewidth": 1.3,
    "legend.fontsize": 8,
    "legend.framealpha": 0.9,
}


@dataclass(frozen=True, slots=True)
class Captioned:
    """A figure, its file name without extension, and its caption."""

    name: str
    caption: str
    figure: Figure


def all_figures(record: Record, scenario: Scenario) -> list[Captioned]:
    """Every figure of a run; the record holds at least one tick of a controller.

    Each robot is drawn up to its own end; an edge's difference while both its ends are there.
    """
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        chosen = list(_FIGURES)
        if any(map(law_table, record.signals.values())):
            chosen.append(_LAW)
        if any(map(ages_of, record.controller.values())):
            chosen += _NETWORK
        if scenario.clock.mode == "realtime":
            chosen.append(_CLOCK)
        return [Captioned(name, caption, draw(record, scenario)) for name, caption, draw in chosen]


# --- the graph and the plane ----------------------------------------------------------------------


def graph(_: Record, scenario: Scenario) -> Figure:
    """The directed graph, arrows along the flow of information."""
    title = f"Directed graph of {scenario.name}: arrows from sender to receiver"
    return drawn(scenario.topology, title)


def positions(record: Record, _: Scenario) -> Figure:
    """Tracks in the plane with the heading at regular times, over the reference paths."""
    figure, axes = axes_of(height_in=4.6)
    for n, robot in enumerate(record.robots):
        truth, used = record.plant[robot], record.controller[robot]
        if not len(truth):
            continue
        colour, dash = style_of(n)
        pick = stride(len(used))
        x, y = drawable(used["x_d_m"][pick]), drawable(used["y_d_m"][pick])
        axes.plot(x, y, color="0.75", linewidth=2.6, zorder=1)
        pick = stride(len(truth))
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
            scale=26,
            width=0.005,
            zorder=3,
        )
        axes.plot(x[0], y[0], "o", color=colour, markersize=4)
    axes.plot([], [], color="0.75", linewidth=2.6, label="reference")
    axes.set(xlabel="x [m]", ylabel="y [m]", title="Positions and orientations; dots: start")
    axes.set_aspect("equal", adjustable="datalim")
    legend(axes, len(record.robots) + 1)
    return figure


# --- over time ------------------------------------------------------------------------------------


def error_of(signal: str, symbol: str, unit: str) -> "Draw":
    """A figure of one path following error; beside it the settled part at its own scale."""

    def draw(record: Record, _: Scenario) -> Figure:
        series = {robot: rows[signal] for robot, rows in record.controller.items()}
        return over_time(
            record, series, f"Path following error {symbol}", f"{symbol} [{unit}]", zoom=True
        )

    return draw


def parameter_errors(record: Record, scenario: Scenario) -> Figure:
    """s_i − s_j for every edge j → i."""
    s = {robot: rows["s"] for robot, rows in record.controller.items()}
    series = {}
    for speaker, hearer in scenario.topology.edges:
        both = min(len(s[hearer]), len(s[speaker]))
        series[f"{hearer} − {speaker}"] = s[hearer][:both] - s[speaker][:both]
    return over_time(record, series, "Path parameter errors", "s$_i$ − s$_j$ [m]", zoom=True)


def path_variables(record: Record, _: Scenario) -> Figure:
    """The path variable of every robot."""
    series = {robot: rows["s"] for robot, rows in record.controller.items()}
    return over_time(record, series, "Path variables", "s [m]")


def speed_estimates(record: Record, scenario: Scenario) -> Figure:
    """v̂_r of every robot and the leader's speed."""
    series = {robot: rows["v_r_hat"] for robot, rows in record.controller.items()}
    figure = over_time(record, series, "Estimates of the reference speed", "v̂$_r$ [m/s]")
    axes = figure.axes[0]
    end = max(rows["t_s"][-1] for rows in record.controller.values() if len(rows))
    profile = leader_profile(scenario, float(end))
    axes.plot(*profile, color="black", linewidth=0.8, label="leader v$_r$")
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.0), max(high, 1e-3))
    legend(axes, len(series) + 1)
    return figure


def torques(record: Record, _: Scenario) -> Figure:
    """Commanded wheel torques; linear near zero, logarithmic beyond 1 N·m."""
    figure = Figure(figsize=(WIDTH_IN, 5.0), dpi=DPI, layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    for axes, side in ((upper, "right"), (lower, "left")):
        for n, robot in enumerate(record.robots):
            rows = record.controller[robot]
            colour, dash = style_of(n)
            t, values = envelope(rows["t_s"], rows[f"tau_{side}_wheel_N_m"])
            axes.plot(t, values, color=colour, linestyle=dash, linewidth=1.0, label=robot)
        commanded = (np.abs(rows[f"tau_{side}_wheel_N_m"]) for rows in record.controller.values())
        peak = max(float(values.max(initial=0.0)) for values in commanded)
        if peak > 1.0:
            axes.set_yscale("symlog", linthresh=1.0, linscale=2.0)
        axes.set(ylabel=f"τ {side} [N·m]")
    upper.set_title("Commanded wheel torques")
    lower.set_xlabel("t [s]")
    legend(upper, len(record.robots))
    return figure


def law_signals(record: Record, _: Scenario) -> Figure:
    """What the laws record beside the errors (8): a panel for each signal, a line per robot."""
    units = {one.name: one.unit for table in record.signals.values() for one in law_table(table)}
    rows = -(-len(units) // _COLUMNS)
    height_in = _TITLE_IN + _PANEL_IN * rows
    figure = Figure(figsize=(WIDTH_IN, height_in), dpi=DPI)
    figure.subplots_adjust(  # a computed layout of many panels takes long
        left=0.09,
        right=0.88,
        bottom=0.3 / height_in,
        top=1.0 - 0.5 / height_in,
        wspace=0.4,
        hspace=0.6,
    )
    panels = figure.subplots(rows, _COLUMNS, sharex=True, squeeze=False).ravel()
    figure.suptitle("Signals of the laws, over t [s]", fontsize=10, y=1.0 - 0.1 / height_in)
    for axes, (name, unit) in zip(panels, units.items(), strict=False):
        for n, robot in enumerate(record.robots):
            series = record.controller[robot]
            if name in (series.dtype.names or ()):
                colour, dash = style_of(n)
                t, values = envelope(series["t_s"], series[name], _STRETCHES)
                axes.plot(t, values, color=colour, linestyle=dash, linewidth=0.8, label=robot)
        axes.set_title(f"{name} [{unit}]", fontsize=7, parse_math=False)
        axes.tick_params(labelsize=6)
    for axes in panels[len(units) :]:
        axes.set_axis_off()
    known = {
        str(line.get_label()): line for axes in panels[: len(units)] for line in axes.get_lines()
    }
    order = [robot for robot in record.robots if robot in known]
    figure.legend([known[robot] for robot in order], order, loc="upper right", fontsize=7)
    return figure


def clock_figures(record: Record, _: Scenario) -> Figure:
    """Histograms of wake-up lateness and round trip of a real-time run."""
    figure = Figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DPI, layout="constrained")
    panels = figure.subplots(1, 2)
    names = (("late_s", "wake-up lateness"), ("round_trip_s", "torque to feedback"))
    for axes, (signal, title) in zip(panels, names, strict=True):
        values = np.concatenate([rows[signal] for rows in record.controller.values()])
        values = np.clip(values[np.isfinite(values)] * 1e6, 1.0, 1e12)
        bins = np.geomspace(1.0, values.max(initial=10.0), 60)
        axes.hist(values, bins=bins, color=COLOURS[0])
        for share, dash in ((50, "-"), (99, "--"), (99.9, ":")) if len(values) else ():
            at = float(np.percentile(values, share))
            axes.axvline(at, color=COLOURS[1], linestyle=dash, label=f"p{share:g} {at:.0f} µs")
        axes.set(xscale="log", yscale="log", title=title, xlabel="µs", ylabel="ticks")
        if len(values):
            axes.legend(fontsize=7)
    return figure


Draw = Callable[[Record, Scenario], Figure]
ERRORS: Mapping[str, Draw] = {
    "x_e_m": error_of("x_e_m", "x$_e$", "m"),
    "y_e_m": error_of("y_e_m", "y$_e$", "m"),
    "theta_e_rad": error_of("theta_e_rad", "θ$_e$", "rad"),
}
_FIGURES: Sequence[tuple[str, str, Draw]] = (
    ("fig3_graph", "The directed graph (the paper's Figure 3).", graph),
    ("fig4_positions", "Robot positions and orientations (Figure 4).", positions),
    ("fig5_x_e", "Path following errors x_e (Figure 5).", ERRORS["x_e_m"]),
    ("fig6_y_e", "Path following errors y_e (Figure 6).", ERRORS["y_e_m"]),
    ("fig7_theta_e", "Path following errors θ_e (Figure 7).", ERRORS["theta_e_rad"]),
    (
        "fig8_parameter_errors",
        "Path parameter errors over the edges (Figure 8).",
        parameter_errors,
    ),
    ("path_variables", "Path variables s.", path_variables),
    ("speed_estimates", "Estimates of the reference speed, equation (38).", speed_estimates),
    ("torques", "Commanded wheel torques, equation (34).", torques),
)
_LAW = ("law_signals", "What the robots' laws record of themselves.", law_signals)
_NETWORK = (
    ("ages", "Age of the data that each edge gave, below the errors over the edges.", ages),
    ("edge_states", "Mean age of what came over each edge.", edge_states),
)
_CLOCK = ("clock", "How the wall clock was kept: all ticks of all controllers.", clock_figures)
