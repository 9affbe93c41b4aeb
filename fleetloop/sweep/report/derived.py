"""What theory makes of a case's factors: both sides of (46), where the graph, p or q are varied.

    p2_q     p²/q
    im2_re   max Im(ζ)²/Re(ζ) over the eigenvalues ζ ≠ 0 of L

The coordination of a case converges on its graph iff p2_q > im2_re.
"""

from dataclasses import replace

import numpy as np

from configs.edges import Edge
from configs.errors import FleetloopError
from configs.graph import Graph
from configs.scenario import Scenario
from fleetloop.check.graph import right_side
from fleetloop.sweep.cases import Cases, Factor
from fleetloop.sweep.draws import Graphs
from fleetloop.sweep.factors import GRAPH
from fleetloop.sweep.report.columns import Column, Series
from fleetloop.sweep.report.results import Results

MOST_GRAPHS = 200
"""Different values of keys of [graph] whose scenarios are loaded."""
LEFT, RIGHT = "p2_q", "im2_re"
_P, _Q = "coordination.p", "coordination.q"


def with_derived(results: Results) -> Results:
    """The results, with what theory makes of their factors."""
    cases = results.cases
    if cases is None or cases.base.topology.switches:
        return results
    by_key = {factor.keys[0]: factor for factor in cases.factors}
    of_graph = [f for f in cases.factors if f.keys[0].partition(".")[0] == GRAPH]
    if not (of_graph or {_P, _Q} & by_key.keys()):
        return results
    count, gains = len(results), cases.base.coordination
    p = _of(results, by_key.get(_P), gains.p, count)
    q = _of(results, by_key.get(_Q), gains.q, count)
    sides = _sides(results, cases, of_graph)
    with np.errstate(all="ignore"):
        left = Column(LEFT, np.where(q > 0, p * p / q, np.nan), symbol="p²/q")
    right = Column(RIGHT, np.round(sides, 8), symbol="max Im(ζ)²/Re(ζ)")
    return replace(results, derived=(left, right))


def graph_of(text: str, base: Scenario) -> Graph:
    """The graph of a case from its edges as the dataset has them, "r1>r2 r2>r3"."""
    edges: list[Edge] = []
    for word in text.split():
        speaker, _, hearer = word.partition(">")
        edges.append((speaker, hearer))
    made = Graph.of(base.names, edges, base.topology.leader)
    return made.normalised() if base.graph.weights == "normalised" else made


def _of(results: Results, factor: Factor | None, otherwise: float, count: int) -> Series:
    if factor is None:
        return np.full(count, otherwise)
    return next(one.values for one in results.factors if one.name == factor.name)


def _sides(results: Results, cases: Cases, of_graph: list[Factor]) -> Series:
    """The right side of (46) of every case; NaN where it isn't known."""
    if not of_graph:
        return np.full(len(results), right_side(cases.base.topology))
    if len(of_graph) == 1 and isinstance(of_graph[0].draw, Graphs):
        texts = results.texts(of_graph[0].name)
        known = {text: right_side(graph_of(text, cases.base)) for text in dict.fromkeys(texts)}
        return np.array([known[text] for text in texts])
    numbers = results.table.column("case").to_pylist()
    kinds = list(zip(*(results.texts_of(one.name) for one in of_graph), strict=True))
    sides: dict[tuple[str, ...], float] = {}
    for number, kind in zip(numbers, kinds, strict=True):
        if kind not in sides:
            sides[kind] = _side(cases, number) if len(sides) < MOST_GRAPHS else np.nan
    return np.array([sides[kind] for kind in kinds])


def _side(cases: Cases, number: int) -> float:
    try:
        return right_side(cases.scenario(cases.case(number)).topology)
    except FleetloopError:  # it is a row of its own
        return np.nan
