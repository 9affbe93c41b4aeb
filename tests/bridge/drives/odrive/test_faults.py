"""What hosts send wrongly, twice, too late or not at all, and what an axis makes of it."""

from math import inf, nan

import pytest
from support.odrive_axis import MS, NODE, arm, ask_state, axis, beat, floats, tell, torque

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisError, AxisState, Command, ProcedureResult
from bridge.frame import EFF, RTR, Frame

QUARTER = f.ONE_FLOAT.pack(0.25)  # 00 00 80 3e


@pytest.mark.parametrize("length", range(4))
def test_missing_bytes_of_a_set_point_read_as_zero(length: int) -> None:
    node = arm(axis())
    torque(node, 0.4)
    tell(node, Command.SET_INPUT_TORQUE, QUARTER[:length])
    (expected,) = f.ONE_FLOAT.unpack(QUARTER[:length].ljust(4, b"\0"))
    assert node.torque_demand_shaft(0.001) == expected


@pytest.mark.parametrize("length", range(4, 9))
def test_extra_bytes_of_a_set_point_are_ignored(length: int) -> None:
    node = arm(axis())
    tell(node, Command.SET_INPUT_TORQUE, (QUARTER + b"\xff" * 4)[:length])
    assert node.torque_demand_shaft(0.001) == 0.25


@pytest.mark.parametrize("length", [1, 4, 8])
def test_a_state_is_asked_for_with_any_length_hosts_use(length: int) -> None:
    node = axis()
    tell(node, Command.SET_AXIS_STATE, b"\x08".ljust(length, b"\0"))
    assert beat(node).state == AxisState.CLOSED_LOOP_CONTROL


def test_a_remote_frame_sets_nothing_and_clears_nothing() -> None:
    node = arm(axis())
    torque(node, 0.25, 5)
    for command in Command:
        if command not in (Command.ESTOP, Command.ADDRESS):
            node.on_frame(Frame(f.identifier(NODE, command) | RTR, bytes(8)), 7)
    assert (node.torque_demand_shaft(0.001), node.fed_ns) == (0.25, 5)
    node.estop()
    node.on_frame(Frame(f.identifier(NODE, Command.CLEAR_ERRORS) | RTR, b""), 8)
    assert beat(node).errors == AxisError.ESTOP_REQUESTED


def test_a_torque_that_is_no_number_disarms_with_an_error() -> None:
    for limiters in (True, False):
        node = arm(axis(torque_limiters=limiters))
        torque(node, nan)
        assert beat(node)[:3] == (AxisError.BAD_CONFIG, AxisState.IDLE, ProcedureResult.DISARMED)
        assert node.torque_demand_shaft(0.001) == 0.0


@pytest.mark.parametrize("command", [Command.SET_INPUT_VEL, Command.SET_INPUT_POS])
def test_a_velocity_or_position_that_is_no_number_disarms_with_an_error(command) -> None:
    node = arm(axis())
    floats(node, command, nan, 0.0)
    assert beat(node)[:2] == (AxisError.BAD_CONFIG, AxisState.IDLE)


@pytest.mark.parametrize(
    ("value", "expected"),
    [(inf, 0.5), (-inf, -0.5), (3.4e38, 0.5), (-3.4e38, -0.5), (1e-42, pytest.approx(0.0))],
)
def test_infinite_huge_and_denormal_torques_are_clamped(value, expected) -> None:
    node = arm(axis())
    torque(node, value)
    assert node.torque_demand_shaft(0.001) == expected


def test_torque_over_the_limit_is_clamped_without_an_error() -> None:
    node = arm(axis())
    torque(node, -7.0)
    assert node.torque_demand_shaft(0.001) == -0.5
    assert beat(node)[:2] == (AxisError(0), AxisState.CLOSED_LOOP_CONTROL)


@pytest.mark.parametrize("limits", [(nan, nan), (-1.0, -1.0), (-inf, 1.0), (5.0, nan), (-0.1, 5.0)])
def test_nonsense_limits_neither_reverse_the_torque_nor_make_it_no_number(limits) -> None:
    node = arm(axis())
    floats(node, Command.SET_LIMITS, *limits)
    torque(node, 0.3)
    assert node.torque_demand_shaft(0.001) == pytest.approx(0.3)


