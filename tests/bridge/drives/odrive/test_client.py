"""The controller's end, against the emulated axes."""

from dataclasses import replace
from math import inf, nan, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.odrive_axis import MODEL, MS

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.client import OdriveClient
from bridge.drives.odrive.frames import AxisError, AxisState, Command, identifier
from bridge.drives.odrive.model import AxisModel
from bridge.drives.odrive.node import OdriveNode
from bridge.frame import EFF, ERR, RTR, Frame
from configs.brief import DriveLink
from configs.sections import PROTOCOL, Mounting

LINK = DriveLink(PROTOCOL.choose({}, ""), True, 0, 1, 1 * MS, Mounting())


class Robot:
    """Two axes and their client on an ideal bus."""

    def __init__(self, model: AxisModel = MODEL, link: DriveLink = LINK) -> None:
        self.axes = [OdriveNode(model, 0, 7), OdriveNode(model, 1, 8)]
        self.client = OdriveClient(link)
        self.now_ns = 0

    def tick(self, *answers: Frame) -> None:
        """A period: what the drives hear, and what they then say."""
        for frame in answers:
            for axis in self.axes:
                axis.on_frame(frame, self.now_ns)
        self.now_ns += MS
        for axis in self.axes:
            for frame in axis.due(self.now_ns):
                self.client.on_frame(frame.can_id, frame.data, self.now_ns)

    def arm(self) -> int:
        for count in range(1000):
            if self.client.armed:
                return count
            self.tick(*self.client.arm(self.now_ns))
        raise AssertionError("not armed after 1000 periods")


@pytest.fixture
def robot() -> Robot:
    return Robot()


def test_arming_ends_with_both_axes_in_closed_loop_at_zero_torque(robot: Robot) -> None:
    for axis in robot.axes:
        axis.input_torque_shaft = 0.4  # a stale one
    robot.arm()
    assert [axis.state for axis in robot.axes] == [AxisState.CLOSED_LOOP_CONTROL] * 2
    assert [axis.torque_demand_shaft(0.0) for axis in robot.axes] == [0.0, 0.0]
    assert robot.client.fault(robot.now_ns) is None


def test_a_latched_error_is_cleared_on_the_way(robot: Robot) -> None:
    for frame in robot.client.estop():
        for axis in robot.axes:
            axis.on_frame(frame, 0)
    robot.arm()
    assert [axis.errors for axis in robot.axes] == [AxisError(0)] * 2


def test_arming_takes_no_longer_than_two_heartbeats(robot: Robot) -> None:
    assert robot.arm() <= 203


def test_torques_reach_their_own_wheels_and_are_known_as_sent(robot: Robot) -> None:
    robot.arm()
    robot.tick(*robot.client.torque(0.1, -0.2))
    assert robot.client.sent_wheel_N_m == (pytest.approx(0.1), pytest.approx(-0.2))
    assert (
        tuple(axis.torque_demand_shaft(0.0) for axis in robot.axes) == robot.client.sent_wheel_N_m
    )


def test_readings_are_radians(robot: Robot) -> None:
    robot.axes[0].update_encoder(1.5, 0.25)
    robot.axes[1].update_encoder(-1.0, 0.5)
    robot.tick()
    assert robot.client.feedback_since(robot.now_ns - 1)
    assert not robot.client.feedback_since(robot.now_ns)
    assert robot.client.motion() == pytest.approx((3 * pi, -2 * pi, pi / 2, pi))


def test_a_drive_that_trips_is_named_with_its_error(robot: Robot) -> None:
    robot.arm()
    robot.axes[1].on_frame(Frame(identifier(1, Command.ESTOP), b""), robot.now_ns)
    for _ in range(100):
        robot.tick(*robot.client.torque(0.0, 0.0))
    assert robot.client.fault(robot.now_ns) == ("left drive (node 1) dropped out: ESTOP_REQUESTED")


