"""The gateway between a bus of ours and python-can's in-process bus."""

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import can
import pytest
from support.clocks import ManualClock

from bridge.frame import EFF, RTR, Frame
from configs.errors import InfrastructureError, ScenarioError
from fleetloop.can import gateway as joining
from fleetloop.can.echo import LEAST
from fleetloop.can.far_bus import FarBus
from fleetloop.can.gateway import join

ENCODER = Frame(0x009, bytes(range(8)))
channels = (f"far-{n}" for n in itertools.count())


@pytest.fixture
def far() -> Iterator[FarBus]:
    yield FarBus.parse("virtual", next(channels), None, [], "auto")


@pytest.fixture
def stranger(far: FarBus) -> Iterator[can.BusABC]:
    """A node on the far bus."""
    with can.Bus(interface="virtual", channel=far.channel) as bus:
        yield bus


@pytest.fixture
def joined(buses, in_background) -> Callable[..., tuple[threading.Thread, list[int]]]:
    def start(far: FarBus, **options) -> tuple[threading.Thread, list[int]]:
        statuses: list[int] = []
        thread = in_background(lambda: statuses.append(join("r1", far, **options)))
        buses.await_clients(1)
        return thread, statuses

    return start


def message(can_id: int, data: bytes = b"", **options) -> can.Message:
    return can.Message(arbitration_id=can_id, data=data, **({"is_extended_id": False} | options))


def test_frames_go_both_ways_unchanged_and_none_comes_back(
    buses, joined, far, stranger, capsys
) -> None:
    thread, statuses = joined(far)
    with can.Bus(interface="fleetloop", channel="r1") as client:
        buses.await_clients(2)
        buses.deliver(ENCODER)
        heard = stranger.recv(5.0)
        assert Frame(heard.arbitration_id, bytes(heard.data)) == ENCODER
        client.send(message(0x17, is_remote_frame=True, dlc=8))
        asked = stranger.recv(5.0)
        assert (asked.is_remote_frame, asked.dlc) == (True, 8)
        assert client.recv(5.0).arbitration_id == 0x009
        stranger.send(message(0x1ABCDEF0, b"\1\2", is_extended_id=True))
        answer = client.recv(5.0)
        assert (answer.arbitration_id, bytes(answer.data)) == (0x1ABCDEF0, b"\1\2")
        assert client.recv(0.05) is None
    assert buses.taken(2) == [
        Frame(0x17 | RTR, bytes(8)),
        Frame(0x1ABCDEF0 | EFF, b"\1\2"),
    ]
    assert stranger.recv(0.05) is None
    buses.end()
    thread.join(10.0)
    told = capsys.readouterr()
    assert statuses == [0]
    assert f"r1 → virtual {far.channel}: 2 frames\n" in told.out
    assert f"virtual {far.channel} → r1: 1 frames\n" in told.out
    assert "end of the run" in told.err


def test_error_and_fd_frames_are_counted_and_not_passed_on(
    buses, joined, far, stranger, capsys
) -> None:
    thread, _ = joined(far)
    stranger.send(message(0x40, bytes(8), is_error_frame=True))
    stranger.send(message(0x123, bytes(12), is_fd=True))
    stranger.send(message(0x124))
    assert buses.taken(1) == [Frame(0x124, b"")]
    with can.Bus(interface="fleetloop", channel="r1") as client:
        client.send(message(0x40, bytes(8), is_error_frame=True))
        client.send(message(0x125))
        assert stranger.recv(5.0).arbitration_id == 0x125
    buses.end()
    thread.join(10.0)
    out = capsys.readouterr().out
    assert "r1: 1 frames, 1 error frames not passed on, 1 FD frames not passed on\n" in out
    assert f"{far.channel}: 1 frames, 1 error frames not passed on\n" in out


def test_echoes_of_the_far_interface_are_dropped(buses, joined, far, capsys) -> None:
    echoing = replace(far, options={"receive_own_messages": True}, echoes=True)
    thread, _ = joined(echoing)
    # It joins after the gateway, so whatever it hears, the gateway has got back before.
    with can.Bus(interface="virtual", channel=far.channel) as stranger:
        for k in range(50):
            buses.deliver(ENCODER, stamp_ns=k)
        assert [stranger.recv(5.0).arbitration_id for _ in range(50)] == [0x009] * 50
        stranger.send(message(0x7))
        assert buses.taken(1) == [Frame(0x7, b"")]
    buses.end()
    thread.join(10.0)
    assert "1 frames, 50 own echoes dropped" in capsys.readouterr().out


