"""The controller's end, against the emulated axes."""

from dataclasses import replace
from math import inf, pi

import pytest

from bridge.drives.odrive.client import OdriveClient
from bridge.drives.odrive.frames import AxisError, AxisState, Command, identifier
from bridge.drives.odrive.node import OdriveNode
from bridge.frame import Frame
from configs.brief import DriveLink, DriveModel

MS = 1_000_000
MODEL = DriveModel(
    "odrive", 0.05, 10.0, 10.0, 1 / 6, 1.2, True, 100 * MS, 1 * MS, 0, 100 * MS, False, 7
)
LINK = DriveLink("odrive", 0, 1, 1 * MS, 10.0, 10.0)


class Robot:
    """Two axes and their client on an ideal bus."""

    def __init__(self, model: DriveModel = MODEL) -> None:
        self.axes = [OdriveNode(model, 0, 7), OdriveNode(model, 1, 8)]
        self.client = OdriveClient(LINK)
        self.now_ns = 0

    def tick(self, *answers: Frame) -> None:
        """A period: what the drives hear, and what they then say."""
        for frame in answers:
            for axis in self.axes:
                axis.hear(frame, self.now_ns)
        self.now_ns += MS
        for axis in self.axes:
            for frame in axis.due(self.now_ns):
                self.client.hear(*frame, self.now_ns)

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
        axis.input_torque = 0.4  # a stale one
    robot.arm()
    assert [axis.state for axis in robot.axes] == [AxisState.CLOSED_LOOP_CONTROL] * 2
    assert [axis.torque_demand() for axis in robot.axes] == [0.0, 0.0]
    assert robot.client.fault(robot.now_ns) is None


def test_a_latched_error_is_cleared_on_the_way(robot: Robot) -> None:
    for frame in robot.client.estop():
        for axis in robot.axes:
            axis.hear(frame, 0)
    robot.arm()
    assert [axis.errors for axis in robot.axes] == [AxisError(0)] * 2


def test_arming_takes_no_longer_than_two_heartbeats(robot: Robot) -> None:
    assert robot.arm() <= 203


def test_torques_reach_their_own_wheels_and_are_known_as_sent(robot: Robot) -> None:
    robot.arm()
    robot.tick(*robot.client.torque(0.1, -0.2))
    assert robot.client.sent == (pytest.approx(0.1), pytest.approx(-0.2))
    assert tuple(axis.torque_demand() for axis in robot.axes) == robot.client.sent


def test_readings_are_radians(robot: Robot) -> None:
    robot.axes[0].feed(1.5, 0.25)
    robot.axes[1].feed(-1.0, 0.5)
    robot.tick()
    assert robot.client.complete(robot.now_ns)
    assert not robot.client.complete(robot.now_ns + MS)
    assert robot.client.motion() == pytest.approx((3 * pi, -2 * pi, pi / 2, pi))


def test_a_drive_that_trips_is_named_with_its_error(robot: Robot) -> None:
    robot.arm()
    robot.axes[1].hear(Frame(identifier(1, Command.ESTOP), b""), robot.now_ns)
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
    assert [axis.input_torque for axis in robot.axes] == [0.0, 0.0]
    assert not robot.client.armed
    robot.arm()


def test_a_torque_beyond_float32_saturates() -> None:
    client = OdriveClient(LINK)
    client.torque(1e300, -inf)
    assert client.sent[0] == pytest.approx(3.4e38)


def test_frames_of_wrong_length_are_no_readings(robot: Robot) -> None:
    robot.client.hear(identifier(0, Command.GET_ENCODER_ESTIMATES), bytes(4), 5)
    robot.client.hear(identifier(0, Command.HEARTBEAT), bytes(3), 5)
    assert robot.client.motion() is None
    assert "no heartbeat heard yet" in robot.client.fault(5)


def test_without_a_watchdog_the_robot_arms_too() -> None:
    Robot(replace(MODEL, watchdog_ns=0)).arm()
