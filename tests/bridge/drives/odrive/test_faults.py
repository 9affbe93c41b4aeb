"""What goes wrong between a host and a drive, and what an axis with firmware 0.6 does then."""

from math import inf, nan

import pytest
from drive_bench import MS, NODE, SERIAL, Bench
from hypothesis import given
from hypothesis import strategies as st

from bridge.drives.feeling import Feeling
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisError, AxisState, Command
from bridge.drives.odrive.frames import ProcedureResult as Result
from bridge.frame import EFF, ERR, RTR, Frame

WELL = Feeling(0.1, 2.0, 40.0, 45.0, 24.0, 1.0)


# --- set-points -----------------------------------------------------------------------------------


@pytest.mark.parametrize("length", range(4))
def test_missing_bytes_of_a_set_point_read_as_zero(length: int) -> None:
    bench = Bench().arm()
    data = f.ONE_FLOAT.pack(0.3)[:length]
    bench.tell(Command.SET_INPUT_TORQUE, data)
    (expected,) = f.ONE_FLOAT.unpack(data.ljust(4, b"\0"))
    assert bench.demand() == pytest.approx(expected, abs=1e-30)


def test_bytes_beyond_a_set_point_are_ignored() -> None:
    bench = Bench().arm()
    bench.tell(Command.SET_INPUT_TORQUE, f.ONE_FLOAT.pack(0.3) + b"\xff\xff\xff\xff")
    assert bench.demand() == pytest.approx(0.3)


@pytest.mark.parametrize(
    "command",
    [Command.SET_INPUT_TORQUE, Command.SET_AXIS_STATE, Command.SET_LIMITS, Command.REBOOT],
)
def test_a_remote_frame_where_data_is_expected_is_ignored(command: Command) -> None:
    bench = Bench().arm()
    bench.torque(0.3)
    assert bench.tell(command, bytes(8), flags=RTR) == []
    assert bench.demand() == pytest.approx(0.3)


def test_a_torque_that_is_no_number_disarms_with_an_error() -> None:
    bench = Bench().arm()
    bench.torque(nan)
    assert bench.demand() == 0.0
    assert bench.heartbeat().errors == AxisError.BAD_CONFIG
    assert bench.heartbeat().state == AxisState.IDLE


@pytest.mark.parametrize("value", [inf, -inf, 3.4e38, -3.4e38, 1e-45])
def test_infinite_huge_and_denormal_torques_are_clamped(value: float) -> None:
    bench = Bench().arm()
    bench.torque(value)
    assert abs(bench.demand()) <= 0.5
    assert bench.node.state is AxisState.CLOSED_LOOP_CONTROL


def test_a_torque_over_the_limit_is_clamped_silently() -> None:
    bench = Bench().arm()
    bench.torque(0.7)
    assert bench.demand() == pytest.approx(0.5)
    assert bench.heartbeat().errors == 0
    assert bench.node.input_torque == pytest.approx(0.7)


@pytest.mark.parametrize("limits", [(nan, 5.0), (5.0, nan), (-1.0, 5.0), (5.0, -inf)])
def test_limits_that_make_no_sense_change_nothing(limits: tuple[float, float]) -> None:
    bench = Bench().arm()
    bench.torque(0.4)
    bench.tell(Command.SET_LIMITS, f.TWO_FLOATS.pack(*limits))
    assert bench.demand() == pytest.approx(0.4)


def test_a_set_point_sent_while_idle_acts_on_arming() -> None:
    bench = Bench()
    bench.torque(0.2)
    assert bench.demand() == 0.0
    assert bench.arm().demand() == pytest.approx(0.2)


def test_of_a_burst_of_a_thousand_set_points_the_last_one_wins() -> None:
    bench = Bench().arm()
    for n in range(1000):
        bench.torque(n * 1e-4)
    assert bench.demand() == pytest.approx(0.0999)


def test_velocity_and_position_set_points_overwrite_torque_in_torque_control() -> None:
    bench = Bench().arm()
    bench.torque(0.3)
    bench.tell(Command.SET_INPUT_VEL, f.TWO_FLOATS.pack(1.0, 0.05))
    assert bench.demand() == pytest.approx(0.05)
    bench.tell(Command.SET_INPUT_POS, f.INPUT_POS.pack(1.0, 0, 70))
    assert bench.demand() == pytest.approx(0.07)


# --- arming ---------------------------------------------------------------------------------------


def test_an_unknown_axis_state_is_answered_as_invalid_and_idle() -> None:
    bench = Bench()
    bench.state(99)
    assert bench.heartbeat()[1:3] == (AxisState.IDLE, Result.INVALID_STATE)


