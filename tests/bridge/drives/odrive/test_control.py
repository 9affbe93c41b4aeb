"""Control and input modes against their closed forms."""

from itertools import pairwise
from math import exp, nan, pi

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from support.odrive_axis import MS, arm, asked, axis, beat, floats, modes, tell, torque

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisError, AxisState, Command, ControlMode, InputMode
from bridge.drives.odrive.node import OdriveNode
from bridge.drives.odrive.trapezoid import plan

UNWATCHED = {"watchdog_ns": 0}


def position(node: OdriveNode, revolutions: float, vel_ff: int = 0, torque_ff: int = 0) -> None:
    tell(node, Command.SET_INPUT_POS, f.INPUT_POS.pack(revolutions, vel_ff, torque_ff))


def spin(node: OdriveNode, seconds: float, inertia: float = 0.01, dt: float = 0.001) -> list[float]:
    """A flywheel [N·m·s²/rad] on the axis; its speeds [rev/s]."""
    at, speed, speeds = node.position, node.velocity, []
    for _ in range(round(seconds / dt)):
        speed += node.torque_demand_shaft(dt) / inertia * dt / (2 * pi)
        at += speed * dt
        node.update_encoder(at, speed)
        speeds.append(speed)
    return speeds


def test_velocity_mode_is_proportional_and_integral_with_feed_forward() -> None:
    node = axis(**UNWATCHED)
    modes(node, ControlMode.VELOCITY)
    floats(node, Command.SET_VEL_GAINS, 0.1, 0.5)
    arm(node)
    floats(node, Command.SET_INPUT_VEL, 2.0, 0.05)
    assert node.torque_demand_shaft(0.01) == pytest.approx(0.05 + 0.1 * 2.0)
    assert node.torque_demand_shaft(0.01) == pytest.approx(0.05 + 0.1 * 2.0 + 0.5 * 2.0 * 0.01)
    node.update_encoder(0.0, 3.0)
    assert node.torque_demand_shaft(0.01) == pytest.approx(0.05 - 0.1 + 2 * 0.01)


def test_velocity_mode_reaches_its_velocity() -> None:
    node = axis(**UNWATCHED)
    modes(node, ControlMode.VELOCITY)
    floats(arm(node), Command.SET_INPUT_VEL, 3.0, 0.0)
    assert spin(node, 6.0)[-1] == pytest.approx(3.0, abs=0.01)


def test_the_velocity_limit_holds_in_velocity_mode_and_the_current_limit_everywhere() -> None:
    node = axis(**UNWATCHED)
    modes(node, ControlMode.VELOCITY)
    floats(node, Command.SET_LIMITS, 4.0, 1.0)
    floats(arm(node), Command.SET_INPUT_VEL, 9.0, 0.0)
    assert node.torque_demand_shaft(0.001) == pytest.approx(1.0 * 0.05)
    speeds = spin(node, 20.0)
    assert speeds[-1] == pytest.approx(4.0, abs=0.02)
    assert node.state is AxisState.CLOSED_LOOP_CONTROL


def test_position_mode_is_a_cascade_over_velocity_mode() -> None:
    node = axis(**UNWATCHED)
    node.update_encoder(1.0, 0.5)
    modes(node, ControlMode.POSITION)
    floats(node, Command.SET_POS_GAIN, 4.0)
    floats(node, Command.SET_VEL_GAINS, 0.1, 0.0)
    arm(node)
    position(node, 1.25, vel_ff=250, torque_ff=20)
    assert node.torque_demand_shaft(0.001) == pytest.approx(0.02 + 0.1 * (4.0 * 0.25 + 0.25 - 0.5))


def test_position_mode_reaches_its_position() -> None:
    node = axis(**UNWATCHED)
    modes(node, ControlMode.POSITION)
    floats(node, Command.SET_POS_GAIN, 4.0)
    arm(node)
    position(node, 1.5)
    spin(node, 10.0)
    assert node.position == pytest.approx(1.5, abs=0.01)


def test_arming_in_position_mode_holds_the_place_where_the_axis_is() -> None:
    node = axis(**UNWATCHED)
    modes(node, ControlMode.POSITION)
    position(node, 100.0)
    node.update_encoder(7.0, 0.0)
    assert arm(node).torque_demand_shaft(0.001) == 0.0


def test_a_velocity_ramp_rises_at_its_rate_and_feeds_inertia_forward() -> None:
    node = axis(velocity_ramp_shaft_rev_s2=2.0, **UNWATCHED)
    modes(node, ControlMode.VELOCITY, InputMode.VEL_RAMP)
    floats(node, Command.SET_VEL_GAINS, 0.1, 0.0)
    floats(node, Command.SET_TRAJ_INERTIA, 0.03)
    floats(arm(node), Command.SET_INPUT_VEL, 1.0, 0.0)
    demands = [node.torque_demand_shaft(0.1) for _ in range(8)]
    ramp = [0.1 * 0.2 * n + 0.06 for n in range(1, 6)]
    assert demands == pytest.approx([*ramp, 0.1, 0.1, 0.1])


def test_a_torque_ramp_rises_at_its_rate() -> None:
    node = axis(torque_ramp_shaft_N_m_s=0.5, **UNWATCHED)
    modes(node, ControlMode.TORQUE, InputMode.TORQUE_RAMP)
    torque(arm(node), 0.12)
    assert [node.torque_demand_shaft(0.1) for _ in range(4)] == pytest.approx(
        [0.05, 0.1, 0.12, 0.12]
    )


