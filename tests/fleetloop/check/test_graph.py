"""Checks before a run, against what is known in closed form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agents.laws.adaptive_dsc import AdaptiveDsc
from configs.graph import Graph, generated, random_ring
from configs.loading import load
from fleetloop.check.coordination import forecast
from fleetloop.check.finding import Finding
from fleetloop.check.graph import (
    continuous_growth_1_s,
    gain_class,
    graph_conditions,
    graph_findings,
    right_side,
    synchronisation,
)


def complete(n: int) -> Graph:
    names = [f"r{k}" for k in range(n)]
    return Graph.of(names, generated("complete", names), names[:1])


def circulant(n: int, predecessors: int) -> Graph:
    names = [f"r{k}" for k in range(n)]
    edges = [(names[(k - d) % n], names[k]) for k in range(n) for d in range(1, predecessors + 1)]
    return Graph.of(names, edges, names[:1])


def test_a_ring_of_three_needs_exactly_one_half() -> None:
    # Eigenvalues 1 − exp(±2πi/3) = 3/2 ∓ i √3/2, so Im²/Re = (3/4)/(3/2).
    finding = synchronisation(circulant(3, 1), p=1.0, q=1.0)
    assert finding.level == "ok"
    assert "1 > 0.5" in finding.text
    assert synchronisation(circulant(3, 1), p=0.7, q=1.0).level == "error"


def test_the_papers_gains_fail_on_twenty_robots_that_hear_their_three_predecessors() -> None:
    finding = synchronisation(circulant(20, 3), p=2.0, q=1.0)
    assert finding.level == "error"
    assert "4.46" in finding.text


def test_weights_scale_both_eigenvalues_and_in_degrees() -> None:
    # ζ scales with a, so does Im²/Re; normalised, the circulant that fails above has 4.46/3.
    ring = circulant(3, 1)
    half = Graph.of(ring.robots, ring.edges, (), dict.fromkeys(ring.edges, 0.5))
    assert "1 > 0.25" in synchronisation(half, p=1.0, q=1.0).text
    assert "8 ≥ 4" in gain_class(half, p=2.0, q=1.0).text
    finding = synchronisation(circulant(20, 3).normalised(), p=2.0, q=1.0)
    assert (finding.level, finding.text) == ("ok", "4 > 1.487")


def test_in_degree_decides_how_much_delay_is_stood() -> None:
    assert "any switching" in gain_class(circulant(4, 1), p=2.0, q=1.0).text
    assert "any delay" in gain_class(circulant(4, 2), p=2.0, q=1.0).text
    assert "1.33 < 2" in gain_class(circulant(5, 3), p=2.0, q=1.0).text


def test_46_says_nothing_of_switching_and_the_check_says_so() -> None:
    scenario = load("rotating_counterexample")
    gains = scenario.coordination
    each_time = synchronisation(scenario.topology, gains.p, gains.q)
    assert (each_time.level, each_time.text) == ("ok", "0.25 > 0")
    assert "at each time" in each_time.title
    switching = gain_class(scenario.topology, gains.p, gains.q)
    assert (switching.level, switching.key) == ("warning", "coordination.p")
    assert switching.text.endswith("raise coordination.p to 2")
    assert gain_class(scenario.topology, 2.0, gains.q).level == "ok"
    union = [finding.text for finding in graph_conditions(scenario.topology)]
    assert all("the union of all times" in text for text in union)


def test_46_is_looked_at_for_each_graph_that_exists_in_turn() -> None:
    ring = "edges=['r1 -> r2','r2 -> r3','r3 -> r4'], switch=[{at_s=1.0, generator='ring'}]"
    graph = load("paper", [f"graph={{{ring}}}", "expect=[]"]).topology
    assert synchronisation(graph, 0.9, 1.0).level == "error"  # the ring of four needs 1
    assert synchronisation(graph.at(0), 0.9, 1.0).level == "ok"


def text_of(title: str, *overrides: str) -> Finding:
    scenario = load("paper", overrides)
    found = graph_findings(scenario, forecast(scenario))
    return next(finding for finding in found if finding.title.startswith(title))


def test_a_dense_graph_is_warned_of_with_the_gain_that_stands_any_delay() -> None:
    finding = gain_class(complete(21), p=2.0, q=1.0)
    assert (finding.level, finding.value, finding.key) == ("warning", "0.2", "coordination.p")
    assert "raise coordination.p to 6.32" in finding.remedy


BACKWARDS = pytest.mark.parametrize(
    "change", ["leader.speed_m_s=-0.4", "leader.steps=[{t_s=3.0, speed_m_s=-0.1}]"]
)


@BACKWARDS
def test_a_leader_that_goes_backwards_is_fine_for_a_law_that_says_so(
    change: str, monkeypatch
) -> None:
    monkeypatch.setattr(AdaptiveDsc, "REVERSES", True)
    finding = text_of("ṡ > 0", change)
    assert (finding.level, finding.text[-23:]) == ("ok", "drive backwards as well")


@BACKWARDS
def test_a_leader_that_goes_backwards_is_an_error_with_its_key(change: str) -> None:
    finding = text_of("ṡ > 0", change)
    assert finding.level == "error"
    assert finding.key in ("leader.speed_m_s", "leader.steps.0.speed_m_s")
    assert "must be positive" in finding.text


def test_a_leader_that_stands_at_the_start_or_stops_on_the_way_is_only_warned_of() -> None:
    assert text_of("ṡ > 0", "leader.speed_m_s=0.0").level == "warning"
    assert text_of("ṡ > 0", "leader.steps=[{t_s=9.0, speed_m_s=0.0}]").level == "warning"


def test_path_variables_that_have_not_agreed_at_the_end_are_warned_of() -> None:
    assert "within 0.05 m after 13.2 s" in text_of("max s_i").text
    early = text_of("max s_i", "duration_s=8.0", "expect=[]")
    assert (early.level, early.key) == ("warning", "coordination.v_hat_0")
    assert (
        text_of("max s_i", "duration_s=8.0", "expect=[]", "coordination.v_hat_0=0.6").level == "ok"
    )


def test_path_variables_that_agree_only_at_the_last_moment_are_warned_of() -> None:
    assert text_of("max s_i", "duration_s=15.0", "expect=[]").level == "warning"
    assert text_of("max s_i", "duration_s=19.0", "expect=[]").level == "ok"


def test_speed_estimates_that_rise_together_but_late_are_warned_of() -> None:
    # All of four hear each other, one the leader: min eig(L + H) = 0.21, so 4.8 s ln(0.6/0.05).
    late = "graph.edges=%r" % [f"r{i} -> r{j}" for i in range(1, 5) for j in range(1, 5) if i != j]
    assert text_of("max s_i", late, "duration_s=14.0", "expect=[]").level == "ok"
    finding = text_of("max |v̂_i − v_r|", late, "duration_s=14.0", "expect=[]")
    assert (finding.level, finding.key) == ("warning", "coordination.v_hat_0")
    assert "within 0.05 m/s after 12.5 s" in finding.text
    assert text_of("max |v̂_i − v_r|", late, "duration_s=20.0", "expect=[]").level == "ok"


def test_who_starts_ahead_goes_back_to_meet_the_others(monkeypatch) -> None:
    finding = text_of("ṡ > 0: path variables", "robot.r4.s_0=2.0")
    assert (finding.level, finding.robots, finding.key) == ("warning", ("r4",), "robot.r4.s_0")
    monkeypatch.setattr(AdaptiveDsc, "REVERSES", True)
    finding = text_of("ṡ > 0: path variables", "robot.r4.s_0=2.0")
    assert (finding.level, finding.robots) == ("ok", ("r4",))


def test_sharing_beyond_the_age_limit_is_warned_of_and_unstable_sharing_an_error() -> None:
    slow = "clock.share_period_s=3.0", "coordination.silence_limit_s=4.0"
    assert text_of("shared every 3 s", *slow).level == "warning"
    ring = "graph={generator='ring'}", "coordination.p=0.5", "clock.share_period_s=1.5"
    assert text_of("shared every 1.5 s", *ring).level == "error"


@settings(deadline=None)
@given(st.integers(3, 7), st.integers(0, 10_000), st.floats(0.1, 4.0), st.floats(0.3, 4.0))
def test_growth_in_continuous_time_is_negative_iff_46_holds(
    n: int, seed: int, p: float, q: float
) -> None:
    robots = [f"r{k}" for k in range(n)]
    graph = Graph.of(robots, random_ring(robots, max_in_degree=2, seed=seed), ["r1"])
    growth = continuous_growth_1_s(graph, p, q)
    if abs(growth) > 1e-9:
        assert (growth < 0.0) == (p * p / q > right_side(graph))
    size = np.eye(n)
    whole = np.block([[-p * size, -q * graph.laplacian()], [size, 0.0 * size]])
    values = np.linalg.eigvals(whole)
    others = np.delete(values, np.argmin(np.abs(values)))  # all s together stay as they are
    assert growth == pytest.approx(others.real.max(), abs=5e-3)  # of equal ones rounding is seen
