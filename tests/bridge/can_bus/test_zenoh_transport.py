"""A bus from another machine: what becomes of it when the way, the guest or the hub fails."""

import os
import random
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest
from support.cut_proxy import CutProxy
from support.hub_running import Running

from bridge.can_bus import connection, flow_control, relay, zenoh_transport
from bridge.can_bus.packet import (
    BYE,
    HELLO,
    MAX_BYTES,
    VERSION,
    encode_text,
)
from bridge.frame import Frame
from bridge.network import keys
from bridge.network.client import open_client
from bridge.network.zenoh_link import ZenohLink
from configs.brief import NetworkLink

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
def running(runtime_folder, tmp_path: Path) -> Iterator[Running]:
    running = Running(tmp_path)
    yield running
    running.close()


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
        assert [(m.arbitration_id, bytes(m.data)) for m in heard] == sent
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


def test_a_bus_that_was_not_granted_is_refused_by_name(running: Running) -> None:
    with pytest.raises(can.CanInitializationError, match="'bench' may open r1, not 'r2'"):
        running.open("r2")
    with running.open("r2", user="boss"):
        pass


def test_a_bus_that_is_not_there_is_refused_with_what_there_is(running: Running) -> None:
    with pytest.raises(can.CanInitializationError, match="no bus 'r9' is up; buses here: r1, r2"):
        running.open("r9", user="boss")


def test_a_run_may_be_named_with_the_bus(running: Running) -> None:
    with running.open("test/r1"):
        pass
    with pytest.raises(can.CanInitializationError, match="no run 'other' is here but 'test'"):
        running.open("other/r1")


def test_an_endpoint_where_nobody_listens_and_a_refused_login_are_told_apart(
    running: Running,
) -> None:
    with pytest.raises(can.CanInitializationError, match="no program listens there"):
        running.open(endpoint="tcp/127.0.0.1:1", connect_timeout=0.5)
    with pytest.raises(can.CanInitializationError, match="refused the login"):
        running.open(user="stranger", password="x", connect_timeout=0.5)


def test_a_guest_can_not_speak_in_anothers_name(running: Running) -> None:
    assert running.remote is not None
    settings = running.remote.settings("bench")
    network = NetworkLink("", settings["endpoint"], "bench", settings["password"])
    hello = encode_text(HELLO, "x", count=VERSION)
    with open_client(network, 5.0) as link:
        forged = keys.guest_line("boss", "f0", "r2")
        link.declare_live(f"{forged}/alive")
        link.publisher(f"{forged}/up").put(hello)
        own = keys.guest_line("bench", "0f", "r1")
        link.declare_live(f"{own}/alive")
        mouth = link.publisher(f"{own}/up")
        # One session keeps order: once its own hello arrives, the forged one would have.
        assert running.until(lambda: mouth.put(hello) or running.hub.clients())
        assert running.hub.counters("r1").joins == 1
        assert running.hub.counters("r2").joins == 0


@contextmanager
def raw_session(running: Running, user: str = "bench") -> Iterator[ZenohLink]:
    """A guest's session without its line: what its own program could do with it."""
    assert running.remote is not None
    settings = running.remote.settings(user)
    network = NetworkLink("", settings["endpoint"], user, settings["password"])
    with open_client(network, 5.0) as link:
        yield link


HELLO_PACKET = encode_text(HELLO, "x", count=VERSION)


@pytest.mark.parametrize(
    "place",
    ["", "/l", "/l/r1/r1/r1", "/l/test/r1/x/y", "/*/r1", "/l/*", "/**", "/@l/r1", "/l/@relay"],
)
def test_a_hello_on_the_key_of_no_line_is_nothing_to_anybody(running: Running, place: str) -> None:
    with raw_session(running) as link, running.open("r2", "boss") as other:
        key = f"fleetloop/@guest/bench{place}"
        if "*" not in place:  # no token can be declared on a pattern
            link.declare_live(f"{key}/alive")
        for packet in (HELLO_PACKET, encode_text(BYE), b"", b"\xff" * 40):
            link.publisher(f"{key}/up").put(packet)
        with running.open() as guest:  # its session's own order: all of that was heard before
            running.deliver(Frame(2, b""))
            assert guest.recv(5.0).arbitration_id == 2
        running.deliver(Frame(3, b""), bus="r2")
        assert other.recv(5.0).arbitration_id == 3


def test_no_packets_in_whatever_order_end_anybody_elses_line(running: Running) -> None:
    dice = random.Random(7)
    said = [HELLO_PACKET, b"", b"\x00", encode_text(BYE), bytes(MAX_BYTES + 1)]
    said += [dice.randbytes(dice.randrange(1, 200)) for _ in range(20)]
    said += [
        bytes((kind,)) + dice.randbytes(dice.randrange(40)) for kind in range(8) for _ in "abc"
    ]
    with raw_session(running) as link, running.open("r2", "boss") as other:
        lines = [keys.guest_line("bench", f"l{n}", dice.choice(("r1", "r2", "no"))) for n in "0123"]
        mouths = [link.publisher(f"{line}/up") for line in lines]
        alive: set[str] = set()
        for n in range(1500):
            which = dice.randrange(len(lines))
            token = f"{lines[which]}/alive"
            if dice.random() < 0.2:
                (link.withdraw_live if token in alive else link.declare_live)(token)
                alive ^= {token}
            mouths[which].put(dice.choice(said))
            if n % 100 == 0:
                running.deliver(Frame(n, b""), bus="r2")
                assert other.recv(5.0).arbitration_id == n
        with running.open() as guest:
            running.deliver(Frame(3, b""))
            assert guest.recv(5.0).arbitration_id == 3