def test_a_position_filter_is_critically_damped_of_second_order() -> None:
    node = axis(input_filter_bandwidth_1_s=2.0, **UNWATCHED)
    modes(node, ControlMode.POSITION, InputMode.POS_FILTER)
    arm(node)
    position(node, 1.0)
    for _ in range(10_000):
        node.torque_demand_shaft(0.0001)
    expected = 1.0 - (1.0 + 2.0) * exp(-2.0)
    assert node.controller.position_setpoint == pytest.approx(expected, abs=1e-3)


def test_a_trapezoidal_move_sets_trajectory_done_when_it_is() -> None:
    node = axis(**UNWATCHED)
    modes(node, ControlMode.POSITION, InputMode.TRAP_TRAJ)
    floats(node, Command.SET_TRAJ_VEL_LIMIT, 1.0)
    floats(node, Command.SET_TRAJ_ACCEL_LIMITS, 2.0, 4.0)
    arm(node)
    assert beat(node).trajectory_done
    position(node, 2.0)
    duration = 2.0 / 1.0 + 0.5 * (1.0 / 2.0 + 1.0 / 4.0)
    spin(node, duration - 0.01)
    assert not beat(node).trajectory_done
    spin(node, 0.02)
    assert beat(node).trajectory_done
    assert node.controller.position_setpoint == 2.0


@pytest.mark.parametrize("control", [ControlMode.VOLTAGE, 4, 0xFFFF_FFFF])
def test_a_control_mode_that_does_not_exist_disarms(control: int) -> None:
    node = arm(axis())
    modes(node, control)
    assert beat(node)[:2] == (AxisError.BAD_CONFIG, AxisState.IDLE)


@pytest.mark.parametrize("inputs", [InputMode.MIRROR, InputMode.TUNING, 4, 9, 0xFFFF_FFFF])
def test_an_input_mode_that_does_not_exist_disarms_and_keeps_from_arming(inputs: int) -> None:
    node = arm(axis())
    modes(node, ControlMode.TORQUE, inputs)
    assert beat(node)[:2] == (AxisError.BAD_CONFIG, AxisState.IDLE)
    tell(node, Command.CLEAR_ERRORS)
    tell(node, Command.SET_AXIS_STATE, f.ONE_U32.pack(8))
    assert beat(node)[:2] == (AxisError.BAD_CONFIG, AxisState.IDLE)


def test_gains_that_are_no_numbers_or_negative_change_nothing() -> None:
    node = axis(**UNWATCHED)
    modes(node, ControlMode.VELOCITY)
    for bad in ((nan, 0.1), (0.1, nan), (-0.1, 0.1), (0.1, -0.1)):
        floats(node, Command.SET_VEL_GAINS, *bad)
    floats(node, Command.SET_POS_GAIN, nan)
    floats(node, Command.SET_TRAJ_VEL_LIMIT, -1.0)
    floats(arm(node), Command.SET_INPUT_VEL, 0.6, 0.0)
    assert node.torque_demand_shaft(0.0) == pytest.approx(0.1)
    assert node.ignored == 6


def test_torques_are_told_after_limits() -> None:
    node = arm(axis())
    torque(node, 5.0)
    node.torque_demand_shaft(0.001)
    assert asked(node, Command.GET_TORQUES) == (0.5, 0.5)
    assert asked(node, Command.GET_IQ) == (10.0, 10.0)
    assert node.input_torque_shaft == 5.0


@given(
    st.tuples(st.floats(-50, 50), st.floats(-5, 5), st.floats(-50, 50)),
    st.tuples(st.floats(0.1, 5), st.floats(0.1, 5), st.floats(0.1, 5)),
)
@example((0.0, 1.43, 1.0), (1.0, 3.8, 0.6))
@example((0.0, 3.0, 5.0), (1.0, 0.6, 3.8))
def test_a_trapezoid_keeps_its_limits_and_ends_at_rest_in_its_goal(ends, limits) -> None:
    start, velocity, goal = ends
    move = plan(start, velocity, goal, limits)
    assert move is not None
    step = move.duration_s / 200
    points = [move.point_at(n * step) for n in range(201)]
    assert points[0][:2] == pytest.approx((start, velocity), abs=1e-6)
    assert move.point_at(move.duration_s) == (goal, 0.0, 0.0)
    fastest = max(limits[0], abs(velocity))
    for one, two in pairwise(points):
        assert abs(two.velocity) <= fastest + 1e-6
        assert abs(two.velocity - one.velocity) <= max(limits[1:]) * step + 1e-6
        assert abs(two.position - one.position) <= fastest * step + 1e-6


def test_a_trajectory_without_acceleration_is_not_begun() -> None:
    assert plan(0.0, 0.0, 1.0, (1.0, 0.0, 1.0)) is None
    node = axis(**UNWATCHED)
    modes(node, ControlMode.POSITION, InputMode.TRAP_TRAJ)
    floats(node, Command.SET_TRAJ_ACCEL_LIMITS, 0.0, 0.0)
    arm(node)
    position(node, 2.0)
    assert node.torque_demand_shaft(MS * 1e-9) == 0.0
