"""Draws: quantile functions against their closed forms, bounds, levels."""

import math
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from configs.graph import Graph
from fleetloop.sweep.draws import (
    Draw,
    Graphs,
    Integers,
    Levels,
    NormalDraw,
    Spaced,
    Uniform,
    level,
)

U = st.floats(0.0, 1.0, exclude_max=True)
DRAWS = [
    Levels((0.5, 1.0, 2.0)),
    Levels(("adaptive_dsc", "adaptive_dsc_robust")),
    Spaced(-1.0, 3.0, 9),
    Spaced(0.01, 100.0, 5, log=True),
    Integers(3, 7),
    Uniform(-2.0, 5.0),
    Uniform(1e-3, 1e3, log=True),
    NormalDraw(1.0, 0.5, 0.0, 1.5),
    NormalDraw(1.0, 0.5),
]


@given(st.sampled_from(DRAWS), U, U)
def test_a_greater_sample_never_has_a_lesser_value(draw: Draw, one: float, other: float) -> None:
    if isinstance(draw, Levels):
        ranks = [draw.values.index(draw.at(u)) for u in sorted((one, other))]
    else:
        ranks = [draw.at(u) for u in sorted((one, other))]
    assert ranks == sorted(ranks)


def levels(draw: Draw) -> list[Any]:
    count = draw.count
    assert count is not None
    return [level(draw, n) for n in range(count)]


@pytest.mark.parametrize("draw", [one for one in DRAWS if one.count is not None])
def test_each_level_has_an_equal_share_of_the_samples(draw: Draw) -> None:
    every = levels(draw)
    assert len(set(every)) == len(every)
    for n, value in enumerate(every):
        assert draw.at(math.nextafter((n + 1.0) / len(every), 0.0)) == value
    assert draw.at(0.0) == every[0]


def test_levels_are_the_values_themselves_in_their_order() -> None:
    assert levels(Levels(("b", "a", "c"))) == ["b", "a", "c"]
    assert levels(Integers(3, 7)) == [3, 4, 5, 6, 7]
    assert levels(Graphs(2, 4, 2, ("r1", "r2"))) == [2, 3, 4]
    assert levels(Integers(0, 9_999)) == list(range(10_000))


def test_a_range_includes_both_ends_and_is_even_in_its_logarithm() -> None:
    assert levels(Spaced(0.0, 0.3, 4)) == [0.0, 0.1, 0.2, 0.3]
    assert levels(Spaced(0.01, 100.0, 5, log=True)) == [0.01, 0.1, 1.0, 10.0, 100.0]


@given(U)
def test_a_uniform_draw_is_the_share_of_the_way(u: float) -> None:
    assert Uniform(2.0, 6.0).at(u) == pytest.approx(2.0 + 4.0 * u, rel=1e-8)
    assert Uniform(1e-2, 1e2, log=True).at(u) == pytest.approx(10.0 ** (4.0 * u - 2.0), rel=1e-8)


@given(st.floats(1e-6, 1.0 - 1e-6))
def test_a_truncated_normal_draw_has_its_distribution_within_the_bounds(u: float) -> None:
    whole = NormalDist(3.0, 2.0)
    value = NormalDraw(3.0, 2.0, 2.0, 7.0).at(u)
    assert 2.0 <= value <= 7.0
    below, above = whole.cdf(2.0), whole.cdf(7.0)
    assert (whole.cdf(value) - below) / (above - below) == pytest.approx(u, abs=1e-6)


def test_a_normal_draw_has_no_infinite_value() -> None:
    assert math.isfinite(NormalDraw(0.0, 1.0).at(0.0))


@given(st.sampled_from([one for one in DRAWS if one.count is None]), U)
def test_a_value_survives_a_command_line_unchanged(draw: Draw, u: float) -> None:
    value = draw.at(u)
    assert float(repr(value)) == value
    assert len(f"{value:.9g}") <= 15


@given(st.integers(0, 1_000_000))
def test_a_random_graph_is_shown_as_the_edges_that_the_scenario_gets(seed: int) -> None:
    robots = ("r1", "r2", "r3", "r4")
    graphs = Graphs(0, 1_000_000, 2, robots)
    section = graphs.overrides(seed, {"generator": "chain", "leader": ["r1"], "weights": {"x": 1}})
    assert section["leader"] == ["r1"]
    assert "generator" not in section
    assert "weights" not in section
    edges = [tuple(edge.split(" -> ")) for edge in section["edges"]]
    assert graphs.shown(seed) == " ".join(">".join(edge) for edge in edges)
    graph = Graph.of(robots, edges, ["r1"], {}, None)
    assert graph.max_in_degree <= 2
    heard = {"r1"}
    for _ in robots:
        heard |= {hearer for speaker, hearer in edges if speaker in heard}
    assert heard == set(robots)


def test_random_rings_are_another_kind_of_graphs() -> None:
    robots = ("r1", "r2", "r3", "r4")
    rings = Graphs(0, 1000, 1, robots, "ring")
    assert {str(rings.shown(seed)).count(">") for seed in range(50)} == {4}


def test_uniform_samples_make_uniform_levels() -> None:
    draw = Integers(1, 6)
    u = np.random.default_rng(1).random(6000)
    counts = np.bincount([draw.at(float(one)) for one in u])[1:]
    assert np.all(np.abs(counts - 1000) < 5 * math.sqrt(1000))