@pytest.mark.parametrize("modes", [(7, 1), (1, 99), (0, 1), (1, 7), (1, 8)])
def test_an_invalid_control_or_input_mode_disarms(modes: tuple[int, int]) -> None:
    bench = Bench().arm()
    bench.modes(*modes)
    assert bench.heartbeat().state == AxisState.IDLE
    assert bench.heartbeat().errors == AxisError.BAD_CONFIG


def test_a_drive_that_is_not_calibrated_refuses_to_arm_until_it_was() -> None:
    bench = Bench(calibrated=False)
    bench.state(AxisState.CLOSED_LOOP_CONTROL)
    assert bench.heartbeat()[1:3] == (AxisState.IDLE, Result.NOT_CALIBRATED)
    bench.state(AxisState.FULL_CALIBRATION_SEQUENCE)
    assert bench.heartbeat()[1:3] == (AxisState.FULL_CALIBRATION_SEQUENCE, Result.BUSY)
    bench.wait(2.6)
    assert bench.heartbeat()[1:3] == (AxisState.IDLE, Result.SUCCESS)
    bench.arm()


def test_a_calibration_that_is_broken_off_is_cancelled() -> None:
    bench = Bench(calibrated=False)
    bench.state(AxisState.MOTOR_CALIBRATION)
    bench.state(AxisState.IDLE)
    assert bench.heartbeat()[1:3] == (AxisState.IDLE, Result.CANCELLED)
    bench.wait(3.0)
    assert not bench.node.calibrated


def test_arming_with_an_active_error_is_refused() -> None:
    bench = Bench()
    bench.tell(Command.ESTOP)
    bench.state(AxisState.CLOSED_LOOP_CONTROL)
    assert bench.heartbeat()[1:3] == (AxisState.IDLE, Result.DISARMED)


def test_an_emergency_stop_may_be_set_not_to_block_arming() -> None:
    bench = Bench(estop_blocks_arming=False)
    bench.tell(Command.ESTOP)
    bench.arm()


def test_arming_twice_and_clearing_while_armed_are_harmless() -> None:
    bench = Bench().arm()
    bench.torque(0.2)
    bench.arm()
    bench.tell(Command.CLEAR_ERRORS, b"\0")
    assert bench.demand() == pytest.approx(0.2)


def test_a_stop_under_torque_takes_the_torque_at_once() -> None:
    bench = Bench().arm()
    bench.torque(0.4)
    bench.state(AxisState.IDLE)
    assert bench.demand() == 0.0


def test_an_emergency_stop_latches_until_errors_are_cleared() -> None:
    bench = Bench().arm()
    bench.torque(0.4)
    bench.tell(Command.ESTOP)
    assert bench.demand() == 0.0
    assert bench.heartbeat().errors == AxisError.ESTOP_REQUESTED
    bench.tell(Command.CLEAR_ERRORS)
    assert bench.heartbeat().errors == 0
    bench.arm()


def test_a_reboot_while_armed_is_refused() -> None:
    bench = Bench().arm()
    bench.torque(0.3)
    bench.tell(Command.REBOOT, b"\0")
    assert bench.demand() == pytest.approx(0.3)


def test_a_reboot_forgets_the_set_point_and_a_saving_one_keeps_the_rates() -> None:
    bench = Bench()
    bench.torque(0.3)
    bench.tell(Command.REBOOT, b"\0")
    assert bench.arm().demand() == 0.0
    bench.state(AxisState.IDLE)
    bench.node.set_encoder_period(20 * MS)
    bench.tell(Command.REBOOT, b"\1")
    assert bench.node.encoder_period_ns == 20 * MS
    bench.tell(Command.REBOOT, b"\2")
    assert bench.node.encoder_period_ns == 10 * MS


@pytest.mark.parametrize(
    ("command", "data"), [(Command.REBOOT, b"\3"), (Command.ENTER_DFU_MODE, b"")]
)
def test_in_its_boot_loader_an_axis_is_deaf_and_silent(command: Command, data: bytes) -> None:
    bench = Bench()
    bench.tell(command, data)
    assert bench.wait(1.0) == []
    assert bench.tell(Command.GET_VERSION) == []


# --- silence --------------------------------------------------------------------------------------


def test_silence_with_a_watchdog_disarms_at_its_time() -> None:
    bench = Bench(watchdog_ns=50 * MS).arm()
    bench.torque(0.3)
    bench.wait(0.05)
    assert bench.demand() == pytest.approx(0.3)
    bench.wait(0.001)
    assert bench.demand() == 0.0
    assert bench.heartbeat().errors == AxisError.WATCHDOG_TIMER_EXPIRED


