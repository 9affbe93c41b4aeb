"""The emulated edges to one robot: what comes through them, when, and from how far."""

from math import isnan

import pytest
from support.robot_bench import NOWHERE, Bench

from agents.emulated_network import HERE, EmulatedNetwork
from bridge.network.messages import LeaderSpeed, PathState, PoseFix
from configs.leader_speed import SpeedChange
from configs.loading import load
from configs.resolve import agent_brief

MS = 1_000_000


def network(effects: str, robot: str = "r2", *more: str) -> EmulatedNetwork:
    """The edges of a robot of `two_robots` (r1 -> r2, leader -> r1), 500 Hz, shares at 50 Hz."""
    scenario = load("two_robots", (f"network={effects}", *more))
    return EmulatedNetwork(agent_brief(scenario, robot, network=NOWHERE, bus=()))


def state(tick: int, s: float = 0.0) -> PathState:
    return PathState(tick, tick * 2 * MS, s, 0.6)


def pose(tick: int, x_m: float, y_m: float = 0.0) -> PoseFix:
    return PoseFix(tick, tick * 2 * MS, x_m, y_m, 0.0)


def test_a_path_state_is_due_at_its_date_and_the_delay_however_late_it_came() -> None:
    edges = network('{default={delay={kind="constant", delay_s=0.03}}}')
    assert edges.carries_path_of("r1")
    edges.send_path_state("r1", state(10))  # of 20 ms
    assert edges.path_states(49 * MS, ["r1"]) == []
    edges.send_path_state("r1", state(20))  # of 40 ms
    assert [s.tick for _, s in edges.path_states(90 * MS, ["r1"])] == [10, 20]


def test_of_poses_that_are_due_the_newest_counts() -> None:
    edges = network(
        '{edge=[{edges=["localisation -> r2"], delay={kind="trace", delays_s=[0.05, 0.01]}}]}'
    )
    assert edges.carries_poses
    edges.send_pose(pose(0, 1.0))
    edges.send_pose(pose(10, 2.0))
    assert edges.newest_pose(25 * MS) is None
    assert edges.newest_pose(30 * MS) == pose(10, 2.0)
    assert edges.ages_s(30 * MS) == pytest.approx([0.01])
    assert edges.newest_pose(50 * MS) == pose(0, 1.0)
    assert edges.ages_s(50 * MS) == pytest.approx([0.03])  # still of the newer one


def test_the_leaders_speed_is_heard_late_and_held_until_it_is_silent_for_too_long() -> None:
    edges = network(
        '{edge=[{edges=["leader -> r1"], delay={kind="constant", delay_s=0.1},'
        " partitions=[{from_s=1.0, to_s=9.0}]}]}",
        "r1",
        "coordination.silence_limit_s=0.5",
    )
    steps = LeaderSpeed((SpeedChange(0, 0.6, 0), SpeedChange(500 * MS, 0.2, 0)))
    heard, ages = {}, {}
    for tick in range(1000):
        heard[tick * 2] = edges.leader_speed(tick, steps, -1.0)
        (ages[tick * 2],) = edges.ages_s(tick * 2 * MS)
    assert isnan(ages[98])
    assert (ages[100], ages[118], ages[120]) == pytest.approx((0.1, 0.118, 0.1))
    assert (heard[98], heard[100]) == (-1.0, 0.6)
    assert (heard[598], heard[600]) == (0.6, 0.2)
    last_sent_ms = 880  # what is due in the cut is lost, too
    assert (heard[last_sent_ms + 500], heard[last_sent_ms + 502]) == (0.2, -1.0)
    assert edges.counts()["leader"]["lost"] > 0


def test_a_message_is_sent_from_as_far_as_the_last_poses_of_both_are_apart() -> None:
    edges = network("{default={distance={range_m=5.0}}}")
    assert edges.missing_to_start() == ["the pose of r1"]
    edges.receive_place(HERE, pose(-1, 0.0))
    edges.receive_place("r1", pose(-1, 3.0))
    assert edges.missing_to_start() == []
    edges.send_path_state("r1", state(0))
    assert edges.missing(5) == ["pose of r1"]
    edges.receive_place("r1", pose(5, 3.0, 4.1))
    edges.receive_place(HERE, pose(5, 0.0))
    assert edges.missing(5) == []
    edges.measure(5)
    edges.send_path_state("r1", state(10))
    edges.receive_place("r1", pose(15, 3.0, 3.9))
    edges.measure(15)  # this robot's own is as before
    edges.send_path_state("r1", state(20))
    assert [s.tick for _, s in edges.path_states(40 * MS, ["r1"])] == [0, 20]
    assert edges.counts()["r1"]["lost"] == 1


def test_the_first_message_is_sent_from_as_far_as_the_start_poses_are_apart() -> None:
    edges = network("{default={distance={range_m=5.0}}}")
    edges.receive_place("r1", pose(-1, 5.1))
    edges.receive_place(HERE, pose(-1, 0.0))
    edges.send_path_state("r1", state(0))
    assert edges.path_states(0, ["r1"]) == []
    assert edges.counts()["r1"]["lost"] == 1


def test_odometry_is_kept_for_the_longest_delay_however_old_a_pose_may_be() -> None:
    edge = 'network={edge=[{edges=["localisation -> *"], duplication=0.5}]}'
    bench = Bench("r2", "host.pose_age_limit_s=1e9", edge)  # of the 1e9 s no memory holds the ticks
    assert bench.agent.network is not None
    assert bench.agent.network.carries_poses


def test_what_is_due_while_an_edge_does_not_exist_is_lost() -> None:
    edges = network('{default={delay={kind="constant", delay_s=0.03}}}')
    for tick in (10, 20, 30):
        edges.send_path_state("r1", state(tick))  # due at 50, 70 and 90 ms
    assert [s.tick for _, s in edges.path_states(60 * MS, ["r1"])] == [10]
    assert edges.path_states(80 * MS, []) == []
    assert [s.tick for _, s in edges.path_states(90 * MS, ["r1"])] == [30]
    counts = edges.counts()["r1"]
    assert (counts["sent"], counts["delivered"], counts["lost"]) == (3, 2, 1)


def test_a_leader_whose_edge_goes_is_heard_again_by_what_it_says_afterwards() -> None:
    late = '{edge=[{edges=["leader -> r1"], delay={kind="constant", delay_s=0.1}}]}'
    edges = network(late, "r1")
    says = LeaderSpeed((SpeedChange(0, 0.6, 0), SpeedChange(1000 * MS, 0.2, 0)))
    heard = {
        tick * 2: edges.leader_speed(tick, says, -1.0, exists=not 400 <= tick < 600)
        for tick in range(700)  # gone from 0.8 s to 1.2 s
    }
    assert (heard[798], heard[800], heard[1198]) == (0.6, -1.0, -1.0)
    assert (heard[1298], heard[1300]) == (-1.0, 0.2)
    counts = edges.counts()["leader"]
    assert (counts["sent"], counts["lost"]) == (50, 5)


@pytest.mark.parametrize("robot", ["r1", "r2"])
def test_edges_without_effects_have_no_channels(robot: str) -> None:
    scenario = load("two_robots")
    assert agent_brief(scenario, robot, network=NOWHERE, bus=()).channels == ()
