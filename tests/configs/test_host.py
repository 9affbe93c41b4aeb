"""Sections [host] and [mounting]: what goes together, and what a controller is told."""

from math import inf

import pytest

from configs.brief import HostLimits
from configs.connections import NetworkLink
from configs.errors import ScenarioError
from configs.loading import load
from configs.resolve import agent_brief, plant_brief
from configs.sections import Mounting

NETWORK = NetworkLink("t", "", "", "")


def brief(*overrides: str, bus=(), robot: str = "r1"):
    return agent_brief(load("two_robots", overrides), robot, network=NETWORK, bus=bus)


def test_by_default_ages_are_limited_and_torques_are_not() -> None:
    host = brief().host
    assert host == HostLimits(pose_age_limit_ns=500_000_000)
    assert host.torque_limit_wheel_N_m == host.torque_slew_limit_wheel_N_m_s == inf
    drives = brief().drives
    assert (drives.encoder_age_limit_ns, drives.heartbeat_age_limit_ns) == (50_000_000, 500_000_000)


def test_only_in_real_time_and_with_fixes_a_controller_is_started_again() -> None:
    with pytest.raises(ScenarioError, match=r"host.restarts=1: the tick at which it ended"):
        brief("host.restarts=1")
    realtime = "host.restarts=1", "clock.mode='realtime'"
    assert brief(*realtime).host.restarts == 1
    with pytest.raises(ScenarioError, match=r"host.restarts=1: odometry alone"):
        brief(*realtime, "localisation.source='odometry'")


def test_only_errors_of_a_bus_that_is_not_ours_are_borne() -> None:
    assert brief(bus=(("interface", "fleetloop"),)).host.bus_error_limit_ns == 0
    assert brief(bus=(("interface", "socketcan"),)).host.bus_error_limit_ns == 5_000_000_000


def test_slow_localisation_and_slow_control_have_longer_limits() -> None:
    slow = brief("clock.localisation_period_s=0.2", "clock.control_period_s=0.01")
    assert slow.host.pose_age_limit_ns == 1_010_000_000
    assert slow.drives.encoder_age_limit_ns == 100_000_000
    assert brief("localisation.source='odometry'").host.pose_age_limit_ns == 0


def test_plant_and_controller_are_told_the_same_mounting_robot_by_robot() -> None:
    overrides = ("mounting.gear_ratio=9.0", "robot.r2.mounting.left_sign=-1")
    scenario = load("two_robots", overrides)
    expected = {"r1": Mounting(gear_ratio=9.0), "r2": Mounting(left_sign=-1, gear_ratio=9.0)}
    for robot in plant_brief(scenario, network=NETWORK).robots:
        assert robot.mounting == expected[robot.robot]
        assert brief(*overrides, robot=robot.robot).drives.mounting == expected[robot.robot]


def test_arming_again_wants_every_heartbeat_and_a_pose() -> None:
    for other in (
        "host.rearm_after_s=0.1",
        "host.rearm_limit_s=0.2",
        "localisation.source='odometry'",
    ):
        load("two_robots", (other,))
        with pytest.raises(ScenarioError, match=r"host\.rearm"):
            load("two_robots", ("host.rearm=true", other))