def test_silence_without_a_watchdog_leaves_the_last_torque_for_ever() -> None:
    bench = Bench().arm()
    bench.torque(0.3)
    bench.wait(60.0)
    assert bench.demand() == pytest.approx(0.3)


# --- frames for others, and nonsense --------------------------------------------------------------


@pytest.mark.parametrize("flag", [EFF, ERR])
def test_a_29_bit_identifier_or_an_error_frame_with_our_number_is_ignored(flag: int) -> None:
    bench = Bench().arm()
    bench.torque(0.3)
    bench.tell(Command.SET_INPUT_TORQUE, f.ONE_FLOAT.pack(0.1), flags=flag)
    bench.tell(Command.ESTOP, flags=flag)
    assert bench.demand() == pytest.approx(0.3)


def test_a_frame_for_another_node_is_ignored() -> None:
    bench = Bench().arm()
    frame = Frame(f.identifier(NODE + 1, Command.SET_INPUT_TORQUE), f.ONE_FLOAT.pack(0.4))
    bench.node.hear(frame, 0)
    assert bench.demand() == 0.0


@pytest.mark.parametrize("command", [0x08, 0x0A, 0x10, 0x1E, 0x05])
def test_an_unknown_command_is_ignored_and_counted(command: int) -> None:
    bench = Bench()
    assert bench.node.hear(Frame(NODE << 5 | command, bytes(8)), 0) == ()
    assert bench.node.ignored == 1


def test_spoofed_telemetry_on_its_own_identifier_is_ignored() -> None:
    bench = Bench().arm()
    bench.torque(0.3)
    assert bench.tell(Command.HEARTBEAT, f.HEARTBEAT.pack(0x40, 1, 0, 0, 0)) == []
    assert bench.tell(Command.GET_ENCODER_ESTIMATES, f.TWO_FLOATS.pack(9.0, 9.0)) == []
    assert bench.demand() == pytest.approx(0.3)


def test_an_address_is_taken_by_its_serial_number_and_given_up_to_a_foreign_one() -> None:
    bench = Bench()
    bench.tell(Command.ADDRESS, bytes((7,)) + SERIAL.to_bytes(6, "little"))
    assert bench.node.node_id == 7
    bench.tell(Command.ADDRESS, bytes((9,)) + (1).to_bytes(6, "little"))
    assert bench.node.node_id == 7  # foreign, and another id
    bench.tell(Command.ADDRESS, bytes((7,)) + (1).to_bytes(6, "little") + b"\0")
    assert bench.node.node_id == f.UNADDRESSED


def test_an_address_of_one_byte_is_ignored() -> None:
    bench = Bench()
    assert bench.tell(Command.ADDRESS, b"\7") == []
    assert bench.node.node_id == NODE


def test_an_axis_without_address_answers_a_query_after_a_random_delay() -> None:
    bench = Bench()
    bench.node.readdress(f.UNADDRESSED)
    assert bench.tell(Command.ADDRESS, flags=RTR) == []
    said = [frame for frame in bench.wait(0.2) if frame.can_id & 0x1F == Command.ADDRESS]
    assert len(said) == 1
    assert said[0].can_id == f.identifier(f.UNADDRESSED, Command.ADDRESS)
    assert said[0].data[1:7] == SERIAL.to_bytes(6, "little")


@pytest.mark.parametrize(
    "data", [b"", b"\0\0\1", b"\2\0\1\0", b"\0\xff\xff\0", b"\1\0\1\0\0\0\0\0"]
)
def test_sdo_that_is_short_unknown_or_writes_what_is_read_only_gets_no_reply(data: bytes) -> None:
    assert Bench().tell(Command.RX_SDO, data) == []


# --- encoder, heat, voltage -----------------------------------------------------------------------


@pytest.mark.parametrize("motion", [(0.0, 0.0), (1000.0, 0.0), (-3.0, -2.0)])
def test_a_frozen_jumping_or_reversed_encoder_leaves_a_torque_driven_axis_driving(
    motion: tuple[float, float],
) -> None:
    bench = Bench().arm()
    bench.node.feed(1.0, 1.0)
    bench.torque(0.1)
    bench.node.feed(*motion)
    bench.wait(0.1)
    assert bench.demand() == pytest.approx(0.1)


