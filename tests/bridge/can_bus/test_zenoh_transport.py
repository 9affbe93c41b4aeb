"""A bus from another machine: what becomes of it when the way, the guest or the hub fails."""

import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import pytest
from support.cut_proxy import CutProxy
from support.hub_running import Running, lost_at

from bridge.can_bus import connection, flow_control, zenoh_transport
from bridge.can_bus.flow_control import INITIAL_CREDIT_BYTES, LEAST_BYTES
from bridge.can_bus.packet import BYE
from bridge.frame import Frame
from bridge.network.client import open_client
from bridge.network.link import Publisher
from bridge.network.zenoh_link import ZenohLink

OPEN = """
import sys, time, can
bus = can.Bus(interface="fleetloop", channel="r1", endpoint=sys.argv[1], user="bench",
              password="agreed")
print("here", flush=True)
"""
HOST = """
import sys, time
from pathlib import Path
from support.hub_running import Running
running = Running(Path(sys.argv[1]))
print(running.remote.link.endpoint, flush=True)
time.sleep(60)
"""


@pytest.fixture
def where() -> str:
    return "remote"


def program(*args: str, endpoint: str) -> subprocess.Popen[str]:
    """A process with a bus open from afar, which then does what `args` say."""
    process = subprocess.Popen(
        [sys.executable, "-c", OPEN + "\n".join(args), endpoint],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "here\n"
    return process


def frame(number: int) -> can.Message:
    return can.Message(arbitration_id=1, is_extended_id=False, data=number.to_bytes(4, "big"))


def numbers(frames: list[Frame]) -> list[int]:
    return [int.from_bytes(frame.data, "big") for frame in frames]


def error_within(bus: can.BusABC, seconds: float) -> str:
    """The error with which the bus ends."""
    deadline = time.monotonic() + seconds
    with pytest.raises(can.CanOperationError) as caught:
        while time.monotonic() < deadline:
            bus.recv(0.2)
    return str(caught.value)


def test_frames_go_both_ways_lossless_in_order_and_without_echo(running: Running) -> None:
    with running.open() as guest, can.Bus(interface="fleetloop", channel="r1") as local:
        sent = [Frame(0x100 + n, bytes([n])) for n in range(200)]
        for frame in sent:
            running.deliver(frame, stamp_ns=2_500_000)
        heard = [guest.recv(5.0) for _ in sent]
        assert [Frame(m.arbitration_id, bytes(m.data)) for m in heard] == sent
        assert {m.timestamp for m in heard} == {0.0025}
        for n in range(200):
            guest.send(can.Message(arbitration_id=0x300 + n, is_extended_id=False))
        seen = []
        while len(seen) < 200:
            message = local.recv(5.0)
            if message.arbitration_id >= 0x300:
                seen.append(message.arbitration_id)
        assert seen == [0x300 + n for n in range(200)]
        assert guest.recv(0.05) is None


def test_a_guest_is_a_client_like_any_other_until_it_leaves(running: Running) -> None:
    assert running.hub.clients() == 0
    with running.open():
        assert running.until(lambda: running.hub.clients() == 1)
    assert running.until(lambda: running.hub.clients() == 0)


def test_a_wrong_password_is_refused(running: Running) -> None:
    with pytest.raises(can.CanInitializationError, match="refused the login"):
        running.open(password="guessed", connect_timeout=1.0)


def test_an_endpoint_where_nobody_listens_and_a_refused_login_are_told_apart(
    running: Running,
) -> None:
    with pytest.raises(can.CanInitializationError, match="no program listens there"):
        running.open(endpoint="tcp/127.0.0.1:1", connect_timeout=0.5)
    with pytest.raises(can.CanInitializationError, match="refused the login"):
        running.open(user="stranger", password="x", connect_timeout=0.5)


def test_the_end_arrives_behind_all_that_was_said_before_it(running: Running) -> None:
    guest = running.open()
    running.deliver(*(Frame(1, n.to_bytes(4, "big")) for n in range(200)))
    running.close("end of the run")
    assert [int.from_bytes(guest.recv(5.0).data, "big") for _ in range(200)] == list(range(200))
    assert select.select([guest], [], [], 0.0)[0]
    for _ in range(2):
        with pytest.raises(can.CanOperationError, match="end of the run"):
            guest.recv(5.0)
    guest.shutdown()


def test_a_guest_that_reads_late_has_lost_nothing(running: Running) -> None:
    with running.open() as late, can.Bus(interface="fleetloop", channel="r1") as local:
        for n in range(3000):
            running.deliver(Frame(1, n.to_bytes(4, "big")))
        for bus in (local, late):
            heard = [int.from_bytes(bus.recv(5.0).data, "big") for _ in range(3000)]
            assert heard == list(range(3000))


def test_credit_and_the_answer_to_the_end_are_not_put_on_the_networks_thread(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    hearers: set[int] = set()
    puts: list[tuple[int, int]] = []  # kind of packet, thread

    class Watched:
        def __init__(self, publisher: Publisher) -> None:
            self._publisher = publisher

        def put(self, packet: bytes) -> None:
            puts.append((packet[0], threading.get_ident()))
            self._publisher.put(packet)

    def watched(*args) -> ZenohLink:
        link = open_client(*args)
        each, publisher = link.each, link.publisher

        def watched_each(key: str, act: Callable[[bytes], None]) -> None:
            each(key, lambda packet: (hearers.add(threading.get_ident()), act(packet)))

        link.each, link.publisher = watched_each, lambda key: Watched(publisher(key))
        return link

    monkeypatch.setattr(zenoh_transport, "open_client", watched)
    packets = 2 * INITIAL_CREDIT_BYTES // LEAST_BYTES  # twice what comes without new credit
    with running.open() as guest:
        for n in range(packets):
            running.deliver(Frame(1, n.to_bytes(4, "big")))
        assert all(guest.recv(5.0) is not None for _ in range(packets))
        running.close("the end")
        error_within(guest, 5.0)
    assert {flow_control.CREDIT, BYE} <= {kind for kind, _ in puts}
    assert hearers and not hearers & {thread for _, thread in puts}  # one that waits makes no room


def test_what_a_guest_does_not_read_is_dropped_and_counted_by_the_hub_as_for_all(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "BACKLOG", 500)
    monkeypatch.setattr(zenoh_transport, "BACKLOG", 100)
    with running.open() as late:
        for n in range(5000):
            running.deliver(Frame(1, n.to_bytes(4, "big")))
        dropped = lost_at(running.hub, "r1")
        assert dropped > 2000
        heard = []
        while (message := late.recv(0.5)) is not None:
            heard.append(int.from_bytes(message.data, "big"))
        assert heard == sorted(set(heard))
        assert len(heard) == 5000 - dropped
        running.deliver(Frame(2, b""))
        assert late.recv(5.0).arbitration_id == 2  # and it goes on


def test_a_guest_that_sends_more_than_it_may_is_shown_the_door(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    with running.open() as guest, running.open("r2", "boss") as other:
        with running.lock:  # a busy hub
            monkeypatch.setattr(flow_control.Sender, "has_credit", lambda _: True)
            for n in range(3000):
                try:
                    guest.send(frame(n))
                except can.CanOperationError:
                    break
            assert "more than your credit allows" in error_within(guest, 10.0)
            monkeypatch.undo()
        running.deliver(Frame(2, b""), bus="r2")
        assert other.recv(5.0).arbitration_id == 2


def test_a_guest_that_leaves_at_once_has_said_all_that_it_sent(running: Running) -> None:
    with program(
        "for n in range(3000):",
        "    bus.send(can.Message(arbitration_id=1, is_extended_id=False,",
        "                         data=n.to_bytes(4, 'big')), timeout=10.0)",
        "bus.shutdown()",
        endpoint=running.endpoint,
    ) as process:
        assert numbers(running.taken(3000)) == list(range(3000))
        assert process.wait(10.0) == 0


@pytest.mark.parametrize("end", ["pass", "sys.exit(3)", "raise RuntimeError('a bug')"])
def test_a_program_that_never_shuts_its_bus_down_ends_all_the_same(
    running: Running, end: str
) -> None:
    with program(end, endpoint=running.endpoint) as process:
        assert process.wait(10.0) == {"pass": 0, "sys.exit(3)": 3}.get(end, 1)
    assert running.until(lambda: running.hub.clients() == 0)


def test_a_guest_that_is_killed_has_left(running: Running) -> None:
    with program("time.sleep(60)", endpoint=running.endpoint) as process:
        assert running.until(lambda: running.hub.clients() == 1)
        process.kill()
        assert running.until(lambda: running.hub.clients() == 0)


def test_a_guest_that_was_frozen_is_told_and_has_held_up_nobody(running: Running) -> None:
    with (
        program(
            "try:",
            "    while True: bus.recv(1.0)",
            "except can.CanError as error: print(error, flush=True)",
            "bus.shutdown()",
            endpoint=running.endpoint,
        ) as process,
        running.open(user="boss") as other,
    ):
        assert running.until(lambda: running.hub.clients() == 2)
        process.send_signal(signal.SIGSTOP)
        heard = 0
        while running.hub.clients() == 2 and heard < 1_000_000:
            running.deliver(*(Frame(1, n.to_bytes(4, "big")) for n in range(100)))
            for _ in range(100):
                assert other.recv(5.0) is not None
            heard += 100
        assert running.hub.clients() == 1
        # Before its end is noticed, the other one hears more than the frozen one has credit for.
        assert heard > 2 * INITIAL_CREDIT_BYTES // LEAST_BYTES
        process.send_signal(signal.SIGCONT)
        said, _ = process.communicate(timeout=20.0)
        assert "router has gone, or the network to it" in said


def test_a_killed_router_is_an_error_and_not_a_wait_for_ever(tmp_path: Path) -> None:
    (tmp_path / "w").mkdir()
    path = os.pathsep.join(sys.path)
    with subprocess.Popen(
        [sys.executable, "-c", HOST, str(tmp_path / "w")],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": path},
    ) as host:
        assert host.stdout is not None
        endpoint = host.stdout.readline().strip()
        bus = can.Bus(
            interface="fleetloop", channel="r1", endpoint=endpoint, user="bench", password="agreed"
        )
        told = threading.Event()

        def wait() -> None:  # with no time-out at all
            with pytest.raises(can.CanOperationError):
                bus.recv()
            told.set()

        waiting = threading.Thread(target=wait, daemon=True)
        waiting.start()
        host.kill()
        assert told.wait(30.0)
        assert "router has gone, or the network to it" in error_within(bus, 30.0)
        with pytest.raises(can.CanOperationError, match="router has gone"):
            bus.send(frame(0), timeout=1.0)
        closer = threading.Thread(target=bus.shutdown, daemon=True)
        closer.start()
        closer.join(20.0)
        assert not closer.is_alive()


@pytest.fixture
def slow_way(running: Running) -> Iterator[CutProxy]:
    proxy = CutProxy(int(running.endpoint.rpartition(":")[2]), delay_s=0.01)
    yield proxy
    proxy.close()


def test_over_a_slow_way_nothing_is_lost(running: Running, slow_way: CutProxy) -> None:
    with running.open(endpoint=f"tcp/127.0.0.1:{slow_way.port}") as guest:
        for n in range(4000):
            guest.send(frame(n), timeout=5.0)
        assert numbers(running.taken(4000)) == list(range(4000))
        for n in range(4000):
            running.deliver(Frame(1, n.to_bytes(4, "big")))
        assert [int.from_bytes(guest.recv(5.0).data, "big") for _ in range(4000)] == list(
            range(4000)
        )


def test_a_silent_cut_is_an_error_at_the_guest_and_a_goodbye_at_the_hub(
    running: Running, slow_way: CutProxy
) -> None:
    guest = running.open(endpoint=f"tcp/127.0.0.1:{slow_way.port}")
    assert running.until(lambda: running.hub.clients() == 1)
    slow_way.cut()
    assert "router has gone, or the network to it" in error_within(guest, 30.0)
    assert running.until(lambda: running.hub.clients() == 0)
    with pytest.raises(can.CanOperationError, match="gone"):
        guest.send(frame(0))
    guest.shutdown()
