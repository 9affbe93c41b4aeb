"""Figures of the network: ages of data per edge over time, and the graph with what they came to."""

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import Normalize, to_hex
from matplotlib.figure import Figure

from configs.edges import Edge
from configs.netem import LOCALISATION
from configs.scenario import Scenario
from fleetloop.record.reader import Record
from fleetloop.results.decimation import decimated
from fleetloop.results.drawing import DPI, WIDTH_IN, style_of, widen
from fleetloop.results.graph_drawing import EdgeStyle, drawn
from fleetloop.results.network import ages_of

_MAP = colormaps["cividis"]
COLUMNS = 600
"""Of a strip."""
_MOST_LABELS, _MOST_IN_LEGEND = 40, 12
_ROW_IN = 0.16


def edge_ages(record: Record) -> dict[Edge, np.ndarray]:
    """Ages of what came over every edge whose ages are recorded [s], over the ticks."""
    return {
        (speaker, hearer): ages
        for hearer, rows in record.controller.items()
        for speaker, ages in ages_of(rows).items()
    }


def ages(record: Record, _: Scenario) -> Figure:
    """Differences over the edges, and below them the age of the data that each edge gave."""
    edges = edge_ages(record)
    strip_in = max(_ROW_IN * len(edges), 0.8)
    figure = Figure(figsize=(WIDTH_IN, 1.9 + strip_in), dpi=DPI, layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, strip_in))
    s = {robot: rows["s"] for robot, rows in record.controller.items()}
    t = max((rows["t_s"] for rows in record.controller.values()), key=len)
    between_robots = [edge for edge in edges if edge[0] in s]
    for n, (speaker, hearer) in enumerate(between_robots):
        both = min(len(s[hearer]), len(s[speaker]))
        colour, dash = style_of(n)
        x, y = decimated(t[:both], s[hearer][:both] - s[speaker][:both])
        upper.plot(x, y, color=colour, linestyle=dash, label=f"{hearer} − {speaker}")
    widen(upper, "m")
    upper.set(ylabel="s$_i$ − s$_j$ [m]")
    if 0 < len(between_robots) <= _MOST_IN_LEGEND:
        upper.legend(fontsize=6 + (len(between_robots) < 6))
    strips = np.array([oldest(ages, len(t)) for ages in edges.values()])
    image = lower.imshow(
        np.ma.masked_invalid(strips),
        aspect="auto",
        interpolation="nearest",
        cmap=_MAP,
        vmin=0.0,
        extent=(float(t[0]), float(t[-1]), len(edges) - 0.5, -0.5),
    )
    lower.set_facecolor("white")
    lower.grid(visible=False)
    every = -(-len(edges) // _MOST_LABELS)
    names = [f"{speaker} → {hearer}" for speaker, hearer in edges]
    lower.set_yticks(range(0, len(edges), every), names[::every], fontsize=7)
    lower.set_xlabel("t [s]")
    figure.colorbar(image, ax=lower, label="age [s]")
    return figure


def oldest(values: np.ndarray, ticks: int) -> np.ndarray:
    """The oldest age in each of at most `COLUMNS` stretches of the run; NaN: nothing heard."""
    padded = np.full(ticks, np.nan)
    padded[: len(values)] = values
    stretch = -(-ticks // COLUMNS)
    columns = np.full(-(-ticks // stretch) * stretch, np.nan)
    columns[:ticks] = padded
    blocks = columns.reshape(-1, stretch)
    heard = np.isfinite(blocks)
    oldest = np.where(heard, blocks, -np.inf).max(axis=1)
    return np.where(heard.any(axis=1), oldest, np.nan)


def edge_states(record: Record, scenario: Scenario) -> Figure:
    """The graph; an arrow's colour and label are the mean age of what came over it."""
    means = {
        edge: float(np.nanmean(values)) if np.isfinite(values).any() else np.nan
        for edge, values in edge_ages(record).items()
        if edge[0] != LOCALISATION
    }
    known = [mean for mean in means.values() if np.isfinite(mean)]
    oldest_mean = max(known, default=0.0)
    # In real time a message may be dated ahead of the clock of its hearer.
    scale = Normalize(0.0, oldest_mean if oldest_mean > 0.0 else 1.0)
    styles = {
        edge: EdgeStyle(to_hex(_MAP(0.85 * scale(mean))), f"{mean:.3g} s")
        if np.isfinite(mean)
        else EdgeStyle("#bbbbbb", "silent")
        for edge, mean in means.items()
    }
    return drawn(scenario.topology, "", styles)