def test_a_second_gateway_between_the_same_buses_is_found_out(buses, joined, far, capsys) -> None:
    first, first_statuses = joined(far)
    second, second_statuses = joined(far)
    buses.await_clients(2)
    buses.deliver(*(Frame(9, bytes([k])) for k in range(LEAST % 256)))
    assert buses.until(lambda: not (first.is_alive() and second.is_alive()))
    buses.end()
    first.join(10.0)
    second.join(10.0)
    assert 3 in first_statuses + second_statuses
    assert "what goes out to it comes back" in capsys.readouterr().err


class Breaking(can.BusABC):
    """A far bus that fails from some moment on; what a pulled USB adapter looks like."""

    broken = False
    opened = 0

    def __init__(self) -> None:
        super().__init__("x")
        Breaking.opened += 1

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        if Breaking.broken:
            raise can.CanOperationError("device is gone")

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if Breaking.broken:
            raise can.CanOperationError("device is gone")
        time.sleep(min(timeout or 0.0, 0.001))
        return None, False


class BreakingFar(FarBus):
    """How the gateway opens it."""

    def open(self) -> can.BusABC:
        if Breaking.broken:
            raise InfrastructureError("no such device")
        return Breaking()


@pytest.fixture
def breaking(monkeypatch) -> FarBus:
    monkeypatch.setattr(Breaking, "broken", False)
    monkeypatch.setattr(Breaking, "opened", 0)
    return BreakingFar("breaking", "x", {}, echoes=False)


def test_a_lost_far_bus_ends_the_gateway_with_3_and_is_named(
    buses, joined, breaking, capsys
) -> None:
    thread, statuses = joined(breaking)
    assert buses.until(lambda: Breaking.opened == 1)
    Breaking.broken = True
    thread.join(10.0)
    assert statuses == [3]
    assert "fleetloop: breaking x: device is gone" in capsys.readouterr().err


def test_a_lost_far_bus_is_opened_again_within_the_time_given(
    buses, joined, breaking, monkeypatch, capsys
) -> None:
    monkeypatch.setattr(joining, "RETRY_EVERY_S", 0.01)
    thread, statuses = joined(breaking, retry_s=10.0, with_rates=True)
    assert buses.until(lambda: Breaking.opened == 1)
    Breaking.broken = True
    buses.deliver(ENCODER)
    told = ""

    def noticed() -> bool:
        nonlocal told
        told += capsys.readouterr().err
        return "device is gone" in told

    assert buses.until(noticed)
    Breaking.broken = False
    assert buses.until(lambda: Breaking.opened == 2)
    buses.deliver(ENCODER)
    buses.end()
    thread.join(10.0)
    assert statuses == [0]
    out = capsys.readouterr().out
    assert "r1 → breaking x: 1 frames, 1 lost; " in out
    assert "/s, at most 1 in a second" in out


def test_a_far_bus_that_stays_away_is_tried_again_for_as_long_as_asked(
    buses, joined, breaking
) -> None:
    clock = ManualClock()
    thread, statuses = joined(breaking, retry_s=10.0, clock=clock)
    assert buses.until(lambda: Breaking.opened == 1)
    Breaking.broken = True
    thread.join(10.0)
    assert statuses == [3]
    assert clock.monotonic_s() == 10.0


def test_a_far_bus_that_cannot_be_opened_is_named(buses) -> None:
    far = FarBus.parse("slcan", "/dev/nowhere", None, ["sleep_after_open=0"], "auto")
    with pytest.raises(InfrastructureError, match="can't open slcan /dev/nowhere: "):
        join("r1", far)
    with pytest.raises(InfrastructureError, match="can't open nonsense"):
        join("r1", FarBus.parse("nonsense", None, None, [], "auto"))


def test_options_become_what_they_look_like() -> None:
    pairs = ["rtscts=true", "sleep_after_open=0", "timeout=0.5", "app_name=x=y"]
    far = FarBus.parse("udp_multicast", "239.0.0.1", 500_000, pairs, "auto")
    assert far.options == {
        "rtscts": True,
        "sleep_after_open": 0,
        "timeout": 0.5,
        "app_name": "x=y",
        "bitrate": 500_000,
    }
    assert far.echoes
    assert not FarBus.parse("udp_multicast", None, None, [], "no").echoes


@pytest.mark.parametrize(("pairs", "echo"), [(["rtscts"], "auto"), (["=1"], "auto"), ([], "maybe")])
def test_wrong_options_are_refused(pairs: list[str], echo: str) -> None:
    with pytest.raises(ScenarioError, match="right"):
        FarBus.parse("virtual", "x", None, pairs, echo)
