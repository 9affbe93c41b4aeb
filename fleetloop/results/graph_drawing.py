"""A drawing of a directed graph: layers by distance from the leader, weights that aren't 1.

No edge runs behind a node: one that would is bowed around it; where bows don't help, the nodes
stand on a circle, which no straight edge crosses at another node. Lengths are in units of the
layout: a node has the radius `NODE`, and neighbours in a layer are 1 apart.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from math import copysign, cos, hypot, pi, sin
from typing import NamedTuple

import networkx as nx
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from configs.edges import LEADER, Edge
from configs.graph import Graph
from fleetloop.results.drawing import DPI, PAGE_IN, WIDTH_IN

NODE, LEADER_NODE = 0.19, 0.27
"""Radius of a robot, and half the side of the leader's square."""
CLEAR = 0.05
"""Between an edge and a node that isn't at its end."""
_UNIT_IN, _LEAST_UNIT_IN, _MOST_IN = 0.8, 0.5, 40.0
_POINTS_PER_IN = 72.0
_LABELLED = 120
"""With more edges their weights find no room."""
_LABEL_PT = 7.0
_PARTS = (0.4, 0.5, 0.6, 0.3, 0.7)
"""Of an edge, where its label may be; not the middle first, where crossing ones meet."""
_SEARCHED = 1500
"""With more edges they stay straight: no drawing of them is read."""
_OPPOSITE = 0.18
_BENDS = (0.0, 0.18, -0.18, 0.3, -0.3, 0.45, -0.45, 0.6, -0.6, 0.8, -0.8)
"""How far an arrow bows out, in parts of its length: the first that is clear."""
_STEPS = np.linspace(0.0, 1.0, 41)
_SOMETIMES = "0.55"
"""Colour of an edge that comes and goes: a grey."""

Place = tuple[float, float]
Places = dict[str, Place]


class EdgeStyle(NamedTuple):
    """How an edge is drawn."""

    colour: str
    label: str


class Bow(NamedTuple):
    """How far an edge bows out, and its least distance from any other node's rim."""

    bend: float
    clearance: float


_NO_STYLES: Mapping[Edge, EdgeStyle] = {}


def drawn(graph: Graph, title: str, styles: Mapping[Edge, EdgeStyle] = _NO_STYLES) -> Figure:
    """The graph as a figure, without a title if that is empty.

    Edges without a style are black, or grey if they come and go, with their weight if it isn't 1.
    """
    digraph = graph.digraph()
    sometimes = {edge for edge, windows in graph.windows.items() if windows is not None}
    if not graph.links:
        digraph.remove_node(LEADER)
    places, bows = laid_out(digraph, graph)
    across = [x for x, _ in places.values()]
    up = [y for _, y in places.values()]
    width, height = max(across) - min(across) + 1.0, max(up) - min(up) + 1.0
    unit_in = _unit_in(width)
    figure = Figure(
        figsize=(max(width * unit_in, WIDTH_IN), height * unit_in + (0.3 if title else 0.0)),
        dpi=DPI,
    )
    axes = figure.add_axes((0.0, 0.0, 1.0, height * unit_in / figure.get_figheight()))
    if title:
        grey = "; grey: not always" if sometimes and not styles else ""
        axes.set_title(f"{title}{grey}")
    axes.set_axis_off()
    axes.set_aspect("equal")  # so that weights lie on their bowed arrows
    axes.set_xlim(min(across) - 0.5, max(across) + 0.5)
    axes.set_ylim(min(up) - 0.5, max(up) + 0.5)
    _nodes(axes, digraph, places, unit_in)
    placed: list[Place] = []
    # Opposite ones first: their labels have less choice.
    for edge in sorted(digraph.edges, key=lambda edge: edge[::-1] not in digraph.edges):
        weight = digraph.edges[edge]["weight"]
        colour = _SOMETIMES if edge in sometimes else "black"
        plain = EdgeStyle(colour, "" if weight == 1.0 else f"{weight:.3g}")
        colour, label = styles.get(edge, plain)
        bend = bows[edge].bend
        _arrow(axes, edge, places, bend, colour, unit_in)
        if label and digraph.size() <= _LABELLED:
            beside = edge[::-1] in digraph.edges
            _label(axes, edge, places, bend, label, unit_in, placed, beside=beside)
    return figure