def test_infinite_limits_are_none() -> None:
    node = arm(axis())
    floats(node, Command.SET_LIMITS, inf, inf)
    node.update_encoder(0.0, 1e4)
    torque(node, 1e6)
    assert node.torque_demand_shaft(0.001) == 1e6


def test_limits_of_zero_mean_no_torque() -> None:
    node = arm(axis())
    floats(node, Command.SET_LIMITS, 10.0, 0.0)
    torque(node, 0.3)
    assert node.torque_demand_shaft(0.001) == 0.0


def test_an_unknown_state_is_refused() -> None:
    node = axis()
    ask_state(node, 99)
    assert beat(node)[1:3] == (AxisState.IDLE, ProcedureResult.INVALID_STATE)


def test_arming_while_an_error_is_active_is_refused() -> None:
    node = arm(axis())
    node.due(101 * MS)
    ask_state(node, AxisState.CLOSED_LOOP_CONTROL, 102 * MS)
    expected = (AxisError.WATCHDOG_TIMER_EXPIRED, AxisState.IDLE, ProcedureResult.DISARMED)
    assert beat(node, 102 * MS)[:3] == expected


def test_arming_twice_and_clearing_while_armed_are_harmless() -> None:
    node = arm(axis())
    torque(node, 0.25, 5)
    ask_state(node, AxisState.CLOSED_LOOP_CONTROL, 9)
    tell(node, Command.CLEAR_ERRORS, b"\0", 9)
    assert (node.torque_demand_shaft(0.001), node.fed_ns) == (0.25, 5)
    assert beat(node)[:3] == (AxisError(0), AxisState.CLOSED_LOOP_CONTROL, ProcedureResult.SUCCESS)


def test_velocity_and_position_set_points_replace_the_torque_by_their_feed_forward() -> None:
    node = arm(axis())
    torque(node, 0.4)
    floats(node, Command.SET_INPUT_VEL, 9.0, -0.125, now_ns=7)
    assert (node.torque_demand_shaft(0.001), node.fed_ns) == (-0.125, 7)
    tell(node, Command.SET_INPUT_POS, f.INPUT_POS.pack(9.0, 1000, -250), 8)
    assert (node.torque_demand_shaft(0.001), node.fed_ns) == (-0.25, 8)
    tell(node, Command.SET_INPUT_VEL, f.ONE_FLOAT.pack(1.0))
    assert node.torque_demand_shaft(0.001) == 0.0


def test_a_torque_sent_while_idle_is_stored_and_acts_on_arming() -> None:
    node = axis()
    torque(node, 0.25)
    assert node.torque_demand_shaft(0.001) == 0.0
    assert arm(node).torque_demand_shaft(0.001) == 0.25


def test_idle_takes_the_torque_away_at_once() -> None:
    node = arm(axis())
    torque(node, 0.25)
    ask_state(node, AxisState.IDLE)
    assert node.torque_demand_shaft(0.001) == 0.0
    assert beat(node)[:3] == (AxisError(0), AxisState.IDLE, ProcedureResult.SUCCESS)


@pytest.mark.parametrize("can_id", [0x062, 0x062 | RTR])
def test_an_emergency_stop_acts_whatever_its_frame_and_latches(can_id: int) -> None:
    node = arm(axis())
    torque(node, 0.25)
    node.on_frame(Frame(can_id, b""), 0)
    assert node.torque_demand_shaft(0.001) == 0.0
    ask_state(node, AxisState.CLOSED_LOOP_CONTROL)
    assert beat(node)[:2] == (AxisError.ESTOP_REQUESTED, AxisState.IDLE)


def test_whether_an_emergency_stop_blocks_arming_is_a_setting() -> None:
    node = arm(axis(estop_blocks_arming=False))
    tell(node, Command.ESTOP)
    assert beat(node)[:2] == (AxisError.ESTOP_REQUESTED, AxisState.IDLE)
    arm(node)
    assert beat(node).errors == AxisError(0)


