"""Rows over sockets: all of them, once, in order, from whom they are; nobody waits for ever."""

import os
import socket
import threading
from collections import deque
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.network.link import Arrival
from bridge.network.messages import MOST_BYTES
from bridge.network.row_socket import (
    PATIENCE_S,
    ROOM_BYTES,
    TURN,
    RowSocket,
    RowSockets,
    hand_over,
    pair,
    row_publisher,
)
from bridge.process.clock import SYSTEM_CLOCK

TAGS = {"agent/r1": ("inputs/r1", "controller/r1"), "agent/r2": ("controller/r2",)}


class Heard:
    """A publisher on the network."""

    def __init__(self) -> None:
        self.payloads: list[bytes] = []

    def put(self, payload: bytes) -> None:
        self.payloads.append(payload)


class Lines:
    """The lines of two processes to a recorder."""

    def __init__(self, link: object = None) -> None:
        self.ends: dict[str, socket.socket] = {}
        self._launchers, recorders = pair()
        self.recorder = RowSockets(recorders, TAGS, link)
        for process in TAGS:
            self.connect(process)

    def connect(self, process: str) -> None:
        self.ends[process], recorders = pair()
        with recorders:
            hand_over(self._launchers, process, recorders)

    def sender(self, process: str, patience_s: float = 0.0) -> RowSocket:
        return RowSocket(self.ends[process], patience_s)

    def received(self) -> list[tuple[str, bytes]]:
        found = []
        while (arrival := self.recorder.receive(0.0)) is not None:
            found.append((arrival.tag, arrival.payload))
        return found

    def close(self) -> None:
        self.recorder.__exit__(None, None, None)
        for end in (self._launchers, *self.ends.values()):
            end.close()


@pytest.fixture
def lines() -> Iterator[Lines]:
    opened = Lines()
    yield opened
    opened.close()


BLOCKS = st.lists(
    st.tuples(
        st.sampled_from([(process, tag) for process, tags in TAGS.items() for tag in tags]),
        st.integers(0, MOST_BYTES["telemetry"]),
        st.booleans(),
    ),
    max_size=60,
)


@given(BLOCKS)
def test_every_block_comes_once_in_its_senders_order(blocks) -> None:
    lines = Lines()
    try:
        senders = {process: lines.sender(process) for process in TAGS}
        sent: dict[str, list[tuple[str, bytes]]] = {process: [] for process in TAGS}
        came: list[tuple[str, bytes]] = []
        for (process, tag), size, reads in blocks:
            payload = os.urandom(8) + bytes(size)
            sent[process].append((tag, payload))
            row_publisher(senders[process], tag, Heard()).put(payload)
            if reads:
                came += lines.received()
        for sender in senders.values():
            while sender._kept:
                came += lines.received()
                sender._drain()
        came += lines.received()
        for process, tags in TAGS.items():
            assert [one for one in came if one[0] in tags] == sent[process]
    finally:
        lines.close()


def test_who_listens_on_the_network_hears_the_same_blocks(lines: Lines) -> None:
    heard = Heard()
    publisher = row_publisher(lines.sender("agent/r1"), "controller/r1", heard)
    publisher.put(b"one")
    publisher.put(b"two")
    assert lines.received() == [("controller/r1", b"one"), ("controller/r1", b"two")]
    assert heard.payloads == [b"one", b"two"]
    assert row_publisher(None, "controller/r1", heard) is heard


@pytest.mark.parametrize("packet", [b"controller/r1\0rows", b"plant/r2\0rows", b"rows", b"\0"])
def test_what_is_not_of_its_sender_is_refused_and_counted(lines: Lines, packet: bytes) -> None:
    lines.ends["agent/r2"].send(packet)
    lines.sender("agent/r2").send(b"controller/r2\0", b"own")
    assert lines.received() == [("controller/r2", b"own")]
    assert lines.recorder.refused == {"agent/r2": 1}


def test_what_a_process_sent_outlives_it_and_comes_before_its_successors(lines: Lines) -> None:
    child = os.fork()
    if child == 0:
        sender = lines.sender("agent/r1")
        for number in range(3 * TURN):
            sender.send(b"controller/r1\0", b"%d" % number)
        os.kill(os.getpid(), 9)
    os.waitpid(child, 0)
    lines.ends["agent/r1"].close()
    lines.connect("agent/r1")
    lines.sender("agent/r1").send(b"controller/r1\0", b"last")
    blocks = [b"%d" % number for number in range(3 * TURN)]
    assert lines.received() == [("controller/r1", block) for block in (*blocks, b"last")]


def test_a_recorder_that_does_not_read_costs_memory_up_to_a_bound_and_no_time(
    lines: Lines,
) -> None:
    sender, block, sent = lines.sender("agent/r1"), bytes(1 << 16), 0
    began_s = SYSTEM_CLOCK.monotonic_s()
    while not sender.remarks():
        sent += 1
        sender.send(b"controller/r1\0", sent.to_bytes(4, "little") + block)
        assert sent < 2 * ROOM_BYTES // len(block)
    assert SYSTEM_CLOCK.monotonic_s() - began_s < PATIENCE_S
    assert sender.remarks() == [
        "1 blocks for the record are lost: the recorder was too slow for them"
    ]
    reader = Reader(lines, sent - 1)
    sender.flush()
    reader.join(10.0)
    numbers = [int.from_bytes(payload[:4], "little") for _, payload in reader.came]
    assert numbers == list(range(1, sent))


