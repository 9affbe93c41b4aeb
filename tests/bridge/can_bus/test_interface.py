"""The python-can interface against a hub in this process: third-party contract and lockstep."""

import errno
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.hub_running import Remote, Running

from bridge.can_bus import connection, sockets, zenoh_transport
from bridge.can_bus.hub import Hub
from bridge.can_bus.interface import FleetloopBus
from bridge.can_bus.packet import Transmitted
from bridge.frame import EFF, RTR, Frame

LOCAL_ONLY = pytest.mark.parametrize("where", ["local"], indirect=True)


@pytest.fixture(params=["local", "remote"])
def where(request: pytest.FixtureRequest) -> str:
    """Clients on the hub's machine, and on another one: the same contract."""
    return request.param


@pytest.fixture
def running(where: str, runtime_folder, tmp_path: Path) -> Iterator[Running]:
    running = Running(tmp_path if where == "remote" else None)
    yield running
    running.close()


@pytest.fixture
def join(running: Running) -> Iterator[Callable[..., can.BusABC]]:
    buses: list[can.BusABC] = []

    def open_bus(channel: str = "r1", **options) -> can.BusABC:
        settings = running.remote.settings() if running.remote is not None else {}
        bus = can.Bus(interface="fleetloop", channel=channel, **settings, **options)
        buses.append(bus)
        return bus

    yield open_bus
    for bus in buses:
        bus.shutdown()


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


