"""Wheel and shaft: what a gear does to limits, speeds and what `check` says of them."""

from math import pi

import pytest

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisState, Command, identifier
from bridge.drives.odrive.load import cyclic_messages
from bridge.frame import Frame
from configs.connections import NetworkLink
from configs.loading import load
from configs.resolve import plant_brief, robot_briefs
from configs.scenario import Scenario
from configs.signals import PLANT_SIGNALS
from fleetloop.check.bus_load import bus_messages
from fleetloop.torque_limits import Limit, limits
from plant.robot import EmulatedRobot, emulated_robot

GEARS = [(0.1, 1), (1.0, -1), (9.0, 1), (9.0, -1)]
PERIOD_NS = 1_000_000
NAMES = [signal.name for signal in PLANT_SIGNALS]


def scenario_of(preset: str, ratio: float, sign: int) -> Scenario:
    return load(
        "two_robots",
        (
            f"drive.preset='{preset}'",
            "drive.watchdog_s=0.0",
            "drive.overspeed_ratio=100.0",
            "robot.r1.v_m_s=0.0",
            f"mounting={{gear_ratio={ratio}, right_sign={sign}, left_sign={sign}}}",
            "motor={coulomb_friction_shaft_N_m=0.0, viscous_friction_shaft_N_m_s=0.0}",
        ),
    )


def pushed(
    scenario: Scenario, shaft_N_m: float, ticks: int
) -> tuple[EmulatedRobot, dict[str, float]]:
    """A robot whose drives were told a torque at their shafts, for milliseconds."""
    robot = emulated_robot(plant_brief(scenario, network=NetworkLink("t", "", "", "")).robots[0])
    closed = f.ONE_U32.pack(AxisState.CLOSED_LOOP_CONTROL)
    for node in (0, 1):
        robot.on_frame(Frame(identifier(node, Command.SET_AXIS_STATE), closed), 0)
        torque = f.ONE_FLOAT.pack(shaft_N_m)
        robot.on_frame(Frame(identifier(node, Command.SET_INPUT_TORQUE), torque), 0)
    for tick in range(ticks):
        robot.frames_due(tick * PERIOD_NS)
        robot.advance(tick * 1e-3, 1e-3, 1)
    return robot, dict(zip(NAMES, robot.row(ticks * 1e-3), strict=True))


def limit_of(scenario: Scenario, key: str) -> Limit:
    return next(limit for limit in limits(scenario, scenario.robot[0]) if limit.key == key)


@pytest.mark.parametrize(("ratio", "sign"), GEARS)
@pytest.mark.parametrize("preset", ["limited", "realistic"])
def test_the_current_limit_of_check_is_what_the_wheel_gets(
    preset: str, ratio: float, sign: int
) -> None:
    scenario = scenario_of(preset, ratio, sign)
    _, row = pushed(scenario, sign * 100.0, 1 if preset == "limited" else 8)
    least = min(limit.torque_wheel_N_m for limit in limits(scenario, scenario.robot[0]))
    assert least == pytest.approx(ratio * 0.05 * 10.0)
    assert row["demand_right_wheel_N_m"] == pytest.approx(least, rel=0.05)
    assert row["motor_right_wheel_N_m"] == pytest.approx(least, rel=0.05)


@pytest.mark.parametrize(("ratio", "sign"), GEARS)
def test_the_velocity_limit_of_check_is_where_the_wheel_gets_nothing_more(
    ratio: float, sign: int
) -> None:
    scenario = scenario_of("limited", ratio, sign)
    limit = limit_of(scenario, "drive.velocity_limit_shaft_rev_s")
    at_m_s = 0.5 * limit.speed_m_s
    robot, _ = pushed(scenario, 0.0, 0)
    robot.state = robot.state._replace(v=at_m_s)
    robot.update_encoders()
    radius_m = scenario.body_of(scenario.robot[0]).wheel_radius_m
    left = limit.torque_wheel_N_m - limit.slope_wheel_N_m_s * at_m_s / radius_m
    for drive in robot.drives:
        drive.on_frame(
            Frame(identifier(drive.node_id, Command.SET_AXIS_STATE), f.ONE_U32.pack(8)), 0
        )
        drive.on_frame(
            Frame(
                identifier(drive.node_id, Command.SET_INPUT_TORQUE), f.ONE_FLOAT.pack(sign * 50.0)
            ),
            0,
        )
        drive.on_frame(
            Frame(identifier(drive.node_id, Command.SET_LIMITS), f.TWO_FLOATS.pack(10.0, 1e6)), 0
        )
        demand = drive.torque_demand_shaft(0.001) * sign * ratio
        assert demand == pytest.approx(left, rel=1e-4)
    assert limit.speed_m_s == pytest.approx(10.0 * 2.0 * pi / ratio * radius_m)


@pytest.mark.parametrize(("ratio", "sign"), GEARS)
def test_typical_frames_of_the_load_hold_what_the_shaft_does(ratio: float, sign: int) -> None:
    scenario = scenario_of("ideal", ratio, sign)
    robot = robot_briefs(scenario)[0]
    messages = cyclic_messages(robot.drive, 0, PERIOD_NS, sign * ratio)
    by_id = {message.can_id: message.payloads for message in messages}
    _, speed = f.TWO_FLOATS.unpack(by_id[identifier(0, Command.GET_ENCODER_ESTIMATES)][0])
    (torque,) = f.ONE_FLOAT.unpack(by_id[identifier(0, Command.SET_INPUT_TORQUE)][0])
    assert speed == pytest.approx(sign * ratio * 2.4)
    assert torque == pytest.approx(sign * 0.05 / ratio)
    means = {message.can_id: message.mean_bits for message in bus_messages([robot], PERIOD_NS)}
    assert means.keys() >= by_id.keys()