class Reader(threading.Thread):
    """A recorder at work, until so many blocks have come."""

    def __init__(self, lines: Lines, count: int) -> None:
        super().__init__(daemon=True)
        self.came: list[tuple[str, bytes]] = []
        self._lines, self._count = lines, count
        self.start()

    def run(self) -> None:
        deadline_s = SYSTEM_CLOCK.monotonic_s() + 20.0
        while len(self.came) < self._count and SYSTEM_CLOCK.monotonic_s() < deadline_s:
            # None, too, when it was woken to take an end.
            if (arrival := self._lines.recorder.receive(1.0)) is not None:
                self.came.append((arrival.tag, arrival.payload))


def test_in_lockstep_a_run_waits_for_its_recorder_and_loses_nothing(lines: Lines) -> None:
    sender, block = lines.sender("agent/r1", PATIENCE_S), bytes(1 << 16)
    count = 3 * ROOM_BYTES // len(block)
    reader = Reader(lines, count)
    for number in range(count):
        sender.send(b"controller/r1\0", number.to_bytes(4, "little") + block)
    sender.flush()
    reader.join(20.0)
    assert sender.remarks() == []
    numbers = [int.from_bytes(payload[:4], "little") for _, payload in reader.came]
    assert numbers == list(range(count))


def test_a_recorder_that_never_reads_again_is_not_waited_for(lines: Lines) -> None:
    sender = lines.sender("agent/r1")
    while not sender._kept:
        sender.send(b"controller/r1\0", bytes(1 << 16))
    began_s = SYSTEM_CLOCK.monotonic_s()
    sender.flush()
    assert SYSTEM_CLOCK.monotonic_s() - began_s < 4 * PATIENCE_S
    assert sender.remarks()


def test_a_recorder_that_stands_still_is_waited_for_once_and_again_when_it_goes_on(
    lines: Lines,
) -> None:
    sender, block = lines.sender("agent/r1", PATIENCE_S), bytes(1 << 16)
    for _ in range(ROOM_BYTES // len(block)):
        sender.send(b"controller/r1\0", block)
    began_s = SYSTEM_CLOCK.monotonic_s()
    while not sender.remarks():
        sender.send(b"controller/r1\0", block)
    for _ in range(20):
        sender.send(b"controller/r1\0", block)
    assert SYSTEM_CLOCK.monotonic_s() - began_s < 4 * PATIENCE_S
    assert lines.received()
    before = sender.remarks()
    sender.send(b"controller/r1\0", block)
    assert sender.remarks() == before


def test_a_recorder_that_has_ended_takes_nothing_and_keeps_nobody_waiting(lines: Lines) -> None:
    sender = lines.sender("agent/r1", PATIENCE_S)
    while not sender._kept:
        sender.send(b"controller/r1\0", bytes(1 << 16))
    lines.recorder.__exit__(None, None, None)
    began_s = SYSTEM_CLOCK.monotonic_s()
    for _ in range(1000):
        sender.send(b"controller/r1\0", bytes(1 << 16))
    sender.flush()
    assert SYSTEM_CLOCK.monotonic_s() - began_s < PATIENCE_S
    assert sender.remarks() == []


def test_who_says_much_keeps_nobody_else_from_being_heard(lines: Lines) -> None:
    flooder = lines.sender("agent/r1")
    for _ in range(500):
        flooder.send(b"controller/r1\0", b"much")
    lines.sender("agent/r2").send(b"controller/r2\0", b"little")
    tags = [tag for tag, _ in lines.received()]
    assert len(tags) == 501
    assert tags.index("controller/r2") <= 2 * TURN


def test_a_recorder_that_starts_last_finds_the_sockets_of_the_largest_fleet() -> None:
    launchers, recorders = pair()
    processes = [f"agent/r{number}" for number in range(256)]
    launchers.settimeout(1.0)
    ends = []
    for process in processes:
        own, theirs = pair()
        ends.append(own)
        with theirs:
            hand_over(launchers, process, theirs)
        RowSocket(own, 0.0).send(f"{process}\0".encode(), b"hello")
    with RowSockets(recorders, {process: [process] for process in processes}) as recorder:
        heard = [recorder.receive(1.0) for _ in processes]
    assert sorted(arrival.tag for arrival in heard if arrival) == sorted(processes)
    for end in (launchers, *ends):
        end.close()


def test_those_elsewhere_are_heard_as_well() -> None:
    waiting = deque(Arrival("plant/r1", "key", b"%d" % n) for n in range(3 * TURN))

    class Link:
        def receive(self, timeout_s: float) -> Arrival | None:
            assert timeout_s == 0.0
            return waiting.popleft() if waiting else None

    lines = Lines(Link())
    try:
        lines.sender("agent/r1").send(b"controller/r1\0", b"rows")
        came = lines.received()
        assert ("controller/r1", b"rows") in came
        assert [it for it in came if it[0] == "plant/r1"] == [
            ("plant/r1", b"%d" % n) for n in range(3 * TURN)
        ]
    finally:
        lines.close()
