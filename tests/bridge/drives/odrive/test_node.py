"""The emulated axis: states, hazards, replies, and that nothing on the bus can break it."""

from math import inf, isfinite, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.odrive_axis import MS, NODE, SERIAL_NUMBER, arm, axis, beat, tell, torque

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisError, AxisState, Command
from bridge.frame import EFF, ERR, RTR, Frame


def test_a_drive_powers_up_idle_without_errors_and_makes_no_torque() -> None:
    node = axis()
    assert beat(node) == (AxisError(0), AxisState.IDLE, 0, True)
    torque(node, 0.2)
    assert node.torque_demand_shaft() == 0.0


def test_an_armed_drive_makes_the_torque_that_it_is_told() -> None:
    node = arm(axis())
    torque(node, 0.25)
    assert node.torque_demand_shaft() == 0.25


def test_torque_is_limited_by_current_and_by_speed() -> None:
    node = arm(axis())
    torque(node, 5.0)
    assert node.torque_demand_shaft() == pytest.approx(0.5)  # 10 A × 0.05 N·m/A
    node.update_encoder(0.0, 9.4)
    assert node.torque_demand_shaft() == pytest.approx(0.1)  # (10 − 9.4) rev/s × 1/6
    node.update_encoder(0.0, 10.6)
    assert node.torque_demand_shaft() == pytest.approx(-0.1)


def test_set_limits_takes_effect_and_nonsense_limits_do_not() -> None:
    node = arm(axis())
    tell(node, Command.SET_LIMITS, f.TWO_FLOATS.pack(10.0, 2.0))
    torque(node, 5.0)
    assert node.torque_demand_shaft() == pytest.approx(0.1)
    for bad in ((nan, 1.0), (1.0, nan), (-1.0, 1.0)):
        tell(node, Command.SET_LIMITS, f.TWO_FLOATS.pack(*bad))
        assert node.torque_demand_shaft() == pytest.approx(0.1)


def test_an_ideal_drive_limits_nothing() -> None:
    node = arm(axis(torque_limiters=False))
    torque(node, 690.0)
    assert node.torque_demand_shaft() == 690.0


def test_a_stale_torque_acts_at_once_on_re_arming() -> None:
    node = arm(axis())
    torque(node, 0.25)
    tell(node, Command.SET_AXIS_STATE, f.ONE_U32.pack(1))
    assert node.torque_demand_shaft() == 0.0
    assert arm(node).torque_demand_shaft() == 0.25


def test_the_stale_torque_hazard_can_be_turned_off() -> None:
    node = arm(axis(zero_torque_on_disarm=True))
    torque(node, 0.25)
    tell(node, Command.SET_AXIS_STATE, f.ONE_U32.pack(1))
    assert arm(node).torque_demand_shaft() == 0.0


def test_without_a_watchdog_the_last_torque_acts_for_ever() -> None:
    node = arm(axis(watchdog_ns=0))
    torque(node, 0.25)
    node.due(3600 * 1000 * MS)
    assert node.torque_demand_shaft() == 0.25


def test_the_watchdog_disarms_after_its_time_and_says_so() -> None:
    node = arm(axis())
    torque(node, 0.25, 50 * MS)
    node.due(150 * MS)
    assert node.torque_demand_shaft() == 0.25
    node.due(151 * MS)
    assert node.torque_demand_shaft() == 0.0
    heartbeat = beat(node)
    assert heartbeat.errors == AxisError.WATCHDOG_TIMER_EXPIRED
    assert heartbeat.state == AxisState.IDLE


def test_requests_and_frames_for_others_do_not_feed_the_watchdog() -> None:
    node = arm(axis())
    for t in range(101):
        node.on_frame(f.request(NODE, Command.GET_IQ), t * MS)
        node.on_frame(Frame(f.identifier(NODE + 1, Command.SET_INPUT_TORQUE), bytes(4)), t * MS)
        node.on_frame(Frame(f.identifier(NODE, Command.GET_ENCODER_ESTIMATES), bytes(8)), t * MS)
        node.on_frame(Frame(f.identifier(NODE, Command.SET_INPUT_TORQUE) | RTR, bytes(4)), t * MS)
    node.due(101 * MS)
    assert beat(node).errors == AxisError.WATCHDOG_TIMER_EXPIRED


def test_an_emergency_stop_latches_until_errors_are_cleared() -> None:
    node = arm(axis())
    torque(node, 0.25)
    tell(node, Command.ESTOP)
    assert node.torque_demand_shaft() == 0.0
    tell(node, Command.SET_AXIS_STATE, f.ONE_U32.pack(8))
    assert beat(node).state == AxisState.IDLE
    assert beat(node).errors == AxisError.ESTOP_REQUESTED
    tell(node, Command.CLEAR_ERRORS, b"\0")
    arm(node)