def test_a_drive_without_heartbeat_or_encoder_frames_is_named(robot: Robot) -> None:
    robot.arm()
    later = robot.now_ns + 51 * MS
    assert "no encoder frames" in robot.client.fault(later)
    assert "no heartbeat for" in robot.client.fault(robot.now_ns + 700 * MS)


def test_before_anything_is_heard_no_heartbeat_is_the_fault() -> None:
    assert "no heartbeat heard yet" in OdriveClient(LINK).fault(0)


def test_disarming_leaves_both_idle_with_zero_torque_stored(robot: Robot) -> None:
    robot.arm()
    robot.tick(*robot.client.torque(0.3, 0.3))
    robot.tick(*robot.client.disarm())
    assert [axis.state for axis in robot.axes] == [AxisState.IDLE] * 2
    assert [axis.input_torque_shaft for axis in robot.axes] == [0.0, 0.0]
    assert not robot.client.armed
    robot.arm()


def test_a_torque_beyond_float32_saturates() -> None:
    client = OdriveClient(LINK)
    client.torque(1e300, -inf)
    assert client.sent_wheel_N_m[0] == pytest.approx(3.4e38)


def test_frames_of_wrong_length_are_no_readings(robot: Robot) -> None:
    robot.client.on_frame(identifier(0, Command.GET_ENCODER_ESTIMATES), bytes(4), 5)
    robot.client.on_frame(identifier(0, Command.HEARTBEAT), bytes(3), 5)
    assert robot.client.motion() is None
    assert "no heartbeat heard yet" in robot.client.fault(5)


def test_without_a_watchdog_the_robot_arms_too() -> None:
    Robot(replace(MODEL, watchdog_ns=0)).arm()


def test_a_closed_loop_of_before_does_not_count_as_armed() -> None:
    robot = Robot(replace(MODEL, watchdog_ns=0))
    robot.arm()
    robot.client.disarm()  # and none of it reaches the drives
    for _ in range(300):
        robot.tick()
        assert not robot.client.armed
    robot.arm()


def test_steps_begin_once_both_drives_are_there_and_anew_when_one_was_away(robot: Robot) -> None:
    zeros = [0x00E, 0x02E]
    assert [frame.can_id for frame in robot.client.arm(0)] == zeros
    robot.tick()
    assert robot.client.arm(robot.now_ns)[1].can_id == identifier(0, Command.CLEAR_ERRORS)
    away = robot.now_ns + 60 * MS
    assert [frame.can_id for frame in robot.client.arm(away)] == zeros
    robot.tick()
    assert robot.client.arm(robot.now_ns)[1].can_id == identifier(0, Command.CLEAR_ERRORS)


def test_a_watchdog_that_trips_on_the_way_is_cleared_by_itself(robot: Robot) -> None:
    for _ in range(4):
        robot.tick(*robot.client.arm(robot.now_ns))
    for _ in range(150):
        robot.tick()  # the host stalls
    assert all(axis.errors for axis in robot.axes)
    robot.arm()


def test_torque_0_goes_out_with_every_step_of_arming(robot: Robot) -> None:
    while not robot.client.armed:
        frames = robot.client.arm(robot.now_ns)
        zeros = [(frame.can_id, frame.data) for frame in frames if frame.can_id & 0x1F == 0x0E]
        assert zeros == [(0x00E, bytes(4)), (0x02E, bytes(4))]
        robot.tick(*frames)


def test_what_keeps_each_drive_from_closed_loop_is_said_of_both(robot: Robot) -> None:
    assert robot.client.missing(0).count("no heartbeat heard yet") == 2
    robot.tick()
    assert robot.client.missing(robot.now_ns) == (
        "right drive (node 0): no closed loop reported yet; it is IDLE, last result SUCCESS;"
        " left drive (node 1): no closed loop reported yet; it is IDLE, last result SUCCESS"
    )
    robot.arm()
    assert robot.client.missing(robot.now_ns) == ""


