"""What a user makes of a drive is called through the classes that loops call."""

import pytest

from bridge.drives.interface import DriveClient, DriveNode
from bridge.drives.wrapped import WrappedClient, WrappedNode, as_client, as_node
from bridge.frame import Frame

SET_POINT = Frame(0x20, b"\1")


class OwnClient:
    """Of a user who derives from nothing; a set-point goes out as one byte."""

    def __init__(self) -> None:
        self.armed = False
        self.sent_wheel_N_m = (0.0, 0.0)
        self.notices = ["nothing special"]

    def on_frame(self, can_id: int, *_: object) -> None:
        self.armed = can_id == 0x21

    def torque(self, right_wheel_N_m: float, left_wheel_N_m: float) -> list[Frame]:
        self.sent_wheel_N_m = (round(right_wheel_N_m), round(left_wheel_N_m))
        return [SET_POINT]


class OwnNode:
    """Of a user who derives from nothing."""

    next_due_ns = 7
    state_in_words = "on"

    def __init__(self) -> None:
        self.fed_ns = self.ignored = 0
        self.setpoint_id = 0x20
        self.input_torque_shaft = 0.0

    def on_frame(self, frame: Frame, now_ns: int) -> tuple[()]:
        if frame.can_id == self.setpoint_id:
            self.fed_ns, self.input_torque_shaft = now_ns, float(frame.data[0])
        else:
            self.ignored += 1
        return ()

    def trip(self, *_: object) -> None:
        self.setpoint_id = -1


def test_a_client_of_a_users_own_shows_what_it_has_after_each_call() -> None:
    client = as_client(OwnClient())
    assert isinstance(client, DriveClient)
    assert not client.armed
    client.on_frame(0x21, b"", 0)
    assert client.armed
    assert client.torque(1.4, -2.4) == [SET_POINT]
    assert client.sent_wheel_N_m == (1, -2)
    assert client.notices == ("nothing special",)


def test_a_node_of_a_users_own_shows_what_it_has_after_each_call() -> None:
    node = as_node(OwnNode())
    assert isinstance(node, DriveNode)
    assert node.on_frame(SET_POINT, 5) == ()
    assert (node.fed_ns, node.input_torque_shaft, node.ignored) == (5, 1.0, 0)
    node.on_frame(Frame(0x7FF, b""), 6)
    assert (node.fed_ns, node.ignored) == (5, 1)
    assert (node.next_due_ns, node.state_in_words) == (7, "on")
    node.trip(None)
    assert node.setpoint_id == -1


def test_what_a_users_own_lacks_is_missed_when_it_is_called() -> None:
    with pytest.raises(AttributeError, match="reboot"):
        as_node(OwnNode()).reboot(0)


def test_what_derives_from_the_classes_is_called_as_it_is() -> None:
    client, node = WrappedClient(OwnClient()), WrappedNode(OwnNode())
    assert as_client(client) is client
    assert as_node(node) is node