@pytest.mark.parametrize("length", [0, 1, 8])
def test_estop_and_clear_errors_work_with_any_length(length: int) -> None:
    node = arm(axis())
    tell(node, Command.ESTOP, bytes(length))
    assert beat(node).errors == AxisError.ESTOP_REQUESTED
    tell(node, Command.CLEAR_ERRORS, bytes(length))
    assert beat(node).errors == AxisError(0)


def test_overspeed_disarms() -> None:
    node = arm(axis())
    node.update_encoder(0.0, 12.1)
    node.due(1 * MS)
    assert beat(node).errors == AxisError.VELOCITY_LIMIT_VIOLATION


@pytest.mark.parametrize("value", [nan, inf, -inf, 3.4e38])
def test_no_torque_that_is_not_finite_ever_reaches_the_motor(value: float) -> None:
    for node in (arm(axis()), arm(axis(torque_limiters=False))):
        torque(node, value)
        assert isfinite(node.torque_demand_shaft())


def test_motion_beyond_what_the_wire_can_hold_saturates() -> None:
    node = axis(torque_limiters=False)
    node.update_encoder(1e60, -1e60)
    (frame,) = [frame for frame in node.due(0) if len(frame.data) == 8 and frame.can_id & 1][1:]
    position, speed = f.TWO_FLOATS.unpack(frame.data)
    assert (position, speed) == (pytest.approx(3.4028235e38), pytest.approx(-3.4028235e38))


def test_velocity_and_position_set_points_overwrite_torque_by_their_feed_forward() -> None:
    node = arm(axis())
    tell(node, Command.SET_INPUT_VEL, f.TWO_FLOATS.pack(3.0, 0.125))
    assert node.torque_demand_shaft() == 0.125
    tell(node, Command.SET_INPUT_POS, f.INPUT_POS.pack(1.0, 0, 250))
    assert node.torque_demand_shaft() == 0.25


def test_every_get_is_answered_to_a_remote_and_to_an_empty_frame() -> None:
    node = axis()
    for command in Command:
        if command.name.startswith("GET_") or command is Command.HEARTBEAT:
            for ask in (
                f.request(NODE, command),
                Frame(f.identifier(NODE, command) | RTR, b""),
                Frame(f.identifier(NODE, command), b""),
            ):
                (reply,) = node.on_frame(ask, 0)
                assert reply.can_id == f.identifier(NODE, command)
                assert len(reply.data) == 8


def test_cyclic_frames_keep_their_period_without_drift_even_when_looked_at_late() -> None:
    node = axis()
    times = [0, 1, 2, 5, 6, 7, 99, 100, 101, 203, 204, 299, 300]
    seen = [(t, len(node.due(t * MS))) for t in times]
    assert [t for t, n in seen if n == 2] == [0, 100, 203, 300]  # heartbeat as well
    assert all(n >= 1 for _, n in seen)


def test_version_says_firmware_0_6() -> None:
    (reply,) = axis().on_frame(f.request(NODE, Command.GET_VERSION), 0)
    assert tuple(reply.data[4:6]) == (0, 6)


def test_address_is_told_and_set_by_serial_number() -> None:
    node = axis()
    (reply,) = node.on_frame(f.request(f.UNADDRESSED, Command.ADDRESS), 0)
    assert reply.data[0] == NODE
    assert int.from_bytes(reply.data[1:7], "little") == SERIAL_NUMBER
    serial = SERIAL_NUMBER.to_bytes(6, "little")
    ask = Frame(f.identifier(f.UNADDRESSED, Command.ADDRESS), b"\x09" + serial)
    node.on_frame(ask, 0)
    assert node.node_id == 9
    torque(arm(node), 0.1)
    assert node.torque_demand_shaft() == pytest.approx(0.1)


def test_an_address_that_another_serial_number_takes_is_given_up() -> None:
    node = axis()
    other = (1).to_bytes(6, "little")
    node.on_frame(Frame(f.identifier(f.UNADDRESSED, Command.ADDRESS), bytes((NODE,)) + other), 0)
    assert node.node_id == f.UNADDRESSED


def test_reboot_goes_back_to_power_up_only_when_idle() -> None:
    node = arm(axis())
    torque(node, 0.25)
    tell(node, Command.REBOOT, b"\0")
    assert node.torque_demand_shaft() == 0.25
    tell(node, Command.SET_AXIS_STATE, f.ONE_U32.pack(1))
    tell(node, Command.REBOOT, b"\0")
    assert arm(node).torque_demand_shaft() == 0.0


def test_a_state_that_is_no_state_is_answered_as_invalid() -> None:
    node = axis()
    tell(node, Command.SET_AXIS_STATE, f.ONE_U32.pack(99))
    assert beat(node).result == f.ProcedureResult.INVALID_STATE


@given(st.binary(max_size=8), st.sampled_from([EFF, ERR]))
def test_extended_and_error_frames_are_ignored(data: bytes, flag: int) -> None:
    node = arm(axis())
    torque(node, 0.25)
    for command in Command:
        assert not node.on_frame(Frame(f.identifier(NODE, command) | flag, data), 0)
    assert node.torque_demand_shaft() == 0.25
