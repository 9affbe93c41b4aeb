"""What a user makes of a drive is called through the classes that loops call."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from bridge.drives.interface import DriveClient, DriveNode
from bridge.drives.odrive.client import OdriveClient
from bridge.drives.wrapped import Own, WrappedClient, WrappedNode, client_of
from bridge.frame import Frame
from configs.connections import NetworkLink
from configs.errors import InfrastructureError
from configs.loading import load
from configs.plugins import Plugin
from configs.resolve import agent_brief

PLUGIN = Plugin("drive protocol", "own_drive:ROW", "own_drive:ROW")

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


def client(made: object) -> WrappedClient:
    return WrappedClient(made, Own(PLUGIN, "client of r1"))


def node(made: object) -> WrappedNode:
    return WrappedNode(made, Own(PLUGIN, "node 0 of r1"))


def test_a_client_of_a_users_own_shows_what_it_has_after_each_call() -> None:
    wrapped: DriveClient = client(OwnClient())
    assert not wrapped.armed
    wrapped.on_frame(0x21, b"", 0)
    assert wrapped.armed
    assert wrapped.torque(1.4, -2.4) == [SET_POINT]
    assert wrapped.sent_wheel_N_m == (1, -2)
    assert wrapped.notices == ("nothing special",)


def test_a_node_of_a_users_own_shows_what_it_has_after_each_call() -> None:
    wrapped: DriveNode = node(OwnNode())
    assert wrapped.on_frame(SET_POINT, 5) == []
    assert (wrapped.fed_ns, wrapped.input_torque_shaft, wrapped.ignored) == (5, 1.0, 0)
    wrapped.on_frame(Frame(0x7FF, b""), 6)
    assert (wrapped.fed_ns, wrapped.ignored) == (5, 1)
    assert (wrapped.next_due_ns, wrapped.state_in_words) == (7, "on")
    wrapped.trip(None)
    assert wrapped.setpoint_id == -1


def test_numbers_may_be_of_any_type() -> None:
    made: Any = OwnClient()
    made.motion = lambda: np.array([1, 2, 3, 4])
    wrapped = client(made)
    assert wrapped.motion() == (1.0, 2.0, 3.0, 4.0)
    of_node: Any = OwnNode()
    of_node.fed_ns = np.float64(7.0)
    assert type(node(of_node).fed_ns) is int


def _raise(*_: object) -> None:
    raise KeyError("nothing there")


def _exit(*_: object) -> None:
    raise SystemExit(7)


@pytest.mark.parametrize(
    ("method", "gives", "wrong"),
    [
        ("motion", lambda: (1.0, 2.0, 3.0), "motion gave (1.0, 2.0, 3.0): not enough values"),
        ("motion", lambda: (1.0, 2.0, 3.0, float("nan")), "motion gave (1.0, 2.0, 3.0, nan): must"),
        ("motion", _raise, "test_wrapped.py, line "),
        ("motion", _exit, "SystemExit: 7"),
        ("refusal", lambda: 5, "refusal gave 5: must be a text, or None"),
        ("disarm", lambda: None, "disarm gave None: 'NoneType' object is not iterable"),
        ("disarm", lambda: [(1, b"")], "disarm gave [(1, b'')]: 'tuple' object has no attribute"),
        ("disarm", lambda: [Frame(1, bytes(9))], "9 bytes of data: classic CAN carries 0 to 8"),
        ("disarm", lambda: [Frame(1 << 40, b"")], "identifier 0x10000000000: out of range"),
    ],
)
def test_what_a_client_raises_or_answers_wrongly_is_named(
    method: str, gives: Callable[..., object], wrong: str
) -> None:
    made = OwnClient()
    setattr(made, method, gives)
    with pytest.raises(InfrastructureError) as caught:
        getattr(client(made), method)()
    said = str(caught.value)
    assert said.startswith(f"drive protocol own_drive:ROW, client of r1: {method} ")
    assert wrong in said


def test_a_torque_that_is_not_finite_is_named() -> None:
    made: Any = OwnNode()
    made.torque_demand_shaft = lambda _: float("inf")
    with pytest.raises(InfrastructureError, match="torque_demand_shaft gave inf: must be finite"):
        node(made).torque_demand_shaft(0.001)


def test_an_error_of_a_shipped_protocol_stays_what_it_is() -> None:
    shipped = Own(Plugin("drive protocol", "odrive", "bridge.drives.odrive:ROW"), "client of r1")
    with pytest.raises(KeyError, match="nothing there"):
        shipped.ask("motion", _raise, float)


def test_an_attribute_that_is_none_is_named() -> None:
    made: Any = OwnNode()
    made.setpoint_id = None
    with pytest.raises(InfrastructureError, match="node 0 of r1: setpoint_id gave None: "):
        node(made)
    del made.setpoint_id
    with pytest.raises(InfrastructureError, match="setpoint_id: 'OwnNode' object has no"):
        node(made)


def test_what_a_users_own_lacks_is_missed_when_it_is_called() -> None:
    with pytest.raises(InfrastructureError, match="node 0 of r1: reboot: 'OwnNode' object has no"):
        node(OwnNode()).reboot(0)


def test_what_is_shipped_is_called_as_it_is() -> None:
    scenario = load("two_robots")
    brief = agent_brief(scenario, "r1", network=NetworkLink("in-process", "", "", ""), bus=())
    assert type(client_of(brief.drives, "r1")) is OdriveClient
