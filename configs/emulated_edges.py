"""Edges of the emulated network: which effects each has, and entries that name none."""

from collections.abc import Container, Iterator, Sequence
from typing import NamedTuple

from configs.edges import LEADER, edge_text, parse_edge
from configs.errors import Problem
from configs.graph import Graph
from configs.netem import EVERY_ROBOT, LOCALISATION, Effects
from configs.parameters import base_of, changed
from configs.sections import Network

SOURCES = (LEADER, LOCALISATION)
"""Sources of messages that are no robots."""


class EmulatedEdge(NamedTuple):
    """A directed edge: messages go from the source to the hearer."""

    source: str
    hearer: str

    def __str__(self) -> str:
        return edge_text(self)


def edges_of(graph: Graph) -> list[EmulatedEdge]:
    """All edges that can be emulated: between robots, from the leader, from the localisation."""
    return [
        *(EmulatedEdge(*edge) for edge in graph.edges),
        *(EmulatedEdge(LEADER, robot) for robot in graph.leader),
        *(EmulatedEdge(LOCALISATION, robot) for robot in graph.robots),
    ]


def effects_of(network: Network, edge: EmulatedEdge) -> Effects:
    """The effects of one edge: of each key what the last entry that names the edge gives."""
    effects = Effects() if edge.source in SOURCES else network.default
    for entry in network.edge:
        if any(named(text, edge) for text in entry.edges):
            effects = changed(effects, base_of(Effects, entry))
    return effects


def effects_to(
    network: Network,
    graph: Graph,
    hearer: str,
    *,
    faulted: Container[str] = (),
    of_robots: bool = True,
) -> dict[str, Effects]:
    """The effects of the edges to a robot by their sources, of those that have any.

    `faulted` sources are there without effects as well: faults concern their edges. `of_robots`: of
    its in-neighbours, too.
    """
    heard = [edge.speaker for edge in graph.hears[hearer]] if of_robots else []
    leader = [LEADER] if hearer in graph.leader else []
    all_of = {
        source: effects_of(network, EmulatedEdge(source, hearer))
        for source in (*heard, *leader, LOCALISATION)
    }
    return {
        source: effects
        for source, effects in all_of.items()
        if effects != Effects() or source in faulted
    }


def named(text: str, edge: EmulatedEdge) -> bool:
    """Whether a text, perhaps with a `*`, names an edge."""
    pattern = parse_edge(text)
    if pattern is None:
        return False
    source, hearer = pattern
    from_it = source == edge.source or (source == EVERY_ROBOT and edge.source not in SOURCES)
    return from_it and hearer in (edge.hearer, EVERY_ROBOT)


def emulation_problems(network: Network, graph: Graph) -> Iterator[Problem]:
    """Entries of [[network.edge]] that name no edge of the graph."""
    edges = edges_of(graph)
    for n, entry in enumerate(network.edge):
        for text in entry.edges:
            if problem := pattern_problem(text, edges, graph.robots):
                yield Problem(f"network.edge.{n}.edges", text, problem)
            elif entry.distance is not None and _source_of(text) in SOURCES:
                remedy = "only between robots: the source of this edge has no place"
                yield Problem(f"network.edge.{n}.distance", text, remedy)


def _source_of(text: str) -> str | None:
    pattern = parse_edge(text)
    return None if pattern is None else pattern[0]


def pattern_problem(text: str, edges: Sequence[EmulatedEdge], robots: Sequence[str]) -> str | None:
    """Why a text names none of these edges, None if it names one."""
    pattern = parse_edge(text)
    if pattern is None:
        return 'must read "r1 -> r2", with * for every robot, or leader or localisation as source'
    source, hearer = pattern
    for name, known in (
        (source, (*robots, EVERY_ROBOT, *SOURCES)),
        (hearer, (*robots, EVERY_ROBOT)),
    ):
        if name not in known:
            return f"{name}: must be one of {', '.join(known)}"
    if any(named(text, edge) for edge in edges):
        return None
    if hearer == EVERY_ROBOT:
        return f"no such edge in the graph: it has {', '.join(map(str, edges))}"
    heard = [edge.source for edge in edges if edge.hearer == hearer]
    return f"no such edge in the graph; {hearer} hears {', '.join(heard)}"
