"""The hub against clients that don't keep to anything: raw sockets that write what they like."""

import errno
import select
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator

import can
import pytest

from bridge.can_bus import hub, server, sockets
from bridge.can_bus.connection import TURN
from bridge.can_bus.hub import Hub
from bridge.can_bus.packet import (
    DONE,
    FRAMES,
    HELLO,
    MAX_BYTES,
    MAX_FRAMES,
    MORE,
    REFUSED,
    SYNCHRONOUS,
    VERSION,
    WELCOME,
    Packet,
    Transmitted,
    decode,
    encode_frames,
    encode_text,
)
from bridge.frame import ERR, RTR, Frame

SECRET = "told to nobody else"
CONTROLLERS = {"r1": {"r1": SECRET, "r2": "another"}}


class Stranger:
    """A client made of a socket."""

    def __init__(self, name: str = "", flags: int = 0, version: int = VERSION) -> None:
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.socket.connect(str(sockets.socket_path(sockets.base_folder() / "hub", "r1")))
        self.socket.settimeout(5.0)
        self.say(encode_text(HELLO, name, flags=flags, count=version))

    def say(self, data: bytes) -> None:
        self.socket.send(data)

    def frames(self, *frames: Frame, flags: int = 0, stamp_ns: int = 0) -> None:
        self.say(encode_frames(flags, stamp_ns, frames))

    def hear(self) -> Packet:
        packet = decode(self.socket.recv(MAX_BYTES))
        assert packet is not None
        return packet

    def hear_question(self) -> list[Frame]:
        """All frames of a question, in however many packets it comes."""
        frames: list[Frame] = []
        while True:
            packet = self.hear()
            assert packet.kind == FRAMES
            frames += packet.frames
            if not packet.flags & MORE:
                return frames


class Serving:
    """A hub that the test serves."""

    def __init__(self, queue: int = 0) -> None:
        folder = sockets.create_run_folder("hub")
        self.hub = Hub(sockets.listen(folder, ("r1",)), queue=queue, controllers=CONTROLLERS)
        self.strangers: list[Stranger] = []

    def join(self, name: str = "", flags: int = 0, version: int = VERSION) -> Stranger:
        stranger = Stranger(name, flags, version)
        self.strangers.append(stranger)
        self.serve()
        return stranger

    def serve(self) -> None:
        """Handle all that is there."""
        for _ in range(5):
            self.hub.serve(0.0)

    def close(self) -> None:
        self.hub.close("the test is over")
        for stranger in self.strangers:
            stranger.socket.close()
        sockets.remove_run_folder(sockets.base_folder() / "hub")


@pytest.fixture
def serving(runtime_folder) -> Iterator[Serving]:
    serving = Serving()
    yield serving
    serving.close()


# --- whom bus time waits for ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("", "that the run started, of r1, r2"),
        ("r1", "that the run started"),
        ("r1\0wrong", "that the run started"),
        ("r1\0", "that the run started"),
        ("r2\0" + SECRET, "that the run started"),  # another's
        ("r9\0" + SECRET, "that the run started"),
        ("r1\0ü", "that the run started"),
    ],
)
def test_nobody_but_a_robots_own_controller_is_waited_for(serving, name: str, why: str) -> None:
    refused = serving.join(name, SYNCHRONOUS).hear()
    assert refused.kind == REFUSED
    assert why in refused.text
    assert (serving.hub.clients(), serving.hub.left()) == (0, ())
    assert serving.hub.await_controllers(0.0) == ("r1", "r2")


def test_a_bus_in_real_time_waits_for_nobody(runtime_folder) -> None:
    hub = Hub(sockets.listen(sockets.create_run_folder("hub"), ("r1",)))
    refused = Stranger("r1\0" + SECRET, SYNCHRONOUS)
    for _ in range(3):
        hub.serve(0.0)
    assert "this bus has none" in refused.hear().text
    refused.socket.close()
    hub.close("")
    sockets.remove_run_folder(sockets.base_folder() / "hub")


def test_a_second_controller_of_a_robot_is_refused_while_the_first_is_there(serving) -> None:
    first = serving.join(f"r1\0{SECRET}", SYNCHRONOUS)
    assert first.hear().kind == WELCOME
    second = serving.join(f"r1\0{SECRET}", SYNCHRONOUS)
    assert "the controller of r1 is on it already" in second.hear().text
    assert serving.hub.await_controllers(0.0) == ("r2",)
    assert serving.hub.left() == ()
    first.socket.close()
    serving.serve()
    assert serving.hub.left() == ("r1",)


def test_a_stranger_that_says_a_robots_name_unpaced_and_leaves_is_not_its_controller(
    serving,
) -> None:
    stranger = serving.join(f"r1\0{SECRET}")
    assert stranger.hear().kind == WELCOME
    stranger.socket.close()
    serving.serve()
    assert serving.hub.left() == ()


