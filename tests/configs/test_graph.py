"""Directed graphs: arrows along the flow of information, the two graph conditions, generators."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from configs.brief import NetworkLink
from configs.edges import LEADER, InEdge, parse_edge
from configs.graph import Graph, generated, of_matrix, random_ring, random_rooted
from configs.loading import load, loads, to_toml
from configs.resolve import agent_brief

FOUR = ("r1", "r2", "r3", "r4")
EXTRA = ["r1 -> r2", "r2 -> r3", "r3 -> r4", "r2 -> r4"]


def test_an_edge_says_who_is_heard_by_whom() -> None:
    graph = Graph.of(("r1", "r2"), [("r1", "r2")], ("r1",))
    assert graph.in_neighbours == {"r1": (), "r2": ("r1",)}
    assert graph.adjacency().tolist() == [[0, 0], [1, 0]]
    assert graph.laplacian().tolist() == [[0, 0], [-1, 1]]
    assert graph.leader == ("r1",)


@pytest.mark.parametrize("text", ["r1 > r2", "r1 ->", "-> r2", "r1 r2", ""])
def test_what_is_no_edge_is_none(text: str) -> None:
    assert parse_edge(text) is None


def test_an_edge_is_read_with_any_spaces() -> None:
    assert parse_edge(" r1->r2 ") == ("r1", "r2")


@pytest.mark.parametrize(
    ("kind", "edges"),
    [
        ("chain", {("r1", "r2"), ("r2", "r3"), ("r3", "r4")}),
        ("ring", {("r1", "r2"), ("r2", "r3"), ("r3", "r4"), ("r4", "r1")}),
        ("tree", {("r1", "r2"), ("r1", "r3"), ("r2", "r4")}),
        ("star", {("r1", "r2"), ("r1", "r3"), ("r1", "r4")}),
        ("complete", {(a, b) for a in FOUR for b in FOUR if a != b}),
    ],
)
def test_generators_make_the_named_shapes(kind: str, edges: set[tuple[str, str]]) -> None:
    assert set(generated(kind, FOUR)) == edges


def test_a_root_reaches_all_others_along_the_flow_of_information() -> None:
    fork = Graph.of(("r1", "r2", "r3"), [("r2", "r1"), ("r3", "r1")], ("r1",))
    assert fork.roots() == ()  # the paper's wording would call r1 one
    assert Graph.of(FOUR, generated("chain", FOUR), ("r1",)).roots() == ("r1",)
    assert Graph.of(FOUR, generated("ring", FOUR), ("r1",)).roots() == FOUR


graphs = st.integers(2, 7).flatmap(
    lambda n: st.tuples(
        st.just(n),
        st.sets(st.tuples(st.integers(0, n - 1), st.integers(0, n - 1)), max_size=2 * n),
        st.sets(st.integers(0, n - 1), max_size=n),
    )
)


@given(graphs)
def test_the_leader_reaches_everybody_iff_l_plus_h_is_nonsingular(drawn) -> None:
    n, edges, leader = drawn
    names = [f"r{k}" for k in range(n)]
    graph = Graph.of(
        names,
        [(names[a], names[b]) for a, b in edges if a != b],
        [names[k] for k in sorted(leader)],
    )
    links = np.diag([float(robot in graph.leader) for robot in names])
    smallest = np.linalg.svd(graph.laplacian() + links, compute_uv=False)[-1]
    assert (graph.unreached_from(graph.leader) == ()) == (smallest > 1e-9)


@given(graphs)
def test_the_graph_is_rooted_iff_the_laplacian_has_a_simple_zero(drawn) -> None:
    n, edges, _ = drawn
    names = [f"r{k}" for k in range(n)]
    graph = Graph.of(names, [(names[a], names[b]) for a, b in edges if a != b], ())
    assert bool(graph.roots()) == (np.linalg.matrix_rank(graph.laplacian(), tol=1e-9) == n - 1)
    assert graph.roots() == tuple(i for i in graph.robots if not graph.unreached_from([i]))


@given(n=st.integers(1, 20), degree=st.integers(1, 5), seed=st.integers(0, 1000))
def test_random_graphs_are_rooted_bounded_and_reproducible(n: int, degree: int, seed: int) -> None:
    names = [f"r{k}" for k in range(n)]
    edges = random_rooted(names, max_in_degree=degree, seed=seed)
    graph = Graph.of(names, edges, names[:1])
    assert graph.unreached_from(names[:1]) == ()
    assert graph.max_in_degree <= degree
    assert len(set(edges)) == len(edges)
    assert edges == random_rooted(names, max_in_degree=degree, seed=seed)


@given(n=st.integers(1, 20), degree=st.integers(1, 5), seed=st.integers(0, 1000))
def test_in_random_rings_each_reaches_all_others(n: int, degree: int, seed: int) -> None:
    names = [f"r{k}" for k in range(n)]
    edges = random_ring(names, max_in_degree=degree, seed=seed)
    graph = Graph.of(names, edges, names[:1])
    assert graph.roots() == tuple(names)
    assert graph.max_in_degree <= degree
    assert len(set(edges)) == len(edges)
    assert all(speaker != hearer for speaker, hearer in edges)
    assert edges == random_ring(names, max_in_degree=degree, seed=seed)


def test_the_rows_of_an_adjacency_matrix_hear_its_columns() -> None:
    rows = [[0.0, 0.0, 0.25], [2.0, 0.0, 0.0], [0.0, 0.5, 0.0]]
    weights = of_matrix(FOUR[:3], rows)
    assert weights == {("r3", "r1"): 0.25, ("r1", "r2"): 2.0, ("r2", "r3"): 0.5}
    graph = Graph.of(FOUR[:3], weights, (), weights)
    assert graph.adjacency().tolist() == rows
    assert graph.max_in_degree == 2.0
    assert graph.laplacian().sum(axis=1).tolist() == [0.0, 0.0, 0.0]


def test_normalised_weights_make_every_in_degree_one() -> None:
    weights = {("r1", "r3"): 3.0, ("leader", "r1"): 2.0}
    edges = [("r1", "r3"), ("r2", "r3"), ("r3", "r2")]
    graph = Graph.of(FOUR[:3], edges, ["r1"], weights).normalised()
    assert graph.adjacency().tolist() == [[0, 0, 0], [0, 0, 1], [0.75, 0.25, 0]]
    assert graph.links["r1"].weight == 2.0


@pytest.mark.parametrize(
    ("graph", "row"),
    [
        ("weights={'r2 -> r4'=0.5, 'leader -> r1'=2.0}", [0.0, 0.5, 1.0, 0.0]),
        ("weights='normalised'", [0.0, 0.5, 0.5, 0.0]),
        ("weights='unit'", [0.0, 1.0, 1.0, 0.0]),
    ],
)
def test_a_scenario_gives_weights_and_keeps_them_when_it_is_written(graph: str, row: list) -> None:
    scenario = load("paper_extra", [f"graph={{edges={EXTRA}, {graph}}}"])
    assert scenario.topology.adjacency()[3].tolist() == row
    again = loads("again", to_toml(scenario))
    assert again.topology == scenario.topology
    link = agent_brief(again, "r1", network=NetworkLink("", "", "", ""), bus=()).leader_link
    assert link == InEdge(LEADER, 2.0 if "leader" in graph else 1.0)


def test_a_scenario_gives_an_adjacency_matrix_instead_of_edges() -> None:
    matrix = [[0, 0, 0, 0], [0.5, 0, 0, 0], [0, 1, 0, 0], [0, 0.25, 0.75, 0]]
    scenario = load("paper", [f"graph={{adjacency={matrix}}}"])
    assert scenario.topology.adjacency().tolist() == matrix
    brief = agent_brief(scenario, "r4", network=NetworkLink("", "", "", ""), bus=())
    assert brief.hears == (InEdge("r2", 0.25), InEdge("r3", 0.75))
    assert brief.leader_link is None
    assert loads("again", to_toml(scenario)).topology == scenario.topology


def test_a_copy_with_another_graph_has_its_topology() -> None:
    scenario = load("paper")
    assert len(scenario.topology.edges) == 3
    ring = load("paper_ring").graph
    assert len(scenario.model_copy(update={"graph": ring}).topology.edges) == 4
