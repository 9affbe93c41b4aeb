"""A robot whose motion diverges stands still and says so; no set-point does more."""

from math import inf, isfinite, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisError, AxisState, Command, identifier
from bridge.frame import Frame
from configs.connections import NetworkLink
from configs.loading import load
from configs.resolve import plant_brief
from plant.robot import EmulatedRobot, emulated_robot
from plant.troubles import diverged_robots

FLT_MAX = 3.4028234663852886e38
ABSURD = (FLT_MAX, -FLT_MAX, 1e6, 1e30, inf, -inf, nan, -0.0, 1e-45, 0.1)
PERIOD_NS = 1_000_000
NOWHERE = NetworkLink("t", "", "", "")


def robot_of(preset: str = "ideal", *overrides: str) -> EmulatedRobot:
    changes = (
        f"drive.preset='{preset}'",
        "robot.r1.v_m_s=0.0",
        "drive.watchdog_s=0.0",
        "clock.control_period_s=0.001",
        *overrides,
    )
    return emulated_robot(plant_brief(load("two_robots", changes), network=NOWHERE).robots[0])


def tell(robot: EmulatedRobot, node: int, command: Command, data: bytes, now_ns: int = 0) -> None:
    robot.on_frame(Frame(identifier(node, command), data), now_ns)


def arm(robot: EmulatedRobot) -> None:
    for node in (0, 1):
        tell(robot, node, Command.SET_AXIS_STATE, f.ONE_U32.pack(AxisState.CLOSED_LOOP_CONTROL))


def go_on(robot: EmulatedRobot, ticks: int, first: int = 0) -> list[Frame]:
    frames = []
    for k in range(first, first + ticks):
        frames += robot.frames_due(k * PERIOD_NS)
        robot.advance(k * 1e-3, 1e-3, 1)
    return frames


def beats(frames: list[Frame], node: int) -> list[f.Heartbeat]:
    wanted = identifier(node, Command.HEARTBEAT)
    return [f.decode_heartbeat(frame.data) for frame in frames if frame.can_id == wanted]


@pytest.mark.parametrize("torque", [1e6, FLT_MAX, -FLT_MAX])
def test_an_absurd_torque_on_an_ideal_drive_ends_the_motion_of_its_robot(torque: float) -> None:
    robot = robot_of()
    arm(robot)
    tell(robot, 0, Command.SET_INPUT_TORQUE, f.ONE_FLOAT.pack(torque))
    frames = go_on(robot, 201)
    assert robot.divergence is not None
    assert robot.divergence.right_wheel_N_m == pytest.approx(torque)
    assert (robot.state.v, robot.state.omega) == (0.0, 0.0)
    held = robot.state
    for node in (0, 1):
        last = beats(frames, node)[-1]
        assert last.errors == AxisError.MISSING_ESTIMATE
        assert last.state == AxisState.IDLE
    go_on(robot, 10, first=201)
    assert robot.state == held


def test_its_drives_can_not_be_armed_again_whatever_a_client_does() -> None:
    robot = robot_of("ideal", "drive.boot_s=0.0")
    arm(robot)
    tell(robot, 0, Command.SET_INPUT_TORQUE, f.ONE_FLOAT.pack(FLT_MAX))
    go_on(robot, 2)
    for node in (0, 1):
        tell(robot, node, Command.CLEAR_ERRORS, b"\0")
    arm(robot)
    tell(robot, 0, Command.REBOOT, b"\0", 5 * PERIOD_NS)
    arm(robot)
    assert {beat.state for beat in beats(go_on(robot, 200, first=6), 0)} == {AxisState.IDLE}
    assert robot.row(0.0)[6:] == (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_the_tick_whose_torques_did_it_is_named_with_the_last_sound_motion() -> None:
    robot = robot_of()
    arm(robot)
    go_on(robot, 7)
    assert diverged_robots([robot], PERIOD_NS) == {}
    tell(robot, 1, Command.SET_INPUT_TORQUE, f.ONE_FLOAT.pack(1e30))
    go_on(robot, 3, first=7)
    assert diverged_robots([robot], PERIOD_NS) == {
        "r1": "tick 7 (t = 0.007 s): its motion diverged: v = 0 m/s, ω = 0 rad/s under wheel"
        " torques of 0 and 1e+30 N·m"
    }


def test_bodies_that_start_beyond_all_bounds_diverge_at_once() -> None:
    robot = robot_of("realistic")
    robot.state = robot.state._replace(v=1e6)
    go_on(robot, 1)
    assert robot.divergence is not None


@settings(deadline=None, max_examples=150)
@given(
    preset=st.sampled_from(["ideal", "limited", "realistic"]),
    control_mode=st.sampled_from([1, 2, 3]),
    input_mode=st.sampled_from([0, 1, 2, 3, 5, 6]),
    wanted=st.tuples(*[st.sampled_from(ABSURD)] * 2),
    parameters=st.tuples(*[st.sampled_from(ABSURD)] * 6),
)
def test_no_set_point_in_any_mode_makes_more_of_a_robot_than_numbers(
    preset: str,
    control_mode: int,
    input_mode: int,
    wanted: tuple[float, float],
    parameters: tuple[float, ...],
) -> None:
    robot = robot_of(preset)
    for node in (0, 1):
        two = f.TWO_FLOATS.pack
        tell(robot, node, Command.SET_LIMITS, two(*parameters[:2]))
        tell(robot, node, Command.SET_VEL_GAINS, two(*parameters[2:4]))
        tell(robot, node, Command.SET_TRAJ_ACCEL_LIMITS, two(*parameters[4:6]))
        tell(robot, node, Command.SET_TRAJ_INERTIA, f.ONE_FLOAT.pack(parameters[0]))
        tell(robot, node, Command.SET_CONTROLLER_MODE, f.TWO_U32.pack(control_mode, input_mode))
    arm(robot)
    tell(robot, 0, Command.SET_INPUT_POS, f.ONE_FLOAT.pack(wanted[0]))
    tell(robot, 1, Command.SET_INPUT_VEL, f.TWO_FLOATS.pack(*wanted))
    tell(robot, 1, Command.SET_ABSOLUTE_POSITION, f.ONE_FLOAT.pack(wanted[0]))
    frames = go_on(robot, 5)
    tell(robot, 1, Command.SET_INPUT_TORQUE, f.ONE_FLOAT.pack(wanted[1]))
    frames += go_on(robot, 5, first=5)
    assert all(map(isfinite, robot.state))
    assert all(map(isfinite, robot.row(0.0)))
    encoders = [x.data for x in frames if x.can_id & 0x1F == Command.GET_ENCODER_ESTIMATES]
    assert len(encoders) == 20
    assert all(isfinite(value) for data in encoders for value in f.TWO_FLOATS.unpack(data))