def laid_out(digraph: "nx.DiGraph", graph: Graph) -> tuple[Places, dict[Edge, Bow]]:
    """Places of the nodes and bows of the edges; in layers, on a circle if that is clearer."""
    places = _layers(digraph, graph)
    bows = dict(_bows(digraph, places))
    if _least(bows) >= 0.0 or digraph.size() > _SEARCHED:
        return places, bows
    circle = _circle(digraph)
    on_circle = dict(_bows(digraph, circle))
    return (circle, on_circle) if _least(on_circle) > _least(bows) else (places, bows)


def _least(bows: Mapping[Edge, Bow]) -> float:
    return min((bow.clearance for bow in bows.values()), default=0.0)


def _unit_in(width: float) -> float:
    """Inches per unit: a column if that is legible, else a page's width, else what it takes."""
    for column_in in (WIDTH_IN, PAGE_IN):
        if width * _LEAST_UNIT_IN <= column_in:
            return min(_UNIT_IN, column_in / width)
    return min(_LEAST_UNIT_IN, _MOST_IN / width)


def _nodes(axes: Axes, digraph: "nx.DiGraph", places: Places, unit_in: float) -> None:
    for kind, radius, shape in (("robots", NODE, "o"), ("leader", LEADER_NODE, "s")):
        nodes = [node for node in digraph if (node == LEADER) == (kind == "leader")]
        nx.draw_networkx_nodes(
            digraph,
            places,
            nodelist=nodes,
            ax=axes,
            node_size=(2.0 * radius * unit_in * _POINTS_PER_IN) ** 2,
            edgecolors="black",
            linewidths=0.8,
            node_color="#dddddd" if kind == "leader" else "white",
            node_shape=shape,
        )
    nx.draw_networkx_labels(digraph, places, ax=axes, font_size=7)


def _layers(digraph: "nx.DiGraph", graph: Graph) -> Places:
    """Layers from left to right by hops from the leader; unreached robots in the last."""
    start = [LEADER] if graph.links else list(graph.roots()[:1] or graph.robots[:1])
    hops = nx.multi_source_dijkstra_path_length(digraph, set(start), weight=lambda *_: 1)
    last = max(hops.values()) + 1
    layers = {node: int(hops.get(node, last)) for node in digraph}
    size = Counter(layers.values())
    widest = max(size.values())
    row: Counter[int] = Counter()
    places: Places = {}
    for node in digraph:
        layer = layers[node]
        # Every second layer a little lower: an arrow over two layers then misses what is between.
        lower = 0.25 * (layer % 2) * (widest > 1)
        places[node] = (1.3 * layer, 0.5 * (size[layer] - 1) - row[layer] - lower)
        row[layer] += 1
    return places


def _circle(digraph: "nx.DiGraph") -> Places:
    """All nodes on a circle, the first one on the left; at least 1 apart along it."""
    count = len(digraph)
    # A straight edge over one node passes it at about π / count of their distance.
    apart = max(1.0, (NODE + 2.0 * CLEAR) * count / pi)
    radius = apart * count / (2.0 * pi)
    angles = (pi - 2.0 * pi * n / count for n in range(count))
    return {
        node: (radius * cos(angle), radius * sin(angle))
        for node, angle in zip(digraph, angles, strict=True)
    }


