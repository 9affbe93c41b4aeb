"""Robots that join late or leave: windows of edges, and what a scenario may say."""

import pytest

from configs.edges import FOREVER, LEADER
from configs.errors import ScenarioError
from configs.loading import load
from configs.membership import ALWAYS, Membership, attended, changes

MEMBERS = {"r1": ALWAYS, "r2": Membership(joins_tick=10), "r3": Membership(leaves_tick=50)}


def test_a_robot_is_heard_as_a_member_and_hears_until_it_leaves() -> None:
    edges = (LEADER, "r3"), ("r1", "r2"), ("r2", "r1"), ("r2", "r3"), ("r3", "r1"), ("r1", "r1x")
    members = MEMBERS | {"r1x": ALWAYS}
    assert attended(dict.fromkeys(edges), members) == {
        (LEADER, "r3"): ((0, 50),),
        ("r1", "r2"): None,  # it listens before it joins
        ("r2", "r1"): ((10, FOREVER),),
        ("r2", "r3"): ((10, 50),),
        ("r3", "r1"): ((0, 50),),
        ("r1", "r1x"): None,
    }


def test_windows_of_a_graph_that_switches_are_cut() -> None:
    windows = {("r2", "r3"): ((0, 5), (8, 20), (40, 60)), ("r2", "r1"): ((0, 5),)}
    assert attended(windows, MEMBERS) == {("r2", "r3"): ((10, 20), (40, 50))}


def test_changes_of_the_formation_are_in_order_of_time() -> None:
    assert changes(MEMBERS.values()) == [0, 10, 50]


def test_the_topology_has_the_windows_and_a_copy_makes_them_anew() -> None:
    scenario = load("paper", ["robot.r2.joins_at_s=1.0"])
    (edge,) = scenario.topology.hears["r3"]
    assert edge.windows == ((1000, FOREVER),)
    whole = scenario.model_copy(update={"robot": load("paper").robot})
    assert whole.topology.hears["r3"][0].windows is None


@pytest.mark.parametrize(
    ("override", "key", "remedy"),
    [
        ("robot.r2.joins_at_s=0.00015", "robot.r2.joins_at_s", "whole multiple"),
        ("robot.r2.joins_at_s=30.0", "robot.r2.joins_at_s", "must be below duration_s = 30"),
        ("robot.r2.leaves_at_s=0.00015", "robot.r2.leaves_at_s", "whole multiple"),
    ],
)
def test_impossible_times_are_refused(override: str, key: str, remedy: str) -> None:
    with pytest.raises(ScenarioError) as raised:
        load("paper", [override])
    assert key in str(raised.value)
    assert remedy in str(raised.value)


def test_a_robot_leaves_after_it_has_joined_and_stands_until_then() -> None:
    late = "robot.r2.joins_at_s=5.0"
    with pytest.raises(ScenarioError, match=r"must be above joins_at_s = 5"):
        load("paper", [late, "robot.r2.leaves_at_s=5.0"])
    with pytest.raises(ScenarioError, match="stands until it joins"):
        load("paper", [late, "robot.r2.v_m_s=0.5"])


def test_what_is_expected_of_a_robot_that_is_not_there_is_refused() -> None:
    expect = "expect=[{signal='x_e_m', robots=['r2'], from_s=10.0, to_s=12.0, max_abs=1.0}]"
    with pytest.raises(ScenarioError, match="r2 joins later or has left"):
        load("paper", ["robot.r2.joins_at_s=15.0", expect])
    load("paper", ["robot.r2.joins_at_s=11.0", expect])
