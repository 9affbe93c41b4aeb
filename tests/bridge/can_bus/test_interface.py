"""Clients of the python-can interface: messages, filters, options, channels."""

import os
import socket
import threading
import time
from typing import Any

import can
import pytest

from bridge.can_bus import sockets
from bridge.can_bus.interface import FleetloopBus
from bridge.can_bus.transport import FINE_S
from bridge.frame import EFF, RTR, Frame

LOCAL_ONLY = pytest.mark.parametrize("where", ["local"], indirect=True)


def test_frames_of_drives_come_as_messages_with_bus_time(running, join) -> None:
    bus = join()
    assert isinstance(bus, FleetloopBus)
    running.deliver(Frame(0x009, b"12345678"), Frame(0x123 | RTR, bytes(4)), stamp_ns=2_500_000)
    first, second = bus.recv(5.0), bus.recv(5.0)
    assert (first.arbitration_id, bytes(first.data), first.dlc) == (0x009, b"12345678", 8)
    assert (first.timestamp, first.is_rx, first.channel) == (0.0025, True, "r1")
    assert (second.is_remote_frame, second.dlc) == (True, 4)
    assert bus.recv(0.0) is None


@pytest.mark.parametrize(
    "message",
    [
        can.Message(arbitration_id=0x7FF, data=b"12345678", is_extended_id=False),
        can.Message(arbitration_id=0x1FFFFFFF, data=b"", is_extended_id=True),
        can.Message(arbitration_id=0x17, is_remote_frame=True, dlc=8, is_extended_id=False),
    ],
)
def test_any_classic_frame_travels_unchanged_to_other_clients_and_drives(
    running, join, message: can.Message
) -> None:
    sender, hearer = join(), join()
    sender.send(message)
    heard = hearer.recv(5.0)
    assert heard.equals(message, timestamp_delta=None, check_channel=False, check_direction=False)
    (frame,) = running.taken(1)
    assert frame.can_id & 0x1FFFFFFF == message.arbitration_id
    assert bool(frame.can_id & EFF) == message.is_extended_id
    assert bool(frame.can_id & RTR) == message.is_remote_frame


def test_own_messages_come_back_only_if_asked_for(running, join) -> None:
    quiet, echoing = join(), join(receive_own_messages=True)
    echoing.send(can.Message(arbitration_id=1, is_extended_id=False))
    echo = echoing.recv(5.0)
    assert (echo.arbitration_id, echo.is_rx) == (1, False)
    assert quiet.recv(5.0).arbitration_id == 1
    quiet.send(can.Message(arbitration_id=2, is_extended_id=False))
    assert echoing.recv(5.0).arbitration_id == 2
    assert quiet.recv(0.05) is None


def test_buses_are_apart(running, join) -> None:
    one, two = join("r1"), join("r2")
    one.send(can.Message(arbitration_id=1, is_extended_id=False))
    running.taken(1)
    assert two.recv(0.05) is None


def test_filters_hold(running, join) -> None:
    bus = join(can_filters=[{"can_id": 0x20, "can_mask": 0x7E0}])
    running.deliver(Frame(0x009, b""), Frame(0x029, b""), Frame(0x049, b""))
    assert bus.recv(5.0).arbitration_id == 0x029
    assert bus.recv(0.05) is None


def test_thousands_of_frames_arrive_without_loss_and_in_order(running, join) -> None:
    bus = join()
    for k in range(3000):
        running.deliver(Frame(k % 0x800, k.to_bytes(4, "little")), stamp_ns=k)
    received = [int.from_bytes(bus.recv(5.0).data, "little") for _ in range(3000)]
    assert received == list(range(3000))


def test_a_client_that_never_reads_stops_nobody(running, join) -> None:
    join()  # never read
    reader = join()
    for k in range(3000):
        running.deliver(Frame(k % 0x800, b""), stamp_ns=k)
    assert sum(reader.recv(5.0) is not None for _ in range(3000)) == 3000


def test_a_descriptor_is_readable_once_per_frame(running, join) -> None:
    bus = join()
    heard: list[can.Message] = []
    notifier = can.Notifier(bus, [heard.append], timeout=0.1)
    running.deliver(*(Frame(k, b"") for k in range(50)))
    for _ in range(5000):
        if len(heard) == 50:
            break
        threading.Event().wait(0.001)
    notifier.stop()
    assert [message.arbitration_id for message in heard] == list(range(50))


def test_a_batched_client_sends_with_its_next_look_and_takes_an_instant_in_one_packet(
    running, join
) -> None:
    batched, other = join(batched=True), join()
    batched.send(can.Message(arbitration_id=1, is_extended_id=False))
    batched.send(can.Message(arbitration_id=2, is_extended_id=False))
    assert other.recv(0.05) is None
    assert batched.recv(0.0) is None
    assert [other.recv(5.0).arbitration_id for _ in range(2)] == [1, 2]
    running.deliver(Frame(3, b""), Frame(4, b""))
    assert batched.recv(5.0).arbitration_id == 3
    assert batched.recv(0.0).arbitration_id == 4  # it is here already


def test_a_wait_lasts_no_less_than_asked(running, join) -> None:
    bus = join()
    for wait_s in (0.001, 0.06):
        began = time.monotonic()
        assert bus.recv(wait_s) is None
        assert time.monotonic() - began >= wait_s


