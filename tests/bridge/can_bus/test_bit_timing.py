"""Clients of a bus with bit timing: transmit queues under credit, times of frames."""

import errno
import threading
from collections.abc import Iterator
from typing import Any

import can
import pytest

from bridge.can_bus import sockets
from bridge.can_bus.hub import Hub
from bridge.can_bus.packet import Transmitted
from bridge.frame import Frame

OWN: dict[str, Any] = {"synchronous": "r1", "secret": "told to nobody else"}
CONTROLLERS = {"r1": {"r1": "told to nobody else"}}


class Timed:
    """A bus with bit timing: what its emulation would say is said by the test."""

    def __init__(self, queue: int = 10) -> None:
        folder = sockets.create_run_folder("timed")
        self.hub = Hub(sockets.listen(folder, ("r1",)), queue=queue, controllers=CONTROLLERS)

    def join(self, **options) -> can.BusABC:
        buses: list[can.BusABC] = []

        def open_bus() -> None:
            buses.append(can.Bus(interface="fleetloop", channel="timed/r1", **options))

        opener = threading.Thread(target=open_bus)
        opener.start()
        while opener.is_alive():
            self.hub.serve(0.01)
        return buses[0]

    def close(self) -> None:
        self.hub.close("the test is over")
        sockets.remove_run_folder(sockets.base_folder() / "timed")


@pytest.fixture
def timed(runtime_folder) -> Iterator[Timed]:
    timed = Timed()
    yield timed
    timed.close()


def test_on_a_bus_with_bit_timing_each_frame_has_the_time_at_which_it_ended(timed) -> None:
    with timed.join(**OWN) as bus:
        passed = [
            Transmitted(1_108_000, Frame(0x009, b"1")),
            Transmitted(1_233_000, Frame(0x029, b"2")),
        ]
        timed.hub.forward("r1", 1_233_000, passed, "r1")
        first, second = bus.recv(1.0), bus.recv(1.0)
        assert (first.timestamp, second.timestamp) == (0.001108, 0.001233)


def test_a_full_transmit_queue_raises_enobufs_until_frames_have_left_it(timed) -> None:
    with timed.join() as bus:
        message = can.Message(arbitration_id=0x123, is_extended_id=False)
        for _ in range(10):
            bus.send(message)
        with pytest.raises(can.CanOperationError, match="transmit queue full") as caught:
            bus.send(message, timeout=0.05)
        assert caught.value.error_code == errno.ENOBUFS
        for _ in range(10):
            timed.hub.serve(0.5)
        said = timed.hub.submitted("r1")
        key = said[0].key
        assert len(said) == 10
        timed.hub.return_credit("r1", key, 3)
        for _ in range(3):
            bus.send(message, timeout=1.0)
        with pytest.raises(can.CanOperationError):
            bus.send(message)


def test_who_only_sends_finds_room_again_when_its_frames_have_left(timed) -> None:
    with timed.join() as bus:
        for n in range(50):  # of a queue of 10
            bus.send(can.Message(arbitration_id=0x123, is_extended_id=False, data=[n]))
            timed.hub.serve(0.5)
            (said,) = timed.hub.submitted("r1")
            key, frame = said.key, said.frame
            assert frame.data == bytes([n])
            timed.hub.return_credit("r1", key, 1)


def test_with_bit_timing_what_a_client_says_reaches_nobody_before_the_wire_carried_it(
    timed,
) -> None:
    with timed.join() as speaker, timed.join(receive_own_messages=True) as other:
        speaker.send(can.Message(arbitration_id=0x123, is_extended_id=False))
        timed.hub.serve(0.5)
        assert other.recv(0.05) is None
        (said,) = timed.hub.submitted("r1")
        key, frame = said.key, said.frame
        timed.hub.forward("r1", 5_000_000, [Transmitted(5_000_000, frame, key)])
        assert other.recv(1.0).arbitration_id == 0x123
        assert speaker.recv(0.05) is None  # no echo of its own


def test_a_synchronous_client_is_told_of_a_tick_without_frames_by_none(timed) -> None:
    with timed.join(**OWN) as bus:
        timed.hub.forward("r1", 999_999, [], "r1")
        assert bus.recv(5.0) is None


def test_who_leaves_a_bus_with_bit_timing_is_named(timed) -> None:
    with timed.join(**OWN):
        pass
    timed.hub.serve(0.5)
    assert timed.hub.departed("r1") == ["r1"]
    assert timed.hub.departed("r1") == []
