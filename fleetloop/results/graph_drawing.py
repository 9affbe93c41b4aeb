"""A drawing of a directed graph: layers by distance from the leader, weights that aren't 1."""

from collections import Counter
from collections.abc import Mapping
from math import hypot
from typing import NamedTuple

import networkx as nx
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from configs.edges import LEADER, Edge
from configs.graph import Graph

WIDTH_IN, UNIT_IN, DPI = 6.4, 0.95, 150
_MOST_IN = 40.0
_NODE_SIZE, _LEADER_SIZE = 620.0, 1200.0
"""Area of a node [points²]."""
_LABELLED = 120
"""With more edges their weights find no room."""
_BEND_BESIDE_OPPOSITE, _BEND_AROUND_NODE = 0.18, 0.4
"""How far an arrow bows out, in parts of its length."""

_SOMETIMES = "0.55"
"""Colour of an edge that comes and goes: a grey."""

Places = dict[str, tuple[float, float]]


class EdgeStyle(NamedTuple):
    """How an edge is drawn."""

    colour: str
    label: str


_NO_STYLES: Mapping[Edge, EdgeStyle] = {}


def drawn(graph: Graph, title: str, styles: Mapping[Edge, EdgeStyle] = _NO_STYLES) -> Figure:
    """The graph as a figure.

    Edges without a style are black, or grey if they come and go, with their weight if it isn't 1.
    """
    digraph = graph.digraph()
    sometimes = {edge for edge, windows in graph.windows.items() if windows is not None}
    if not graph.links:
        digraph.remove_node(LEADER)
    places = _places(digraph, graph)
    across = [x for x, _ in places.values()]
    up = [y for _, y in places.values()]
    figure = Figure(
        figsize=(
            min(max(WIDTH_IN, UNIT_IN * (max(across) - min(across) + 1.2)), _MOST_IN),
            min(0.4 + UNIT_IN * (max(up) - min(up) + 1.2), _MOST_IN),
        ),
        dpi=DPI,
        layout="constrained",
    )
    axes = figure.add_subplot()
    axes.set_title(f"{title}; grey: not always" if sometimes and not styles else title, fontsize=10)
    axes.set_axis_off()
    axes.set_aspect("equal")  # so that weights lie on their bowed arrows
    for kind in ("robots", "leader"):
        nodes = [node for node in digraph if (node == LEADER) == (kind == "leader")]
        nx.draw_networkx_nodes(
            digraph,
            places,
            nodelist=nodes,
            ax=axes,
            node_size=_LEADER_SIZE if kind == "leader" else _NODE_SIZE,
            edgecolors="black",
            node_color="#dddddd" if kind == "leader" else "white",
            node_shape="s" if kind == "leader" else "o",
        )
    nx.draw_networkx_labels(digraph, places, ax=axes, font_size=8)
    for edge in digraph.edges:
        weight = digraph.edges[edge]["weight"]
        colour = _SOMETIMES if edge in sometimes else "black"
        plain = EdgeStyle(colour, "" if weight == 1.0 else f"{weight:.3g}")
        colour, label = styles.get(edge, plain)
        style = EdgeStyle(colour, label if digraph.size() <= _LABELLED else "")
        _arrow(axes, digraph, edge, places, style)
    axes.set_xlim(min(across) - 0.6, max(across) + 0.6)
    axes.set_ylim(min(up) - 0.6, max(up) + 0.6)
    return figure


def _places(digraph: "nx.DiGraph", graph: Graph) -> Places:
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
        places[node] = (1.5 * layer, 0.5 * (size[layer] - 1) - row[layer] - lower)
        row[layer] += 1
    return places


def _arrow(axes: Axes, digraph: "nx.DiGraph", edge: Edge, places: Places, style: EdgeStyle) -> None:
    """One edge; bowed where a straight one would cross a node or lie on its opposite."""
    speaker, hearer = edge
    bend = _BEND_BESIDE_OPPOSITE if digraph.has_edge(hearer, speaker) else 0.0
    if _crosses(edge, places):
        bend = _BEND_AROUND_NODE
    axes.annotate(
        "",
        xy=places[hearer],
        xytext=places[speaker],
        arrowprops={
            "arrowstyle": "-|>,head_width=0.25,head_length=0.5",
            "linestyle": "dashed" if speaker == LEADER else "solid",
            "color": style.colour,
            "linewidth": 1.1,
            "shrinkA": 18 if speaker == LEADER else 13,
            "shrinkB": 13,
            "connectionstyle": f"arc3,rad={bend}",
        },
    )
    if style.label:
        (x0, y0), (x1, y1) = places[speaker], places[hearer]
        # A third of the way, on the bow: where opposite arrows or crossing ones are apart.
        part = 0.4
        bow = 2.0 * part * (1.0 - part) * bend
        x, y = x0 + part * (x1 - x0) + bow * (y1 - y0), y0 + part * (y1 - y0) - bow * (x1 - x0)
        box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"}
        axes.text(x, y, style.label, fontsize=7, ha="center", va="center", bbox=box)


def _crosses(edge: Edge, places: Places) -> bool:
    """Whether another node lies on the straight line of an edge."""
    (x0, y0), (x1, y1) = places[edge[0]], places[edge[1]]
    along_x, along_y = x1 - x0, y1 - y0
    length = hypot(along_x, along_y)
    for node, (x, y) in places.items():
        if node in edge or not length:
            continue
        part = ((x - x0) * along_x + (y - y0) * along_y) / length**2
        apart = abs((x - x0) * along_y - (y - y0) * along_x) / length
        if 0.0 < part < 1.0 and apart < 0.3:
            return True
    return False
