"""`send` on a bus in this process."""

import pytest
from support.clocks import ManualClock

from bridge.frame import EFF, RTR, Frame
from configs.errors import InfrastructureError, ScenarioError
from fleetloop.can.send import send


def test_frames_arrive_in_order_as_often_as_asked(buses) -> None:
    assert send("r1", ["123#DEADBEEF", "1F334455#11.22", "017#R8"], count=2) == 0
    once = [
        Frame(0x123, b"\xde\xad\xbe\xef"),
        Frame(0x1F334455 | EFF, b"\x11\x22"),
        Frame(0x017 | RTR, bytes(8)),
    ]
    assert buses.taken(6) == once * 2


class LateClock(ManualClock):
    """Wakes a sleeper a second late."""

    def __init__(self) -> None:
        super().__init__()
        self.sleeps: list[float] = []

    def sleep(self, seconds: float) -> None:
        self.sleeps.append(seconds)
        super().sleep(seconds + 1.0)


def test_a_gap_is_kept_against_absolute_deadlines(buses) -> None:
    clock = LateClock()
    assert send("r1", ["123#"], count=4, gap_s=10.0, clock=clock) == 0
    assert clock.sleeps == [10.0, 9.0, 9.0]
    assert len(buses.taken(4)) == 4


def test_nothing_is_sent_if_one_text_is_no_frame(buses) -> None:
    with pytest.raises(ScenarioError, match="frame '123#0'"):
        send("r1", ["123#00", "123#0"])
    assert buses.taken(0) == []
    assert buses.hub.clients() == 0


def test_a_bus_that_ends_meanwhile_is_named(buses) -> None:
    class Ending(ManualClock):
        def sleep(self, seconds: float) -> None:  # noqa: ARG002
            buses.end()

    with pytest.raises(InfrastructureError, match=r"is gone: end of the run, after 1 frames"):
        send("r1", ["123#"], count=2, gap_s=10.0, clock=Ending())
