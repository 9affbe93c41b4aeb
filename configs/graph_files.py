"""Graphs as files of other programs: GraphML (yEd, NetworkX, Gephi) and DOT (Graphviz).

A node is a robot by its name, the node `leader` the virtual leader; an edge points along the flow
of information, its `weight` (in yEd also its label) is a_ij, from the leader h_i, 1 without one. In
GraphML a node's label, which yEd shows, goes before its identifier. Edges of an undirected graph
run both ways.
"""

import io
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import ParseError

import networkx as nx
import pydot

from configs.edges import LEADER, LEAST_WEIGHT, MOST_WEIGHT, Edge, edge_text
from configs.errors import ScenarioError
from configs.files import text_of
from configs.graph import Graph

GRAPHML, DOT = ".graphml", ".dot"
MOST_KIB = {GRAPHML: 1 << 14, DOT: 1 << 7}
"""Of a file: GraphML of 256 robots that all hear each other; DOT is read a hundred times slower."""
_NO_NODES = ("graph", "node", "edge", "\\n", "\\r\\n")
"""Names of the DOT parser that stand for defaults and line ends."""


class EdgeList(NamedTuple):
    """What a file says of a graph."""

    weights: dict[Edge, float]  # of the edges between robots, in the order of the file
    links: dict[str, float]  # of the leader's, by robot; empty: the file has none


def to_graphml(graph: Graph) -> str:
    """A graph as GraphML text."""
    return "\n".join(nx.generate_graphml(graph.digraph())) + "\n"


def to_dot(graph: Graph, name: str) -> str:
    """A graph as DOT text for Graphviz; weights that aren't 1 are shown."""
    lines = [f'digraph "{name}" {{', "  rankdir=LR;", f"  {LEADER} [shape=box];"]
    for speaker, hearer, weight in graph.digraph().edges(data="weight"):
        given = [f'weight={weight:g}, label="{weight:g}"'] if weight != 1.0 else []
        given += ["style=dashed"] if speaker == LEADER else []
        attributes = f" [{', '.join(given)}]" if given else ""
        lines.append(f"  {speaker} -> {hearer}{attributes};")
    lines += [f"  {robot};" for robot in graph.robots]
    return "\n".join([*lines, "}", ""])


def read_graph(path: Path, robots: Sequence[str]) -> EdgeList:
    """The edges of a graph file between these robots.

    Raises:
        ScenarioError: the file can't be read, is too large, is no such file, or says something that
            isn't a graph of these robots; the text names the file and what.
    """
    kind = DOT if path.suffix == ".gv" else path.suffix
    if kind not in MOST_KIB:
        raise ScenarioError(f"{path}: must be a file .graphml, .dot or .gv")
    text = text_of(path, "graph.file", MOST_KIB[kind] << 10)
    digraph = _graphml(path, text) if kind == GRAPHML else _dot(path, text)
    weights: dict[Edge, float] = {}
    for speaker, hearer, data in digraph.edges(data=True):
        edge = speaker, hearer
        _check_edge(path, edge, robots)
        if edge in weights:
            raise ScenarioError(f"{path}: edge {edge_text(edge)}: is there twice")
        weights[edge] = _weight(path, edge, data)
    unknown = [node for node in digraph if node not in (LEADER, *robots)]
    if unknown:
        raise ScenarioError(f"{path}: node {unknown[0]}: {_known(robots)}")
    links = {hearer: h for (speaker, hearer), h in weights.items() if speaker == LEADER}
    return EdgeList({edge: a for edge, a in weights.items() if edge[0] != LEADER}, links)


def _known(robots: Sequence[str]) -> str:
    return f"no such robot; known: {', '.join(robots)}, and {LEADER}"


