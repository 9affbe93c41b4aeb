"""Problems of the section [graph]: edges, weights, and the two conditions of Theorem 3.1."""

from collections.abc import Collection, Iterator, Mapping

from configs.edge_checks import edge_problem, robot_problems
from configs.edges import LEADER, LEAST_WEIGHT, MOST_WEIGHT, Edge, edge_text, parse_edge
from configs.errors import Problem
from configs.graph import Graph
from configs.scenario import Scenario
from configs.switch_checks import count_problems, switch_problems

_SOURCES = ("edges", "generator", "adjacency")


def edge_problems(scenario: Scenario) -> list[Problem]:
    """Problems of single edges, links, weights; of weights only where the edges are all right."""
    problems = [*_sources(scenario), *_links(scenario), *_matrix(scenario)]
    problems += switch_problems(scenario)
    if not problems:
        problems += count_problems(scenario)
    if not problems and not isinstance(scenario.graph.weights, str):
        problems += _weights(scenario, scenario.graph.weights)
    return problems


def _sources(scenario: Scenario) -> Iterator[Problem]:
    graph = scenario.graph
    given = [source for source in _SOURCES if getattr(graph, source) is not None]
    if len(given) > 1:
        remedy = f"give one of {', '.join(_SOURCES)}: it is the whole graph"
        yield Problem(f"graph.{given[1]}", getattr(graph, given[1]), remedy)
    for text in graph.edges or ():
        yield from edge_problem(scenario.names, "graph.edges", text)


def _links(scenario: Scenario) -> Iterator[Problem]:
    leader = scenario.graph.leader
    yield from robot_problems(scenario.names, "graph.leader", leader or ())
    if leader is not None and not leader and not scenario.graph.switch:
        yield Problem("graph.leader", [], "at least one robot must hear the leader")


def _matrix(scenario: Scenario) -> Iterator[Problem]:
    """The adjacency matrix is square, its weights are weights, no robot hears itself."""
    key, rows, names = "graph.adjacency", scenario.graph.adjacency, scenario.names
    if rows is None:
        return
    size = len(names)
    if len(rows) != size or any(len(row) != size for row in rows):
        shape = f"{len(rows)} rows of {' or '.join(sorted({str(len(row)) for row in rows}))}"
        remedy = f"{shape}; must be {size} × {size}: a row and a column for each robot, in order"
        yield Problem(key, [list(row) for row in rows], remedy)
        return
    for n, (robot, row) in enumerate(zip(names, rows, strict=True)):
        if row[n]:
            yield Problem(f"{key}.{n}.{n}", row[n], f"must be 0: {robot} doesn't hear itself")
        for m, weight in enumerate(row):
            if weight and not LEAST_WEIGHT <= weight <= MOST_WEIGHT:
                remedy = f"must be 0, or {LEAST_WEIGHT:g} to {MOST_WEIGHT:g}"
                yield Problem(f"{key}.{n}.{m}", weight, remedy)


def _weights(scenario: Scenario, table: Mapping[str, float]) -> Iterator[Problem]:
    """Weights are of edges that the graph has."""
    key = "graph.weights"
    if scenario.graph.adjacency is not None:
        remedy = "the entries of adjacency are the weights; change them there"
        yield Problem(key, dict(table), remedy)
        return
    topology = scenario.topology
    links = ((LEADER, robot) for robot in topology.leader)
    known = dict.fromkeys((*topology.edges, *links))  # a set, in order
    for text, weight in table.items():
        edge = parse_edge(text)
        if edge is None:
            yield Problem(f"{key}.{text}", weight, 'its key must read "r1 -> r2": r2 hears r1')
        elif edge not in known:
            yield Problem(f"{key}.{text}", weight, _no_edge(edge, known))


def _no_edge(edge: Edge, known: Collection[Edge]) -> str:
    if edge[::-1] in known:
        return f"the graph has no such edge, but {edge_text(edge[::-1])}"
    return f"the graph has no such edge; it has {', '.join(map(edge_text, known))}"


def graph_problems(scenario: Scenario) -> Iterator[Problem]:
    """The two conditions of Theorem 3.1, of a scenario whose edges are all right."""
    graph = scenario.topology
    unreached, transposed = graph.unreached_from(graph.leader), _transposed(scenario)
    ever = ", whatever exists of it when" if graph.switches else ""
    if unreached:
        yield Problem(
            "graph.leader",
            list(graph.leader),
            f"the leader does not reach {', '.join(unreached)}: add an edge to them from a robot"
            f" that it reaches, or a leader link{ever}{transposed}",
        )
    if not graph.roots():
        yield Problem(
            "graph.edges",
            [edge_text(edge) for edge in graph.edges],
            "no robot reaches all others (the graph has no root), so s_i − s_j would never vanish:"
            f" join the parts by an edge{ever}{transposed}",
        )


def _transposed(scenario: Scenario) -> str:
    """What to add where an adjacency matrix fails that would hold the other way round."""
    if scenario.graph.adjacency is None:
        return ""
    graph = scenario.topology
    turned = Graph.of(graph.robots, [(b, a) for a, b in graph.edges], graph.leader)
    if turned.unreached_from(graph.leader) or not turned.roots():
        return ""
    return "; the matrix looks transposed: row i holds what robot i hears, not what hears robot i"