def test_a_line_that_fails_by_an_error_of_ours_is_the_only_one_that_ends(
    running: Running, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with running.open() as guest, running.open("r2", "boss") as other:

        def fails(self: relay.Guest) -> bool:
            if "/bench/" in self.place:
                raise RuntimeError("a bug")
            return True

        monkeypatch.setattr(relay.Guest, "push", fails)
        guest.send(frame(1))
        assert running.until(lambda: running.hub.clients() == 1)
        running.deliver(Frame(3, b""), bus="r2")
        assert other.recv(5.0).arbitration_id == 3
        assert "a bug" in caplog.text
        monkeypatch.undo()


def test_a_user_has_so_many_lines_and_no_more(running: Running, monkeypatch) -> None:
    monkeypatch.setattr(relay, "MAX_LINES", 2)
    refused = pytest.raises(can.CanInitializationError, match="has 2 connections open already")
    with running.open(), running.open(), running.open(user="boss"), refused:
        running.open()
    with running.open():
        pass


def test_what_is_held_of_a_user_is_bounded_and_nobody_elses(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(relay, "MAX_HELD_BYTES", 100_000)
    assert running.remote is not None
    held = running.remote.relay._held
    with raw_session(running) as link, running.open("r2", "boss") as other:
        mouth = link.publisher(f"{keys.guest_line('bench', 'l', 'r1')}/up")
        for _ in range(3000):
            mouth.put(bytes(1000))
            assert held["bench"] <= 100_000
        running.deliver(Frame(3, b""), bus="r2")
        assert other.recv(5.0).arbitration_id == 3


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


def test_what_a_guest_does_not_read_is_dropped_and_counted_by_the_hub_as_for_all(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "BACKLOG", 500)
    monkeypatch.setattr(zenoh_transport, "BACKLOG", 100)
    with running.open() as late:
        for n in range(5000):
            running.deliver(Frame(1, n.to_bytes(4, "big")))
        dropped = running.hub.counters("r1").dropped
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


@pytest.mark.wall_clock
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
        waits = []
        for n in range(100_000):
            began = time.monotonic()
            running.deliver(Frame(1, n.to_bytes(4, "big")))
            assert other.recv(5.0) is not None
            waits.append(time.monotonic() - began)
            if running.hub.clients() == 1:
                break
        assert running.hub.clients() == 1
        assert max(waits) < 0.9  # of the second in which its end is noticed
        process.send_signal(signal.SIGCONT)
        said, _ = process.communicate(timeout=20.0)
        assert "router has gone, or the network to it" in said


@pytest.mark.wall_clock
def test_a_killed_router_is_an_error_within_seconds_and_not_a_wait_for_ever(tmp_path: Path) -> None:
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
        assert told.wait(5.0)
        assert "router has gone, or the network to it" in error_within(bus, 1.0)
        with pytest.raises(can.CanOperationError, match="router has gone"):
            bus.send(frame(0), timeout=1.0)
        began = time.monotonic()
        bus.shutdown()
        assert time.monotonic() - began < 3.0


@pytest.fixture
def slow_way(running: Running) -> Iterator[CutProxy]:
    proxy = CutProxy(int(running.endpoint.rpartition(":")[2]), delay_s=0.01)
    yield proxy
    proxy.close()


@pytest.mark.wall_clock
def test_over_a_slow_way_nothing_is_lost_and_the_window_is_wide_enough_for_a_full_bus(
    running: Running, slow_way: CutProxy
) -> None:
    with running.open(endpoint=f"tcp/127.0.0.1:{slow_way.port}") as guest:
        began = time.monotonic()
        for n in range(4000):
            guest.send(frame(n), timeout=5.0)
        assert numbers(running.taken(4000)) == list(range(4000))
        # 1 Mbit/s carries at most 1 Mbit/s / 79 bit = 12,700 frames of 4 bytes a second.
        assert 4000 / (time.monotonic() - began) > 3000
        for n in range(4000):
            running.deliver(Frame(1, n.to_bytes(4, "big")))
        assert [int.from_bytes(guest.recv(5.0).data, "big") for _ in range(4000)] == list(
            range(4000)
        )


@pytest.mark.wall_clock
def test_a_silent_cut_is_an_error_at_the_guest_and_a_goodbye_at_the_hub_within_seconds(
    running: Running, slow_way: CutProxy
) -> None:
    guest = running.open(endpoint=f"tcp/127.0.0.1:{slow_way.port}")
    assert running.until(lambda: running.hub.clients() == 1)
    slow_way.cut()
    began = time.monotonic()
    assert "router has gone, or the network to it" in error_within(guest, 10.0)
    assert time.monotonic() - began < 5.0
    assert running.until(lambda: running.hub.clients() == 0)
    with pytest.raises(can.CanOperationError, match="gone"):
        guest.send(frame(0))
    guest.shutdown()