def test_an_emergency_stop_of_an_idle_drive_keeps_it_from_arming() -> None:
    node = axis()
    tell(node, Command.ESTOP)
    ask_state(node, AxisState.CLOSED_LOOP_CONTROL)
    assert beat(node)[:2] == (AxisError.ESTOP_REQUESTED, AxisState.IDLE)


def test_silence_disarms_by_the_watchdog_and_is_due_at_that_time() -> None:
    node = arm(axis(heartbeat_period_ns=0, encoder_period_ns=0))
    torque(node, 0.25, 30 * MS)
    assert node.next_due_ns == 130 * MS + 1
    node.due(130 * MS)
    assert node.torque_demand_shaft(0.001) == 0.25
    node.due(130 * MS + 1)
    assert node.torque_demand_shaft(0.001) == 0.0
    assert beat(node).errors == AxisError.WATCHDOG_TIMER_EXPIRED


def test_a_set_point_that_comes_too_late_does_not_save_the_drive() -> None:
    node = arm(axis())
    torque(node, 0.25, 101 * MS)
    assert node.torque_demand_shaft(0.001) == 0.0
    assert node.errors == AxisError.WATCHDOG_TIMER_EXPIRED


def test_silence_without_a_watchdog_leaves_the_last_torque_for_ever() -> None:
    node = arm(axis(watchdog_ns=0))
    torque(node, 0.25)
    for hour in range(1, 25):
        node.due(hour * 3600 * 1000 * MS)
        assert node.torque_demand_shaft(0.001) == 0.25


def test_a_29_bit_identifier_with_our_number_is_ignored() -> None:
    node = arm(axis())
    assert not node.on_frame(Frame(node.setpoint_id | EFF, QUARTER), 5)
    assert (node.torque_demand_shaft(0.001), node.fed_ns) == (0.0, 0)


@pytest.mark.parametrize("other", [0, 1, 2, 4, 62, 63])
def test_frames_for_other_nodes_are_ignored(other: int) -> None:
    node = arm(axis())
    torque(node, 0.25)
    for command in Command:
        if command is not Command.ADDRESS:
            assert not node.on_frame(Frame(f.identifier(other, command), bytes(8)), 5)
    assert (node.torque_demand_shaft(0.001), node.fed_ns, node.ignored) == (0.25, 0, 0)


@pytest.mark.parametrize("command", [0x08, 0x0A, 0x10, 0x1E])
def test_an_unknown_command_is_ignored_and_counted(command: int) -> None:
    node = arm(axis())
    torque(node, 0.25)
    assert not node.on_frame(Frame(NODE << f.BITS | command, bytes(8)), 5)
    assert (node.torque_demand_shaft(0.001), node.fed_ns, node.ignored) == (0.25, 0, 1)


def test_telemetry_that_somebody_imitates_is_ignored() -> None:
    node = arm(axis())
    before = beat(node)
    spoofs = [c for c in Command if c.name.startswith("GET_")] + [Command.HEARTBEAT, Command.TX_SDO]
    for command in spoofs:
        assert not node.on_frame(Frame(f.identifier(NODE, command), b"\xff" * 8), 5)
    assert (beat(node), node.fed_ns, node.ignored) == (before, 0, len(spoofs))


def test_of_two_drives_with_the_same_address_both_take_and_both_say_everything() -> None:
    one, two = axis(), axis()
    for node in (one, two):
        torque(arm(node), 0.25)
    assert one.torque_demand_shaft(0.001) == two.torque_demand_shaft(0.001) == 0.25
    assert [frame.can_id for frame in one.due(0)] == [frame.can_id for frame in two.due(0)]


def test_of_a_burst_the_last_set_point_wins() -> None:
    node = arm(axis())
    for n in range(1000):
        torque(node, n * 1e-4, n)
    assert node.torque_demand_shaft(0.001) == pytest.approx(0.0999)
    assert node.fed_ns == 999
