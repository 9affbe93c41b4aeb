"""Switching graphs as scenarios give them: which edges exist when, the same in every run."""

import pytest

from configs.edges import FOREVER, LEADER, presence
from configs.loading import load, loads, to_toml
from configs.scenario import Scenario

CHAIN = "[['r1 -> r2'], ['r2 -> r3'], ['r3 -> r4']]"
TICK_S = 0.001


def switching(
    *switches: str, graph: str = "edges=['r1 -> r2', 'r2 -> r3', 'r3 -> r4']"
) -> Scenario:
    return load("paper", [f"graph={{{graph}, switch=[{', '.join(switches)}]}}", "expect=[]"])


END = ("{at_s=29.0, generator='chain', leader=[]}",)
"""So that the union is rooted."""


def edges_at(scenario: Scenario, t_s: float) -> set[str]:
    graph = scenario.topology.at(round(t_s / TICK_S))
    return {f"{a}{b}" for a, b in graph.edges} | {f"{LEADER}{robot}" for robot in graph.leader}


def test_sets_at_times_replace_one_another_and_leader_links_stay() -> None:
    scenario = switching(
        "{at_s=1.0, edges=['r1 -> r2', 'r1 -> r4']}", "{at_s=2.0, generator='star', leader=['r3']}"
    )
    assert edges_at(scenario, 0.0) == {"r1r2", "r2r3", "r3r4", "leaderr1"}
    assert edges_at(scenario, 0.999) == edges_at(scenario, 0.0)
    assert edges_at(scenario, 1.0) == {"r1r2", "r1r4", "leaderr1"}
    assert edges_at(scenario, 25.0) == {"r1r2", "r1r3", "r1r4", "leaderr3"}


def test_an_edge_in_two_sets_in_turn_does_not_come_and_go() -> None:
    graph = switching("{at_s=1.0, edges=['r1 -> r2', 'r2 -> r4', 'r1 -> r3']}").topology
    by_edge = {(e.speaker, r): e.windows for r in graph.robots for e in graph.hears[r]}
    assert by_edge["r1", "r2"] is None
    assert by_edge["r2", "r3"] == ((0, 1000),)
    assert by_edge["r2", "r4"] == ((1000, FOREVER),)


def test_rotation_goes_round_from_its_start_until_the_next_switch() -> None:
    scenario = switching(
        f"{{at_s=1.0, rotate={CHAIN}, dwell_s=0.5}}", "{at_s=4.2, edges=['r1 -> r2']}"
    )
    found = [edges_at(scenario, 1.0 + 0.5 * n) - {"leaderr1"} for n in range(7)]
    assert found == [{"r1r2"}, {"r2r3"}, {"r3r4"}, {"r1r2"}, {"r2r3"}, {"r3r4"}, {"r1r2"}]
    assert edges_at(scenario, 4.2) == {"r1r2", "leaderr1"}
    assert len(list(scenario.topology.phases())) == 1 + 7


def test_leader_links_switch_where_sets_name_them() -> None:
    scenario = switching(
        "{rotate=[['leader -> r1'], ['leader -> r2', 'r2 -> r1']], dwell_s=1.0}", *END
    )
    assert edges_at(scenario, 0.5) == {"leaderr1"}
    assert edges_at(scenario, 1.5) == {"leaderr2", "r2r1"}
    assert scenario.topology.leader == ("r1", "r2")


def test_without_a_leader_in_between_the_union_is_what_counts() -> None:
    scenario = switching("{at_s=1.0, generator='chain', leader=[]}")
    assert scenario.topology.at(2000).leader == ()
    assert scenario.topology.leader == ("r1",)


def test_each_edge_exists_with_its_probability_by_itself_and_by_the_seed() -> None:
    text = "{{random=true, probability=0.3, dwell_s=0.01, seed={}}}"
    one, again, other = (switching(text.format(seed)).topology for seed in (4, 4, 5))
    assert one == again != other
    parts = [presence(edge.windows, 30_000)[0] for robot in one.robots for edge in one.hears[robot]]
    assert len(parts) == 3
    # 3,000 draws: the standard deviation is 0.0084.
    assert all(part == pytest.approx(0.3, abs=0.034) for part in parts)
    together = sum(len(one.at(tick).edges) == 3 for tick in range(0, 30_000, 10)) / 3000
    assert together == pytest.approx(0.3**3, abs=0.012)


def test_one_set_of_a_pool_exists_at_a_time_and_each_as_often() -> None:
    graph = switching(f"{{random=true, pool={CHAIN}, dwell_s=0.01}}").topology
    drawn = [graph.at(tick).edges for tick in range(0, 30_000, 10)]
    assert {len(edges) for edges in drawn} == {1}
    for edge in graph.edges:
        assert drawn.count((edge,)) / 3000 == pytest.approx(1 / 3, abs=0.035)


def test_normalised_weights_use_the_largest_in_degree_at_one_time() -> None:
    never_two = "{rotate=[['r1 -> r2'], ['r3 -> r2', 'r1 -> r3', 'r3 -> r4']], dwell_s=1.0}"
    graph = switching(never_two, graph="edges=[], weights='normalised'").topology
    assert graph.in_degree("r2") == 1.0
    two = "{rotate=[['r1 -> r2'], ['r1 -> r2', 'r3 -> r2', 'r1 -> r3', 'r3 -> r4']], dwell_s=1.0}"
    graph = switching(two, graph="edges=[], weights='normalised'").topology
    assert [edge.weight for edge in graph.hears["r2"]] == [0.5, 0.5]
    assert graph.max_in_degree == 1.0


def test_a_written_scenario_switches_the_same_way() -> None:
    scenario = load("switching")
    again = loads("again", to_toml(scenario))
    assert again.topology == scenario.topology
    assert scenario.topology.switches
    assert not load("paper").topology.switches


def test_path_variables_may_come_farther_apart_where_edges_are_absent_for_long() -> None:
    rare = switching(f"{{rotate={CHAIN}, dwell_s=5.0}}").reach
    often = switching(f"{{rotate={CHAIN}, dwell_s=0.5}}").reach
    fixed = load("paper").reach
    assert rare.s_max_m > often.s_max_m > fixed.s_max_m