@LOCAL_ONLY
def test_short_waits_are_not_left_to_the_kernel_that_counts_them_in_its_ticks(
    running, join
) -> None:
    bus = join()
    with socket.socket(fileno=os.dup(bus.fileno())) as same:
        bound = lambda: same.getsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, 16)  # noqa: E731
        bus.recv(FINE_S)
        before = bound()
        bus.recv(0.9 * FINE_S)
        assert bound() == before
        bus.recv(1.1 * FINE_S)
        assert bound() != before


def message(**settings: Any) -> can.Message:
    """A message with any attributes: its own constructor takes back some that don't fit."""
    made = can.Message(arbitration_id=0x123, is_extended_id=False, data=b"1234")
    for name, value in settings.items():
        setattr(made, name, value)
    return made


NO_FRAMES = {
    "9 bytes": message(data=bytearray(9), dlc=9),
    "64 bytes": message(data=bytearray(64), dlc=64),
    "less data than its length": message(dlc=5),
    "more data than its length": message(dlc=3),
    "a remote frame of 9": message(is_remote_frame=True, data=bytearray(), dlc=9),
    "a remote frame with data": message(is_remote_frame=True),
    "a negative length": message(is_remote_frame=True, data=bytearray(), dlc=-1),
    "12 bits": message(arbitration_id=0x802),
    "30 bits": message(arbitration_id=1 << 29, is_extended_id=True),
    "33 bits": message(arbitration_id=1 << 32, is_extended_id=True),
    "flags in the identifier": message(arbitration_id=0x20000123),
    "a negative identifier": message(arbitration_id=-1),
    "a fraction as identifier": message(arbitration_id=1.5),
    "a text as identifier": message(arbitration_id="1"),
    "a text as data": message(data="1234"),
    "remote and error at once": message(
        is_remote_frame=True, is_error_frame=True, data=bytearray(), dlc=0
    ),
    "FD": message(is_fd=True),
    "FD and remote": message(is_fd=True, is_remote_frame=True),
}


@pytest.mark.parametrize("batched", [False, True])
def test_what_is_no_classic_frame_is_refused_and_takes_no_neighbour_with_it(
    running, join, batched: bool
) -> None:
    sender, hearer = join(batched=batched), join()
    sender.send(message(arbitration_id=1))
    for name, wrong in NO_FRAMES.items():
        with pytest.raises(can.CanOperationError, match="not sent"):
            sender.send(wrong)
            pytest.fail(f"sent: {name}")
    sender.send(message(arbitration_id=2))
    sender.recv(0.0)
    assert [hearer.recv(5.0).arbitration_id for _ in range(2)] == [1, 2]
    assert hearer.recv(0.05) is None
    assert [frame.can_id for frame in running.taken(2)] == [1, 2]


@pytest.mark.parametrize("data", [b"12", bytearray(b"12"), memoryview(b"12"), [0x31, 0x32]])
def test_data_may_be_any_bytes(running, join, data) -> None:
    join().send(message(data=data, dlc=2) if not isinstance(data, list) else can.Message(data=data))
    (frame,) = running.taken(1)
    assert frame.data == b"12"


@pytest.mark.parametrize("extended", [False, True])
@pytest.mark.parametrize("data", [b"", bytes(8)])
def test_where_frames_take_no_time_an_error_frame_goes_to_other_clients_and_not_to_drives(
    running, join, data: bytes, extended: bool
) -> None:
    sender, hearer = join(), join()
    sent = can.Message(is_error_frame=True, arbitration_id=0x17, data=data, is_extended_id=extended)
    sender.send(sent)
    sender.send(message(arbitration_id=2))
    heard = hearer.recv(5.0)
    assert heard.equals(sent, timestamp_delta=None, check_channel=False, check_direction=False)
    assert running.taken(1) == [Frame(2, b"1234")]


def test_fd_frames_and_unknown_options_are_refused(running, join) -> None:
    with pytest.raises(can.CanOperationError, match="classic CAN"):
        join().send(can.Message(arbitration_id=1, is_fd=True, is_extended_id=False))
    with pytest.raises(can.CanInitializationError, match="fd must be False"):
        join(fd=True)
    with pytest.raises(TypeError, match="no option baud"):
        join(baud=1)


@LOCAL_ONLY
def test_a_bus_that_is_not_there_is_named_with_those_that_are(running, join) -> None:
    with pytest.raises(can.CanInitializationError, match=r"no bus 'r9'.*test/r1, test/r2"):
        join("r9")


@LOCAL_ONLY
def test_channels_go_by_bus_by_run_and_by_path(running, join) -> None:
    for channel in ("r1", "test/r1", str(sockets.base_folder() / "test" / "r1.can")):
        join(channel).send(can.Message(arbitration_id=1, is_extended_id=False))
    assert len(running.taken(3)) == 3


@LOCAL_ONLY
def test_live_buses_are_detected(running) -> None:
    found = can.detect_available_configs("fleetloop")
    assert [config["channel"] for config in found] == ["test/r1", "test/r2"]


@LOCAL_ONLY
def test_buses_that_are_up_are_detected(running) -> None:
    found = can.detect_available_configs("fleetloop")
    assert [config["channel"] for config in found] == ["test/r1", "test/r2"]