def _check_edge(path: Path, edge: Edge, robots: Sequence[str]) -> None:
    speaker, hearer = edge
    remedy = ""
    if unknown := [node for node in edge if node not in (LEADER, *robots)]:
        remedy = f"{unknown[0]}: {_known(robots)}"
    elif hearer == LEADER:
        remedy = "the virtual leader hears nobody"
    elif speaker == hearer:
        remedy = "a robot doesn't hear itself"
    if remedy:
        raise ScenarioError(f"{path}: edge {edge_text(edge)}: {remedy}")


def _weight(path: Path, edge: Edge, data: dict[str, Any]) -> float:
    given = data.get("weight", data.get("label"))
    if given is None or given == "":
        return 1.0
    try:
        weight = float(given)
    except (TypeError, ValueError):
        weight = 0.0
    if not LEAST_WEIGHT <= weight <= MOST_WEIGHT:
        remedy = f"must be a number from {LEAST_WEIGHT:g} to {MOST_WEIGHT:g}"
        raise ScenarioError(f"{path}: edge {edge_text(edge)}: weight = {given!r}: {remedy}")
    return weight


def _graphml(path: Path, text: str) -> "nx.MultiDiGraph":
    if "<!ENTITY" in text:  # a few of them may stand for gigabytes
        raise ScenarioError(f"{path}: not read: declares entities, which no graph needs")
    try:
        found = nx.parse_graphml(text, force_multigraph=True)
    except ParseError as error:
        raise ScenarioError(f"{path}: not a GraphML file: {error}") from error
    except (nx.NetworkXException, ValueError, KeyError, AttributeError, TypeError) as error:
        raise ScenarioError(f"{path}: not a graph in GraphML: {error}") from error
    labels = {node: str(label) for node, label in found.nodes(data="label") if label}
    names = {node: labels.get(node, str(node)).strip() for node in found}
    if len(set(names.values())) < len(names):
        twice = next(name for name in names.values() if list(names.values()).count(name) > 1)
        raise ScenarioError(f"{path}: node {twice}: two nodes have this label; make it unique")
    return nx.relabel_nodes(nx.MultiDiGraph(found), names)


def _dot(path: Path, text: str) -> "nx.MultiDiGraph":
    said = io.StringIO()  # pydot prints what it has against a text
    try:
        with redirect_stdout(said):
            graphs = pydot.graph_from_dot_data(text)
    except RecursionError as error:
        raise ScenarioError(f"{path}: not a DOT file: nested too deeply") from error
    if not graphs:
        why = said.getvalue().strip().rpartition("\n")[2] or "it holds no graph"
        raise ScenarioError(f"{path}: not a DOT file: {why}")
    if len(graphs) > 1:
        raise ScenarioError(f"{path}: holds {len(graphs)} graphs; must be one")
    plain = nx.MultiDiGraph()
    _add(plain, graphs[0], {}, both_ways=graphs[0].get_type() == "graph")
    return plain


def _add(to: "nx.MultiDiGraph", graph: Any, defaults: dict[str, str], *, both_ways: bool) -> None:
    """Add the nodes and edges of a DOT graph and of its subgraphs."""
    for given in graph.get_edge_defaults():
        defaults = defaults | given
    to.add_nodes_from(
        _plain(node.get_name()) for node in graph.get_nodes() if node.get_name() not in _NO_NODES
    )
    for edge in graph.get_edges():
        data = {key: value.strip('"') for key, value in (defaults | edge.get_attributes()).items()}
        for speaker in _ends(edge.get_source()):
            for hearer in _ends(edge.get_destination()):
                to.add_edge(speaker, hearer, **data)
                if both_ways:
                    to.add_edge(hearer, speaker, **data)
    for inner in graph.get_subgraphs():
        _add(to, inner, defaults, both_ways=both_ways)


def _ends(end: Any) -> list[str]:
    """The nodes at one end of a DOT edge: one, or those of a set in braces."""
    return [_plain(end)] if isinstance(end, str) else [_plain(node) for node in end["nodes"]]


def _plain(node: str) -> str:
    """The name of a node without quotes and port."""
    return node.partition(":")[0].strip('"')