def test_the_bus_interface_says_why_it_was_refused(serving) -> None:
    def refusal(**options) -> str:
        caught: list[str] = []

        def join() -> None:
            with pytest.raises(can.CanInitializationError) as error:
                can.Bus(interface="fleetloop", channel="hub/r1", **options)
            caught.append(str(error.value))

        opener = threading.Thread(target=join)
        opener.start()
        while opener.is_alive():
            serving.hub.serve(0.01)
        return caught[0]

    assert "refused: synchronous is for the controllers" in refusal(
        synchronous="r1", secret="guessed"
    )
    assert "refused: synchronous is for the controllers" in refusal(synchronous="r1")
    assert "must name the robot" in refusal(synchronous=True)
    assert "must name the robot" in refusal(synchronous=3)


# --- who connects and says nothing ----------------------------------------------------------------


def test_any_number_of_connections_that_say_nothing_keep_nobody_out(serving) -> None:
    silent = []
    for _ in range(3 * server.MAX_UNIDENTIFIED):
        silent.append(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
        silent[-1].connect(str(sockets.socket_path(sockets.base_folder() / "hub", "r1")))
        serving.serve()
    assert serving.join().hear().kind == WELCOME
    assert serving.join(f"r1\0{SECRET}", SYNCHRONOUS).hear().kind == WELCOME
    ended = [select.select([one], [], [], 0.0)[0] and not one.recv(1) for one in silent]
    assert sum(map(bool, ended)) >= 2 * server.MAX_UNIDENTIFIED
    for one in silent:
        one.close()


def test_who_finds_the_way_in_crowded_waits_for_its_turn(
    runtime_folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sockets, "_BACKLOG", 0)
    serving = Serving()
    crowd = [socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(4)]
    for one in crowd:
        one.setblocking(False)
    path = str(sockets.socket_path(sockets.base_folder() / "hub", "r1"))
    assert errno.EAGAIN in [one.connect_ex(path) for one in crowd]
    with pytest.raises(can.CanInitializationError, match="no answer in time"):
        can.Bus(interface="fleetloop", channel="r1", connect_timeout=0.05)
    opened: list[can.BusABC] = []
    opener = threading.Thread(
        target=lambda: opened.append(can.Bus(interface="fleetloop", channel="r1"))
    )
    opener.start()
    while opener.is_alive():
        serving.hub.serve(0.01)
    opened[0].shutdown()
    for one in crowd:
        one.close()
    serving.close()


# --- much between two questions -------------------------------------------------------------------


@pytest.mark.parametrize("queue", [0, 10])
@pytest.mark.parametrize("count", [1, 1024, 1025, 5000, 66_000])
def test_a_controller_is_asked_whatever_others_said_between_two_questions(
    runtime_folder, queue: int, count: int
) -> None:
    serving = Serving(queue)
    controller = serving.join(f"r1\0{SECRET}", SYNCHRONOUS)
    stranger = serving.join()
    for packet in (controller, stranger):
        assert packet.hear().kind == WELCOME
    said = [Frame(n % 0x800, n.to_bytes(4, "big")) for n in range(count)]
    heard: list[Frame] = []

    def read() -> None:
        heard.extend(controller.hear_question())

    if queue:
        reader = threading.Thread(target=read)
        reader.start()
        serving.hub.forward("r1", 9, [Transmitted(9, frame, key=2) for frame in said], "r1")
    else:
        for first in range(0, count, MAX_FRAMES):
            stranger.frames(*said[first : first + MAX_FRAMES])
            serving.serve()
        reader = threading.Thread(target=read)
        reader.start()
        serving.hub.deliver("r1", 9, (Frame(0x009, b""),))
        said.append(Frame(0x009, b""))
    while reader.is_alive():
        serving.hub.collect(0.01)
    assert heard == said
    controller.frames(Frame(0x00E, b""), flags=DONE, stamp_ns=9)
    assert any(serving.hub.collect(0.5) for _ in range(10))
    serving.close()


def test_replies_of_drives_to_very_many_requests_reach_the_controller(serving) -> None:
    controller = serving.join(f"r1\0{SECRET}", SYNCHRONOUS)
    assert controller.hear().kind == WELCOME
    replies = [Frame(n % 0x800, n.to_bytes(4, "big")) for n in range(66_000)]
    heard: list[Frame] = []
    reader = threading.Thread(target=lambda: heard.extend(controller.hear_question()))
    reader.start()
    serving.hub.deliver("r1", 9, replies)
    while reader.is_alive():
        serving.hub.collect(0.01)
    assert heard == replies


def test_what_a_controller_says_is_taken_at_once_and_what_others_say_a_turn_at_a_time(
    serving,
) -> None:
    controller = serving.join(f"r1\0{SECRET}", SYNCHRONOUS)
    stranger = serving.join()
    said = [Frame(n % 0x700, n.to_bytes(4, "big")) for n in range(10_000)]
    for first in range(0, len(said), 1000):
        stranger.frames(*said[first : first + 1000])
        serving.serve()
    controller.frames(Frame(0x70E, b""))
    serving.serve()
    first = serving.hub.receive("r1")
    assert Frame(0x70E, b"") in first
    first.remove(Frame(0x70E, b""))
    assert len(first) < 2 * TURN
    taken = first
    while serving.hub.pending():
        more = serving.hub.receive("r1")
        assert len(more) <= TURN
        taken += more
    assert taken == said


def test_who_says_more_than_is_taken_is_not_read_until_it_is(
    serving, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hub, "UNTAKEN", 100)
    flood, quiet = serving.join(), serving.join()
    flood.socket.setblocking(False)
    sent = 0
    with pytest.raises(BlockingIOError):
        while sent < 100_000:
            flood.frames(Frame(1, sent.to_bytes(4, "big")))
            sent += 1
            serving.hub.serve(0.0)
    assert 100 < sent < 2000  # what a socket holds, and no more
    quiet.frames(Frame(2, b""))
    taken: list[Frame] = []
    for _ in range(sent):
        serving.hub.serve(0.0)
        taken += serving.hub.receive("r1")
    ours = [int.from_bytes(data, "big") for can_id, data in taken if can_id == 1]
    assert ours == list(range(sent))
    assert Frame(2, b"") in taken


# --- what is no frame -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("can_id", "length"), [(0x802, 4), (0x123, 9), (ERR | RTR, 0), (RTR | 0x800, 0)]
)
@pytest.mark.parametrize("queue", [0, 10])
def test_what_is_no_classic_frame_is_counted_and_goes_nowhere(
    runtime_folder, can_id: int, length: int, queue: int
) -> None:
    serving = Serving(queue)
    stranger, other = serving.join(), serving.join()
    packet = bytearray(encode_frames(0, 0, [Frame(1, b"a"), Frame(2, b"b"), Frame(3, b"c")]))
    packet[32:37] = struct.pack("<IB", can_id, length)
    stranger.say(bytes(packet))
    serving.serve()
    good = [Frame(1, b"a"), Frame(3, b"c")]
    if queue:
        assert [frame for _, frame in serving.hub.submitted("r1")] == good
    else:
        assert serving.hub.receive("r1") == good
        assert other.hear().kind == WELCOME
        assert [other.hear().frames for _ in good] == [(frame,) for frame in good]
    assert serving.hub.counters("r1").garbage == 1
    assert "1 × what is no frame" in serving.hub.troubles()["r1"]
    assert serving.hub.counters("r1").from_clients == 2
    serving.close()