@pytest.mark.parametrize("remote", [0, RTR])
def test_an_estop_on_the_bus_counts_before_the_next_heartbeat(robot: Robot, remote: int) -> None:
    robot.arm()
    robot.client.on_frame(identifier(0, Command.ESTOP) | remote, b"", robot.now_ns)
    assert robot.client.fault(robot.now_ns) == "right drive (node 0) dropped out: ESTOP_REQUESTED"
    assert robot.client.refusal() is not None


def test_a_host_may_clear_a_watchdog_but_not_an_estop(robot: Robot) -> None:
    robot.arm()
    for _ in range(300):
        robot.tick()  # no set-points
    assert "WATCHDOG" in robot.client.fault(robot.now_ns)
    assert robot.client.refusal() is None
    assert robot.client.obstacle(robot.now_ns) is None
    robot.axes[0].on_frame(Frame(identifier(0, Command.ESTOP), b""), robot.now_ns)
    for _ in range(100):
        robot.tick()
    assert "ESTOP_REQUESTED" in robot.client.refusal()


def test_silent_drives_must_not_be_armed(robot: Robot) -> None:
    robot.arm()
    assert robot.client.obstacle(robot.now_ns) is None
    assert "no encoder frames" in robot.client.obstacle(robot.now_ns + 51 * MS)
    assert robot.client.refusal() is None


def test_a_second_sender_of_encoder_frames_or_heartbeats_is_a_fault(robot: Robot) -> None:
    robot.arm()
    twin = OdriveNode(MODEL, 1, 99)
    for _ in range(2500):
        robot.tick(*robot.client.torque(0.0, 0.0))
        for frame in twin.due(robot.now_ns):
            if frame.can_id & 0x1F == Command.GET_ENCODER_ESTIMATES:
                robot.client.on_frame(frame.can_id, frame.data, robot.now_ns)
    fault = robot.client.fault(robot.now_ns)
    assert fault.startswith("left drive (node 1): 2.0 times the encoder frames of one sender")
    assert robot.client.obstacle(robot.now_ns) == fault
    for _ in range(2500):
        robot.tick(*robot.client.torque(0.0, 0.0))
    assert robot.client.fault(robot.now_ns) is None  # it is gone again
    for _ in range(2500):
        robot.tick(*robot.client.torque(0.0, 0.0))
        if robot.now_ns % (100 * MS) == 37 * MS:
            beat = f.HEARTBEAT.pack(0, AxisState.CLOSED_LOOP_CONTROL, 0, 0, 0)
            robot.client.on_frame(identifier(0, Command.HEARTBEAT), beat, robot.now_ns)
    assert "2.0 times the heartbeats" in robot.client.fault(robot.now_ns)


@pytest.mark.parametrize("ask", [RTR, 0])
def test_answers_to_somebody_elses_requests_are_no_second_sender(robot: Robot, ask: int) -> None:
    robot.arm()
    for _ in range(2500):
        robot.tick(*robot.client.torque(0.0, 0.0))
        for command in (Command.GET_ENCODER_ESTIMATES, Command.HEARTBEAT):
            question = Frame(identifier(1, command) | ask, bytes(8) if ask else b"")
            robot.client.on_frame(question.can_id, question.data, robot.now_ns)
            for answer in robot.axes[1].on_frame(question, robot.now_ns):
                robot.client.on_frame(answer.can_id, answer.data, robot.now_ns)
        assert robot.client.fault(robot.now_ns) is None


def test_a_drive_that_delivers_a_fifth_of_a_second_at_once_is_no_second_sender() -> None:
    robot = Robot(replace(MODEL, watchdog_ns=0))
    robot.arm()
    for _ in range(15):
        for _ in range(200):
            stamp_ns = robot.now_ns
            robot.tick(*robot.client.torque(0.0, 0.0))
        for axis in robot.axes:
            for k in range(200):  # a backlog
                for frame in axis.due(stamp_ns + k * MS):
                    robot.client.on_frame(frame.can_id, frame.data, stamp_ns + 200 * MS)
        robot.now_ns = stamp_ns + 200 * MS
        assert robot.client.fault(robot.now_ns) is None


