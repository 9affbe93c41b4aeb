"""Figures of several runs over each other: a colour and a dash pattern per run.

Up to `PANELS` robots have a panel each; of more, a band per run covers all its robots.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fleetloop.record.reader import Record
from fleetloop.results.decimation import decimated, drawable, stride
from fleetloop.results.derived import spread
from fleetloop.results.drawing import (
    DPI,
    PAGE_IN,
    STYLE,
    legend_above,
    style_of,
    torque_scale,
    widen,
)
from fleetloop.results.figures import Captioned
from fleetloop.results.known import Known
from fleetloop.results.panel import logarithmic_span

PANELS = 4
_WIDTH_IN = PAGE_IN
_HEIGHT_IN = 1.8
_STRETCHES = 600


class Signal(NamedTuple):
    """One that is drawn of every robot."""

    name: str
    symbol: str
    unit: str
    caption: str


SIGNALS = (
    Signal("x_e_m", "x$_e$", "m", "Path following errors x_e."),
    Signal("y_e_m", "y$_e$", "m", "Path following errors y_e."),
    Signal("theta_e_rad", "θ$_e$", "rad", "Path following errors θ_e."),
    Signal("v_r_hat", "v̂$_r$", "m/s", "Estimates of the reference speed."),
    Signal("tau_right_wheel_N_m", "τ right", "N·m", "Commanded torques, right wheels."),
    Signal("tau_left_wheel_N_m", "τ left", "N·m", "Commanded torques, left wheels."),
)


def overlay_figures(runs: Mapping[str, Known]) -> list[Captioned]:
    """The figures of runs by their labels."""
    runs = {_plain(label): run for label, run in runs.items()}
    records = {label: run.record for label, run in runs.items()}
    with mpl.rc_context(STYLE), np.errstate(all="ignore"):
        return [
            Captioned("positions", "Tracks of all robots; dots: start.", _positions(records)),
            Captioned("spread", "Spread of the path variables, max s − min s.", _spreads(runs)),
            *(Captioned(one.name, one.caption, _signal(one, records)) for one in SIGNALS),
        ]


def _plain(label: str) -> str:
    """A name of a user's as a label that is drawn as it stands: no formula, and never left out."""
    text = label.replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text


def robots_of(records: Mapping[str, Record]) -> tuple[str, ...]:
    """Every robot of any run."""
    return tuple(dict.fromkeys(robot for one in records.values() for robot in one.robots))


def _positions(records: Mapping[str, Record]) -> Figure:
    figure = Figure(figsize=(_WIDTH_IN, 3.6), dpi=DPI, layout="constrained")
    axes = figure.subplots()
    for n, (label, record) in enumerate(records.items()):
        colour, dash = style_of(n)
        shown = label
        for rows in record.plant.values():
            if not len(rows):
                continue
            x, y = drawable(rows["x_m"]), drawable(rows["y_m"])
            pick = stride(len(rows))
            axes.plot(x[pick], y[pick], color=colour, linestyle=dash, label=shown, alpha=0.9)
            axes.plot(x[0], y[0], "o", color=colour, markersize=4)
            shown = "_"
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="datalim")
    legend_above(figure, axes, len(records))
    return figure


def _spreads(runs: Mapping[str, Known]) -> Figure:
    figure = Figure(figsize=(_WIDTH_IN, 2.2), dpi=DPI, layout="constrained")
    axes = figure.subplots()
    drawn: list[np.ndarray] = []
    for n, (label, run) in enumerate(runs.items()):
        colour, dash = style_of(n)
        values = spread(run.record.controller, run.scenario.members)
        t = next(iter(run.record.controller.values()))["t_s"][: len(values)]
        x, y = decimated(t, np.where(values > 0.0, values, np.nan))
        axes.plot(x, y, color=colour, linestyle=dash, label=label)
        drawn.append(y)
    axes.set(xlabel="t [s]", ylabel="max s − min s [m]", yscale="log")
    axes.set_ylim(logarithmic_span(drawn, "m"))
    legend_above(figure, axes, len(runs))
    return figure


def _signal(signal: Signal, records: Mapping[str, Record]) -> Figure:
    robots = robots_of(records)
    if len(robots) > PANELS:
        figure = Figure(figsize=(_WIDTH_IN, 1.5 * _HEIGHT_IN), dpi=DPI, layout="constrained")
        axes = figure.subplots()
        for n, (label, record) in enumerate(records.items()):
            _band(axes, signal.name, record, label, n)
        axes.set(title="all robots", xlabel="t [s]")
        panels: Sequence[Axes] = [axes]
    else:
        columns = min(len(robots), 2)
        rows = -(-len(robots) // columns)
        size = (_WIDTH_IN, 0.4 + _HEIGHT_IN * rows)
        figure = Figure(figsize=size, dpi=DPI, layout="constrained")
        grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
        panels = grid.ravel().tolist()
        for axes, robot in zip(panels, robots, strict=False):
            axes.set_title(robot)
            _lines(axes, signal.name, records, robot)
        for axes in panels[len(robots) :]:
            axes.set_axis_off()
        for axes in panels[: len(robots)][-columns:]:  # the lowest of its column
            axes.set_xlabel("t [s]")
            axes.tick_params(labelbottom=True)
    for axes in panels:
        axes.set_ylabel(f"{signal.symbol} [{signal.unit}]")
        widen(axes, signal.unit)
        if signal.unit == "N·m":
            torque_scale(axes)
    handles = {
        str(item.get_label()): item
        for axes in panels
        for item in axes.get_legend_handles_labels()[0]
    }
    figure.legend(list(handles.values()), list(handles), loc="outside upper left", ncols=4)
    return figure


def _lines(axes: Axes, name: str, records: Mapping[str, Record], robot: str) -> None:
    for n, (label, record) in enumerate(records.items()):
        rows = record.controller.get(robot)
        if rows is not None and len(rows) and name in (rows.dtype.names or ()):
            colour, dash = style_of(n)
            t, values = decimated(rows["t_s"], rows[name], _STRETCHES)
            axes.plot(t, values, color=colour, linestyle=dash, label=label)


def _band(axes: Axes, name: str, record: Record, label: str, n: int) -> None:
    """From the least to the greatest of all robots of a run that have a row at a tick."""
    colour, dash = style_of(n)
    longest = max(record.controller.values(), key=len)
    table = np.full((len(record.controller), len(longest)), np.nan)
    for line, rows in zip(table, record.controller.values(), strict=True):
        if name in (rows.dtype.names or ()):
            line[: len(rows)] = drawable(rows[name])
    step = max(1, len(longest) // _STRETCHES)
    count = len(longest) // step
    blocks = table[:, : count * step].reshape(len(table), count, step)
    there = ~np.isnan(blocks)
    low = np.where(there, blocks, np.inf).min(axis=(0, 2))
    high = np.where(there, blocks, -np.inf).max(axis=(0, 2))
    known = there.any(axis=(0, 2))
    t = longest["t_s"][: count * step : step][known]
    axes.fill_between(t, low[known], high[known], color=colour, alpha=0.25, linewidth=0)
    for edge, text in ((low, label), (high, "_")):
        axes.plot(t, edge[known], color=colour, linestyle=dash, linewidth=0.9, label=text)