@pytest.mark.parametrize(("celsius", "share"), [(100.0, 1.0), (110.0, 0.5), (119.0, 0.05)])
def test_heat_derates_the_current_before_it_trips(celsius: float, share: float) -> None:
    bench = Bench().arm()
    bench.torque(1.0)
    for hot in (WELL._replace(fet_C=celsius), WELL._replace(motor_C=celsius)):
        bench.node.feel(hot)
        assert bench.demand() == pytest.approx(0.5 * share)


def test_a_missing_thermistor_reads_nan_and_derates_nothing() -> None:
    bench = Bench().arm()
    bench.torque(1.0)
    bench.node.feel(WELL._replace(motor_C=nan))
    assert bench.demand() == pytest.approx(0.5)
    (frame,) = bench.tell(Command.GET_TEMPERATURE)
    fet, motor = f.TWO_FLOATS.unpack(frame.data)
    assert (fet, motor != motor) == (40.0, True)


@pytest.mark.parametrize(
    ("bad", "error"),
    [
        (WELL._replace(fet_C=126.0), AxisError.INVERTER_OVER_TEMP),
        (WELL._replace(motor_C=126.0), AxisError.MOTOR_OVER_TEMP),
        (WELL._replace(bus_V=9.0), AxisError.DC_BUS_UNDER_VOLTAGE),
        (WELL._replace(bus_V=31.0), AxisError.DC_BUS_OVER_VOLTAGE),
    ],
)
def test_heat_and_voltage_out_of_range_disarm_and_refuse_arming(
    bad: Feeling, error: AxisError
) -> None:
    bench = Bench().arm()
    bench.torque(0.2)
    bench.node.feel(bad)
    assert bench.demand() == 0.0
    assert bench.heartbeat().errors == error
    bench.tell(Command.CLEAR_ERRORS)
    bench.state(AxisState.CLOSED_LOOP_CONTROL)
    assert bench.heartbeat()[1:3] == (AxisState.IDLE, Result.DISARMED)
    bench.node.feel(WELL)
    bench.tell(Command.CLEAR_ERRORS)
    bench.arm()


# --- whatever comes -------------------------------------------------------------------------------

floats = st.sampled_from([0.0, 0.1, -0.3, nan, inf, -inf, 3.4e38, 1e-45, 2.0])
payloads = st.one_of(
    st.binary(max_size=8),
    st.builds(f.TWO_FLOATS.pack, floats, floats),
    st.builds(f.ONE_U32.pack, st.sampled_from([0, 1, 2, 3, 4, 6, 7, 8, 13])),
    st.builds(f.TWO_U32.pack, st.integers(0, 4), st.integers(0, 9)),
)
frames = st.builds(
    Frame,
    st.builds(
        lambda node, command, flags: node << 5 | command | flags,
        st.sampled_from([NODE, NODE + 1, f.UNADDRESSED]),
        st.integers(0, 31),
        st.sampled_from([0, 0, 0, RTR, EFF, ERR]),
    ),
    payloads,
)
happenings = st.one_of(
    frames,
    st.integers(1, 300),  # milliseconds that pass
    st.builds(Feeling, floats, floats, st.floats(-50, 200), st.floats(-50, 200), floats, floats),
    st.tuples(st.floats(-1e9, 1e9), st.floats(-1e6, 1e6)),
)


@given(st.lists(happenings, max_size=60))
def test_whatever_comes_no_torque_is_wrong_and_time_goes_on(events: list[object]) -> None:
    bench = Bench(watchdog_ns=100 * MS)
    node = bench.node
    for event in events:
        fed_ns = node.fed_ns
        match event:
            case Frame():
                node.hear(event, bench.now_ns)
                command = event.can_id & 0x1F
                feeding = (
                    Command.SET_INPUT_POS,
                    Command.SET_INPUT_VEL,
                    Command.SET_INPUT_TORQUE,
                    Command.SET_AXIS_STATE,
                    Command.REBOOT,
                )
                if command not in feeding or event.can_id & (RTR | EFF | ERR):
                    assert node.fed_ns == fed_ns
            case Feeling():
                node.feel(event)
            case int():
                bench.now_ns += event * MS
                for frame in node.due(bench.now_ns):
                    assert len(frame.data) <= 8
                assert node.next_due_ns > bench.now_ns
            case (position, velocity):
                node.feed(position, velocity)
        torque = node.torque_demand(0.001)
        assert abs(torque) <= 0.5 or node.control.current_limit > 10.0
        assert torque == torque
        if node.state is not AxisState.CLOSED_LOOP_CONTROL:
            assert torque == 0.0
