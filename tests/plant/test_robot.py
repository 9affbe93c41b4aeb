"""One emulated robot: bus frames in, motion and encoder frames out."""

from math import pi

import pytest

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import Command, identifier
from bridge.frame import Frame
from configs.connections import NetworkLink
from configs.loading import load
from configs.resolve import plant_brief
from configs.signals import PLANT_SIGNALS
from plant.robot import EmulatedRobot, emulated_robot
from plant.troubles import bus_troubles

COLUMNS = [signal.name for signal in PLANT_SIGNALS]


def robot_of() -> EmulatedRobot:
    scenario = load("two_robots", ("robot.r1.v_m_s=0.0", "robot.r1.pose.theta_rad=0.0"))
    return emulated_robot(plant_brief(scenario, network=NetworkLink("t", "", "", "")).robots[0])


def arm(robot: EmulatedRobot, right: float, left: float) -> None:
    for node, torque in ((0, right), (1, left)):
        robot.on_frame(
            Frame(identifier(node, Command.SET_INPUT_TORQUE), f.ONE_FLOAT.pack(torque)), 0
        )
        robot.on_frame(Frame(identifier(node, Command.SET_AXIS_STATE), f.ONE_U32.pack(8)), 0)


def test_frames_of_an_instant_come_in_order_of_arbitration() -> None:
    identifiers = [frame.can_id for frame in robot_of().frames_due(0)]
    assert identifiers == [0x001, 0x009, 0x021, 0x029]


def test_what_drives_ignore_is_a_trouble_of_their_bus() -> None:
    robot = robot_of()
    assert bus_troubles({}, [robot]) == {}
    for _ in range(3):
        robot.on_frame(Frame(identifier(1, Command.SET_POS_GAIN), f.ONE_FLOAT.pack(-1.0)), 0)
    said = "r1's left drive ignored 3 frames: no such command, value or length"
    assert bus_troubles({}, [robot]) == {"r1": said}
    assert bus_troubles({"r1": "failed", "x": "failed"}, [robot]) == {
        "r1": f"failed; {said}",
        "x": "failed",
    }


def test_an_idle_robot_coasts() -> None:
    robot = robot_of()
    robot.state = robot.state._replace(v=0.5)
    robot.advance(0.0, 0.01, 2)
    assert 0.0 < robot.state.v < 0.5
    assert robot.state.x > 3.05


def test_torques_on_the_bus_move_the_robot_and_its_encoders() -> None:
    robot = robot_of()
    arm(robot, 0.1, 0.1)
    for k in range(100):
        robot.advance(k * 0.001, 0.001, 1)
    assert robot.state.v > 0.0
    assert robot.state.theta == pytest.approx(0.0, abs=1e-12)
    frames = {frame.can_id: frame.data for frame in robot.frames_due(100_000_000)}
    turns, speed = f.TWO_FLOATS.unpack(frames[0x009])
    assert turns == pytest.approx((robot.state.x - 3.05) / (2 * pi * 0.04), rel=1e-6)
    assert speed == pytest.approx(robot.state.v / (2 * pi * 0.04), rel=1e-6)


def test_the_right_wheel_turns_the_robot_to_the_left() -> None:
    robot = robot_of()
    arm(robot, 0.1, -0.1)
    robot.advance(0.0, 0.01, 10)
    assert robot.state.omega > 0.0


def test_a_row_is_the_truth_and_the_torques_of_the_last_period() -> None:
    robot = robot_of()
    arm(robot, 0.1, 0.05)
    robot.advance(0.0, 0.001, 1)
    row = dict(zip(COLUMNS, robot.row(0.001), strict=True))
    assert row["t_s"] == 0.001
    assert row["v_m_s"] == robot.state.v
    assert row["demand_right_wheel_N_m"] == row["motor_right_wheel_N_m"] == pytest.approx(0.1)
    assert row["demand_left_wheel_N_m"] == pytest.approx(0.05)


def test_feedback_comes_once_both_drives_have_taken_a_set_point() -> None:
    robot = robot_of()
    arm(robot, 0.0, 0.0)
    right = Frame(identifier(0, Command.SET_INPUT_TORQUE), f.ONE_FLOAT.pack(0.1))
    left = Frame(identifier(1, Command.SET_INPUT_TORQUE), f.ONE_FLOAT.pack(0.1))
    robot.on_frame(right, 5_000)
    assert robot.feedback(6_000) == ()
    robot.on_frame(left, 7_000)
    assert [frame.can_id for frame in robot.feedback(8_000)] == [0x009, 0x029]
    assert robot.feedback(9_000) == ()