def test_readings_that_are_not_finite_are_not_taken(robot: Robot) -> None:
    robot.arm()
    before = robot.client.motion()
    for angle, speed in ((nan, 0.0), (0.0, nan), (inf, 0.0), (inf, -inf)):
        data = f.TWO_FLOATS.pack(angle, speed)
        robot.client.on_frame(identifier(0, Command.GET_ENCODER_ESTIMATES), data, robot.now_ns + 1)
    assert robot.client.motion() == before
    assert not robot.client.feedback_since(robot.now_ns)


def test_error_frames_and_other_numbers_are_nothing_to_it(robot: Robot) -> None:
    robot.arm()
    for can_id in (0x001 | ERR, 0x009 | ERR, 0x002 | ERR, 0x002 | EFF, 0x042, 0x7FF):
        robot.client.on_frame(can_id, bytes(8), robot.now_ns + MS)
    assert robot.client.fault(robot.now_ns) is None
    assert robot.client.notices == ()


def test_commands_of_somebody_else_are_noticed(robot: Robot) -> None:
    robot.arm()
    robot.client.on_frame(identifier(1, Command.SET_INPUT_TORQUE), bytes(4), robot.now_ns)
    assert robot.client.notices == ("left drive (node 1): 1 commands of another host",)


def test_a_resting_drive_is_told_idle_again_only_while_it_is_not(robot: Robot) -> None:
    robot.arm()
    states = 0
    robot.client.disarm()  # lost
    for _ in range(250):
        frames = robot.client.rest(robot.now_ns)
        states += sum(frame.can_id & 0x1F == Command.SET_AXIS_STATE for frame in frames)
        robot.tick(*frames)
    assert [axis.state for axis in robot.axes] == [AxisState.IDLE] * 2
    assert 2 <= states <= 6


@given(
    signs=st.tuples(st.sampled_from((1, -1)), st.sampled_from((1, -1))),
    ratio=st.floats(0.1, 100.0),
    right=st.floats(-5.0, 5.0),
    left=st.floats(-5.0, 5.0),
)
def test_mounting_turns_wheel_values_into_shaft_values_and_back(signs, ratio, right, left) -> None:
    robot = Robot(
        link=replace(
            LINK, mounting=Mounting(right_sign=signs[0], left_sign=signs[1], gear_ratio=ratio)
        )
    )
    robot.axes[0].update_encoder(right, 2 * right)
    robot.axes[1].update_encoder(left, 2 * left)
    robot.tick()
    per_turn = [2 * pi * sign / ratio for sign in signs]
    expected = right * per_turn[0], left * per_turn[1]
    assert robot.client.motion() == pytest.approx(
        (*expected, 2 * expected[0], 2 * expected[1]), rel=1e-6
    )
    frames = robot.client.torque(right, left)
    shafts = [f.decode_float(frame.data) for frame in frames]
    assert shafts == pytest.approx([right * signs[0] / ratio, left * signs[1] / ratio], rel=1e-6)
    assert robot.client.sent_wheel_N_m == pytest.approx((right, left), rel=1e-6)


def test_default_mounting_changes_no_bit() -> None:
    client = OdriveClient(LINK)
    for torque in (0.1, -0.3, 1e-30, 123.456):
        frames = client.torque(torque, torque)
        assert frames[0].data == frames[1].data == f.ONE_FLOAT.pack(torque)
        assert client.sent_wheel_N_m == (f.decode_float(frames[0].data),) * 2


@given(st.integers(0, 2**32 - 1), st.binary(max_size=8))
def test_no_frame_can_raise(can_id: int, data: bytes) -> None:
    client = OdriveClient(LINK)
    for number in (can_id, can_id & 0x3F, (can_id & 0x3F) | RTR):
        client.on_frame(number, data, 1)
    client.fault(2), client.missing(2), client.obstacle(2), client.refusal()