def _bows(digraph: "nx.DiGraph", places: Places) -> Iterator[tuple[Edge, Bow]]:
    nodes = list(places)
    points = np.array([places[node] for node in nodes])
    radii = np.array([LEADER_NODE * 1.42 if node == LEADER else NODE for node in nodes])
    for edge in digraph.edges:
        speaker, hearer = edge
        others = np.array([node not in edge for node in nodes])
        opposite = digraph.has_edge(hearer, speaker)
        # The bow of an opposite one lies on its own left, so both are apart.
        bends = [bend for bend in _BENDS if bend >= _OPPOSITE or not opposite]
        if digraph.size() > _SEARCHED or not others.any():
            yield edge, Bow(bends[0], np.inf)
            continue
        ends = np.array([places[speaker], places[hearer]])
        found = []
        for bend in bends:
            apart = _distances(ends, bend, points[others])
            found.append(Bow(bend, float((apart - radii[others]).min())))
            if found[-1].clearance >= CLEAR:
                break
        yield edge, found[-1] if found[-1].clearance >= CLEAR else max(found, key=_clearance)


def _clearance(bow: Bow) -> float:
    return bow.clearance


def _distances(ends: np.ndarray, bend: float, points: np.ndarray) -> np.ndarray:
    """Least distance of each point from a bowed edge: matplotlib's arc3, a quadratic Bézier."""
    (x0, y0), (x1, y1) = ends
    middle = np.array([0.5 * (x0 + x1) + bend * (y1 - y0), 0.5 * (y0 + y1) - bend * (x1 - x0)])
    u = _STEPS[:, None]
    curve = (1.0 - u) ** 2 * ends[0] + 2.0 * u * (1.0 - u) * middle + u**2 * ends[1]
    apart = np.hypot(*(curve[:, None, :] - points[None, :, :]).transpose(2, 0, 1))
    least: np.ndarray = apart.min(axis=0)
    return least


def _arrow(
    axes: Axes, edge: Edge, places: Places, bend: float, colour: str, unit_in: float
) -> None:
    """One edge."""
    speaker, hearer = edge
    to_points = unit_in * _POINTS_PER_IN

    def rim(node: str) -> float:
        return (LEADER_NODE if node == LEADER else NODE) * to_points + 1.0

    axes.annotate(
        "",
        xy=places[hearer],
        xytext=places[speaker],
        arrowprops={
            "arrowstyle": "-|>,head_width=0.18,head_length=0.36",
            "linestyle": "dashed" if speaker == LEADER else "solid",
            "color": colour,
            "linewidth": 0.9,
            "shrinkA": rim(speaker),
            "shrinkB": rim(hearer),
            "connectionstyle": f"arc3,rad={bend}",
        },
    )


def _label(
    axes: Axes,
    edge: Edge,
    places: Places,
    bend: float,
    text: str,
    unit_in: float,
    placed: list[Place],
    *,
    beside: bool,
) -> None:
    """The label of an edge, where it covers no other: on the bow, of opposite ones outside it."""
    (x0, y0), (x1, y1) = places[edge[0]], places[edge[1]]
    along_x, along_y = x1 - x0, y1 - y0
    length = hypot(along_x, along_y)
    if not length:
        return
    to_points = unit_in * _POINTS_PER_IN
    half = (
        (0.26 * _LABEL_PT * len(text) + 1.0) / to_points,
        (0.5 * _LABEL_PT + 1.0) / to_points,
    )
    out_x, out_y = along_y / length, -along_x / length
    away = copysign(hypot(out_x * half[0], out_y * half[1]), bend) if beside else 0.0

    def at(part: float) -> Place:
        bow = 2.0 * part * (1.0 - part) * bend
        return (
            x0 + part * along_x + bow * along_y + away * out_x,
            y0 + part * along_y - bow * along_x + away * out_y,
        )

    def is_free(x: float, y: float) -> bool:
        return all(abs(x - u) > 2.0 * half[0] or abs(y - v) > 2.0 * half[1] for u, v in placed)

    candidates = [at(part) for part in _PARTS]
    x, y = next((one for one in candidates if is_free(*one)), candidates[0])
    placed.append((x, y))
    box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"}
    axes.text(x, y, text, fontsize=_LABEL_PT, ha="center", va="center", bbox=box)