def test_a_gathered_client_sends_with_its_next_look_and_takes_an_instant_in_one_packet(
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


@pytest.mark.wall_clock
def test_short_waits_are_kept_to_the_millisecond(running, join) -> None:
    import time

    bus = join()
    waits = []
    for _ in range(20):
        began = time.monotonic()
        assert bus.recv(0.001) is None
        waits.append(time.monotonic() - began)
    assert min(waits) >= 0.001
    assert min(waits) < 0.003  # the kernel's own bound counts in steps of 4 ms


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


def test_the_end_of_the_bus_is_an_error_that_says_why(running, join) -> None:
    bus = join()
    running.deliver(Frame(1, b""))
    running.close()
    assert bus.recv(5.0).arbitration_id == 1  # nothing that was said is lost
    with pytest.raises(can.CanOperationError, match="the test is over"):
        bus.recv(5.0)


def test_who_sends_to_a_bus_that_has_ended_is_told_why_and_can_still_read_what_was_said(
    running, join
) -> None:
    bus = join()
    running.deliver(Frame(1, b""), Frame(2, b""))
    running.close()

    def send() -> None:
        while True:
            bus.send(message(), timeout=1.0)

    for _ in range(2):
        with pytest.raises(can.CanOperationError, match=r"the test is over|the bus has gone"):
            send()
    assert [bus.recv(5.0).arbitration_id for _ in range(2)] == [1, 2]


def test_who_is_behind_when_the_bus_ends_still_gets_all_of_it_and_the_reason(running, join) -> None:
    bus = join()
    heard: list[int] = []
    for k in range(5000):
        running.deliver(Frame(1, k.to_bytes(4, "big")))

    def read() -> None:
        with pytest.raises(can.CanOperationError, match="the test is over"):
            while True:
                heard.append(int.from_bytes(bus.recv(5.0).data, "big"))

    reader = threading.Thread(target=read)
    reader.start()
    running.close()
    reader.join()
    assert heard == list(range(5000))


@pytest.mark.wall_clock
def test_who_does_not_read_delays_the_end_of_the_bus_by_a_bound(running, join) -> None:
    import time

    join()
    for _ in range(3000):
        running.deliver(Frame(1, b""))
    began = time.monotonic()
    running.close()
    assert time.monotonic() - began < 3.0


@pytest.mark.parametrize("wait_s", [None, 0.04, 60.0])
def test_shutdown_wakes_who_waits_in_another_thread(running, join, wait_s: float | None) -> None:
    bus = join()
    told: list[str] = []
    waiting = threading.Event()

    def read() -> None:
        with pytest.raises(can.CanOperationError) as caught:
            while True:
                waiting.set()
                bus.recv(wait_s)
        told.append(str(caught.value))

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    assert waiting.wait(5.0)
    reader.join(0.05)
    bus.shutdown()
    reader.join(5.0)
    assert not reader.is_alive()
    assert told == ["bus 'r1' was shut down"]


def test_shutdown_wakes_who_waits_for_room_to_send(running, join) -> None:
    bus = join()
    errors: list[str] = []
    sent = threading.Event()

    def write() -> None:
        with pytest.raises(can.CanOperationError) as caught:
            while True:
                bus.send(message(), timeout=60.0)
                sent.set()
        errors.append(str(caught.value))

    writer = threading.Thread(target=write, daemon=True)
    with running.lock:  # the hub is busy
        writer.start()
        assert sent.wait(5.0)
        writer.join(0.3)
        closer = threading.Thread(target=bus.shutdown, daemon=True)
        closer.start()
        writer.join(5.0)
        assert not writer.is_alive()
    closer.join(5.0)
    assert errors == ["bus 'r1' was shut down"]


def test_after_shutdown_nothing_can_be_sent_or_received(running, join) -> None:
    for batched in (False, True):
        bus = join(batched=batched)
        bus.shutdown()
        for _ in range(2):
            with pytest.raises(can.CanOperationError, match="was shut down"):
                bus.recv(0.01)
            with pytest.raises(can.CanOperationError, match="was shut down"):
                bus.send(message())


def test_who_is_behind_by_more_than_is_kept_is_told_how_much_it_lost(
    running, join, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "BACKLOG", 500)
    monkeypatch.setattr(zenoh_transport, "BACKLOG", 100)
    bus = join()
    for k in range(5000):
        running.deliver(Frame(1, k.to_bytes(4, "big")))
    heard: list[int] = []

    def read() -> None:
        while (heard_now := bus.recv(1.0)) is not None:
            heard.append(int.from_bytes(heard_now.data, "big"))

    read()
    assert heard == sorted(set(heard))
    lost = 5000 - len(heard)
    assert lost > 2000
    for k in range(5000, 5010):
        running.deliver(Frame(1, k.to_bytes(4, "big")))
    read()
    assert (heard[-10:], bus.lost) == (list(range(5000, 5010)), lost)
    running.close()
    with pytest.raises(can.CanOperationError, match=f"the test is over; {lost} frames"):
        bus.recv(5.0)


@LOCAL_ONLY
def test_who_takes_nothing_at_the_end_finds_how_much_it_lost(running, join) -> None:
    bus, reader = join(), join()
    for k in range(3000):
        running.deliver(Frame(1, k.to_bytes(4, "big")))
    assert [reader.recv(5.0) is not None for _ in range(3000)] == [True] * 3000
    running.close()
    heard = 0
    with pytest.raises(can.CanOperationError, match="the test is over; ") as caught:
        while bus.recv(5.0) is not None:
            heard += 1
    assert 0 < heard < 3000
    assert f"; {3000 - heard} frames for it were lost" in str(caught.value)
    assert bus.lost == running.hub.counters("r1").dropped == 3000 - heard


def test_shutdown_twice_is_once(running, join) -> None:
    bus = join()
    bus.shutdown()
    bus.shutdown()


LEAVE = 0x7FF
CONTROLLERS = {"r1": {"r1": "told to nobody else"}}
OWN: dict[str, Any] = {"synchronous": "r1", "secret": "told to nobody else"}


def answered(hub: Hub) -> bool:
    """Whether the bus answers within ten seconds."""
    return any(hub.collect(0.01) for _ in range(1000))


# --- lockstep -------------------------------------------------------------------------------------


@pytest.fixture
def synchronous(where: str, runtime_folder, tmp_path: Path) -> Iterator[Hub]:
    """A hub driven by the test, and a synchronous client in a thread, as a controller."""
    folder = sockets.create_run_folder("test")
    hub = Hub(sockets.listen(folder, ("r1",)), controllers=CONTROLLERS)
    remote = Remote(tmp_path) if where == "remote" else None
    settings = remote.settings() if remote is not None else {}

    def answer() -> None:
        bus = can.Bus(interface="fleetloop", channel="r1", **OWN, **settings)
        try:
            while True:
                message = bus.recv(10.0)
                if message is not None and message.arbitration_id == LEAVE:
                    break
                if message is not None and message.arbitration_id == 0x009:
                    bus.send(can.Message(arbitration_id=0x00E, data=message.data[:4]))
                    bus.send(can.Message(arbitration_id=0x02E, data=message.data[4:]))
        except can.CanOperationError:
            pass
        bus.shutdown()

    thread = threading.Thread(target=answer)
    thread.start()
    assert hub.await_controllers(10.0) == ()
    yield hub
    hub.close("the test is over")
    thread.join()
    if remote is not None:
        remote.close()
    sockets.remove_run_folder(folder)


def test_collect_returns_with_all_that_a_synchronous_client_had_to_say(synchronous) -> None:
    hub = synchronous
    for k in range(200):
        data = k.to_bytes(4, "little") + bytes(4)
        hub.deliver("r1", k, (Frame(0x009, data),))
        assert answered(hub)
        frames = hub.receive("r1")
        assert [frame.can_id & 0x7FF for frame in frames] == [0x00E, 0x02E]
        assert frames[0].data == k.to_bytes(4, "little")


def test_a_synchronous_client_with_nothing_to_say_still_answers(synchronous) -> None:
    hub = synchronous
    hub.deliver("r1", 0, (Frame(0x001, bytes(8)),))
    assert answered(hub)
    assert hub.receive("r1") == []


def test_a_listener_beside_a_synchronous_client_changes_nothing(synchronous) -> None:
    hub = synchronous
    listener: list[can.BusABC] = []
    opener = threading.Thread(
        target=lambda: listener.append(can.Bus(interface="fleetloop", channel="r1"))
    )
    opener.start()
    while opener.is_alive():
        hub.collect(0.0)
    for k in range(50):
        hub.deliver("r1", k, (Frame(0x009, bytes(8)),))
        assert answered(hub)
        assert len(hub.receive("r1")) == 2
    heard = [listener[0].recv(5.0).arbitration_id & 0x7FF for _ in range(150)]
    assert heard == [0x009, 0x00E, 0x02E] * 50
    listener[0].shutdown()


def test_a_synchronous_client_that_leaves_is_named_and_waited_for_no_longer(synchronous) -> None:
    hub = synchronous
    hub.deliver("r1", 0, (Frame(LEAVE, b""),))
    hub.collect(10.0)
    while not hub.left():
        hub.collect(0.0)
    assert hub.left() == ("r1",)
    assert hub.clients() == 0
    hub.deliver("r1", 1, (Frame(0x009, bytes(8)),))
    assert hub.left() == ("r1",)


@given(st.lists(st.binary(max_size=64), max_size=5))
def test_garbage_from_a_client_is_counted_and_harms_nobody(garbage: list[bytes]) -> None:
    import os
    import socket
    import tempfile

    with tempfile.TemporaryDirectory(prefix="fl-", dir="/tmp") as folder:
        os.environ["FLEETLOOP_RUNTIME"] = folder
        run = sockets.create_run_folder("garbage")
        hub = Hub(sockets.listen(run, ("r1",)))
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as stranger:
            stranger.connect(str(sockets.socket_path(run, "r1")))
            for data in garbage:
                stranger.send(data)
            for _ in range(len(garbage) + 2):
                hub.collect(0.0)
        hub.collect(0.0)
        assert hub.receive("r1") == []
        hub.close("")


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
        (key, _), *_ = said = timed.hub.submitted("r1")
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
            ((key, frame),) = timed.hub.submitted("r1")
            assert frame.data == bytes([n])
            timed.hub.return_credit("r1", key, 1)


def test_with_bit_timing_what_a_client_says_reaches_nobody_before_the_wire_carried_it(
    timed,
) -> None:
    with timed.join() as speaker, timed.join(receive_own_messages=True) as other:
        speaker.send(can.Message(arbitration_id=0x123, is_extended_id=False))
        timed.hub.serve(0.5)
        assert other.recv(0.05) is None
        ((key, frame),) = timed.hub.submitted("r1")
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


def test_periodic_tasks_of_python_can_send_until_they_are_stopped(running, join) -> None:
    bus = join()
    message = can.Message(arbitration_id=0x123, is_extended_id=False)
    task = bus.send_periodic(message, 0.002)
    frames = running.taken(5)
    task.stop()
    assert set(frames) == {Frame(0x123, b"")}


def test_a_notifier_hands_every_frame_to_its_listeners(running, join) -> None:
    bus = join()
    reader = can.BufferedReader()
    notifier = can.Notifier(bus, [reader])
    running.deliver(*(Frame(0x100 + n, b"") for n in range(50)))
    heard = [reader.get_message(5.0) for _ in range(50)]
    notifier.stop()
    assert [message.arbitration_id for message in heard] == list(range(0x100, 0x132))


def test_several_threads_may_share_a_thread_safe_bus(running) -> None:
    settings = running.remote.settings() if running.remote is not None else {}
    with can.ThreadSafeBus(interface="fleetloop", channel="r1", **settings) as bus:

        def send(first: int) -> None:
            for n in range(100):
                message = can.Message(arbitration_id=first + n, is_extended_id=False)
                bus.send(message, timeout=10.0)

        threads = [threading.Thread(target=send, args=(k * 0x100,)) for k in range(4)]
        for thread in threads:
            thread.start()
        frames = running.taken(400)
        for thread in threads:
            thread.join()
    assert len(set(frames)) == 400
    for k in range(4):
        of_one = [frame.can_id for frame in frames if frame.can_id >> 8 == k]
        assert of_one == sorted(of_one)


def test_what_gathers_waits_for_a_busy_hub_and_loses_nothing(running, join) -> None:
    bus = join(batched=True)
    sent = list(range(3000))
    done = threading.Event()

    def send() -> None:
        for n in sent:
            bus.send(can.Message(arbitration_id=1, is_extended_id=False, data=n.to_bytes(2, "big")))
            bus.recv(0.0)
        done.set()

    sender = threading.Thread(target=send)
    with running.lock:  # the hub is busy
        sender.start()
        assert not done.wait(0.2)
    frames = running.taken(3000)
    sender.join()
    assert [int.from_bytes(frame.data, "big") for frame in frames] == sent


def test_a_hub_that_does_not_read_is_a_full_transmit_buffer_within_the_timeout(
    running, join
) -> None:
    bus = join()
    message = can.Message(arbitration_id=1, is_extended_id=False)
    sent = 0
    with running.lock:
        with pytest.raises(can.CanOperationError, match="transmit buffer full") as caught:
            while sent < 5000:
                bus.send(message, timeout=0.05)
                sent += 1
        assert caught.value.error_code == errno.ENOBUFS
        with pytest.raises(can.CanOperationError, match="transmit buffer full"):
            bus.send(message)
    assert len(running.taken(sent)) == sent
    bus.send(message, timeout=5.0)
    assert len(running.taken(1)) == 1


@LOCAL_ONLY
def test_what_a_client_sent_before_it_closed_arrives_though_it_left_frames_unread(
    running, join
) -> None:
    bus = join()
    running.deliver(*(Frame(0x100 + n, b"") for n in range(20)))
    with running.lock:  # the kernel tells the hub of a reset before it hands out what was sent
        for n in range(20):
            bus.send(can.Message(arbitration_id=0x200 + n, is_extended_id=False))
        bus.shutdown()
    assert [frame.can_id for frame in running.taken(20)] == list(range(0x200, 0x214))


def test_what_a_client_sent_before_it_closed_arrives_though_frames_were_on_their_way_to_it(
    running, join
) -> None:
    bus = join()
    for n in range(20):
        bus.send(can.Message(arbitration_id=0x200 + n, is_extended_id=False))
    bus.shutdown()
    for n in range(20):
        running.deliver(Frame(0x100 + n, b""))
    assert [frame.can_id for frame in running.taken(20)] == list(range(0x200, 0x214))


@LOCAL_ONLY
def test_buses_that_are_up_are_detected(running) -> None:
    found = can.detect_available_configs("fleetloop")
    assert [config["channel"] for config in found] == ["test/r1", "test/r2"]