def test_with_bit_timing_an_error_frame_is_for_the_wire(runtime_folder) -> None:
    serving = Serving(10)
    serving.join().frames(Frame(ERR | 4, bytes(8)))
    serving.serve()
    assert [frame for _, frame in serving.hub.submitted("r1")] == [Frame(ERR | 4, bytes(8))]
    serving.close()


def test_with_bit_timing_what_drives_sent_is_counted_and_error_frames_are_not(
    runtime_folder,
) -> None:
    serving = Serving(10)
    serving.join().frames(Frame(0x00E, bytes(4)))
    serving.serve()
    passed = [
        Transmitted(1, Frame(0x009, bytes(8))),
        Transmitted(2, Frame(0x029, bytes(8))),
        Transmitted(3, Frame(0x00E, bytes(4)), key="r1"),
        Transmitted(4, Frame(ERR | 4, bytes(8))),
        Transmitted(5, Frame(ERR | 4, bytes(8)), to="r1"),
    ]
    serving.hub.forward("r1", 6, passed)
    counters = serving.hub.counters("r1")
    assert (counters.from_drives, counters.from_clients) == (2, 1)
    serving.close()


FULL = """
import os, resource, sys
from bridge.can_bus import sockets
from bridge.can_bus.hub import Hub

with sockets.run_folder("full") as folder:
    hub = Hub(sockets.listen(folder, ("r1",)))
    last = os.dup(0)
    os.close(last)
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (last, hard))
    print(folder / "r1.can", flush=True)
    hub.serve(30.0)
    hub.serve(0.0)
    print(sum(hub.serve(0.01) is None for _ in range(3)), flush=True)
    resource.setrlimit(resource.RLIMIT_NOFILE, (last + 8, hard))
    while not hub.clients():
        hub.serve(30.0)
    hub.close("done")
"""


def test_a_client_for_which_there_is_no_descriptor_is_told_so_and_the_next_is_taken() -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", FULL], stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    with process, process.stdout as said:
        channel = said.readline().strip()
        with pytest.raises(can.CanInitializationError, match=r"too many open files .*ulimit -n"):
            can.Bus(interface="fleetloop", channel=channel)
        assert said.readline() == "3\n"
        with (
            can.Bus(interface="fleetloop", channel=channel) as bus,
            pytest.raises(can.CanOperationError, match="done"),
        ):
            bus.recv(10.0)
        assert process.wait(30) == 0
