"""Errors of nodes on a wire: clashes, babbling, error states, bus-off, open lines, bit rates."""

import itertools
import random

import pytest
from support.babbler import Endless
from support.frame_faults import clear, frame_fault, inject

from bridge.frame import EFF, Frame
from bridge.frame_faults import ActingFrameFault
from bridge.wire.bits import frame_bits
from bridge.wire.confinement import NodeState
from bridge.wire.node import NEVER, Delivered, ErrorFrame, ErrorKind, Event, Node, StateChanged
from bridge.wire.queues import Fifo, Mailboxes
from bridge.wire.wire import Wire

US = 1000
MS = 1_000_000
BABBLE = Frame(0x000, bytes(8))
SYNC = Frame(0x080, b"")  # 51 bits


def delivered(events: list[Event]) -> list[Delivered]:
    return [event for event in events if isinstance(event, Delivered)]


def errors(events: list[Event]) -> list[ErrorFrame]:
    return [event for event in events if isinstance(event, ErrorFrame)]


def states(events: list[Event], node: Node) -> list[NodeState]:
    return [e.state for e in events if isinstance(e, StateChanged) and e.node is node]


def corrupt(count: int | None = 1, **match: object) -> ActingFrameFault:
    return frame_fault("can_corrupt", count=count, **match)


def off_the_bus(restart_ns: int | None) -> tuple[Wire, Node, Node, int]:
    """A wire of which one node has just gone bus-off, and when."""
    wire = Wire(1_000_000)
    node, other = wire.attach("node", restart_ns=restart_ns), wire.attach("other")
    inject(wire, corrupt(None))
    wire.submit(node, SYNC, 0)
    while node.state is not NodeState.BUS_OFF:
        due = wire.next_ns()
        assert due != NEVER
        wire.advance(due)
    clear(wire)
    return wire, node, other, wire.now_ns


# --- 26: duplicated node id -----------------------------------------------------------------------


def test_identical_frames_of_two_nodes_merge_and_nobody_notices() -> None:
    wire = Wire(1_000_000)
    one, two, host = (wire.attach(name) for name in ("one", "two", "host"))
    for node in (one, two):
        wire.submit(node, SYNC, 0)
    (event,) = delivered(wire.advance(MS))
    assert (event.sender, event.merged, event.heard_by) == (one, (two,), (host,))
    assert one.counters.sent == two.counters.sent == 1
    assert one.confinement.tec == two.confinement.tec == 0


def test_one_identifier_with_different_data_makes_both_climb_until_one_is_passive() -> None:
    # Then the passive one, which sends recessive where the other sends dominant, can't destroy the
    # frame any more: Cho and Shin, "Error handling of in-vehicle networks makes them vulnerable",
    # 2016. Both try 16 times; the 17th attempt of the dominant one succeeds.
    wire = Wire(1_000_000)
    dominant, recessive, host = (wire.attach(name) for name in ("a", "b", "host"))
    wire.submit(recessive, Frame(0x009, b"\xff"), 0)
    wire.submit(dominant, Frame(0x009, b"\x00"), 0)
    events = wire.advance(10 * MS)
    first, *_ = collisions = errors(events)
    assert len(collisions) == 16
    assert first.kind is ErrorKind.BIT
    assert set(first.senders) == {dominant, recessive}
    assert [event.sender for event in delivered(events)] == [dominant, recessive]
    assert dominant.confinement.tec == 127
    assert recessive.confinement.tec == 128 + 8 - 1
    assert host.confinement.rec < 16


def test_two_drives_with_one_node_id_and_changing_data_end_with_one_off_the_bus() -> None:
    wire = Wire(1_000_000)
    nodes = [wire.attach(f"drive{n}", queue=Mailboxes()) for n in range(2)]
    wire.attach("host")
    rng = random.Random(1)
    for k in range(2000):
        for node in nodes:
            wire.submit(node, Frame(0x009, rng.randbytes(8)), k * MS)
    events = wire.advance(3000 * MS)
    assert NodeState.BUS_OFF in {state for node in nodes for state in states(events, node)}
    assert len(delivered(events)) > 1000


# --- 37: babbler ----------------------------------------------------------------------------------


def test_a_node_that_babbles_identifier_0_fills_the_bus_and_starves_all_commands() -> None:
    wire = Wire(1_000_000)
    host, drive = wire.attach("host"), wire.attach("drive", queue=Mailboxes())
    babbler = wire.attach("babbler", queue=Endless(BABBLE))
    taken = [wire.submit(host, Frame(0x00E, bytes(4)), k * MS) for k in range(100)]
    events = delivered(wire.advance(100 * MS))
    assert {event.frame for event in events} == {BABBLE}
    assert wire.load > 0.999
    assert sum(taken) == 10
    assert host.counters.refused == 90
    wire.detach(babbler)
    assert [event.frame.can_id for event in delivered(wire.advance(110 * MS))][1:] == [0x00E] * 10
    assert len(drive.queue.entries) == 0


# --- 39: error frames, error passive --------------------------------------------------------------


@pytest.mark.parametrize("frame", [SYNC, Frame(0x009, b"\x12\x34"), Frame(0x123456 | EFF, b"\1")])
def test_a_corrupted_frame_is_sent_again_after_an_error_frame_of_17_to_23_bits(
    frame: Frame,
) -> None:
    wire = Wire(1_000_000)
    node, other = wire.attach("node"), wire.attach("other")
    inject(wire, corrupt())
    wire.submit(node, frame, 0)
    events = wire.advance(MS)
    (error,) = errors(events)
    assert error.kind is ErrorKind.FORM
    assert 17 * US <= error.free_ns - error.at_ns <= 23 * US
    (event,) = delivered(events)
    assert event.start_ns == error.free_ns
    assert (node.confinement.tec, other.confinement.rec) == (8 - 1, 1 - 1)
    assert (node.counters.accepted, node.counters.sent, node.counters.errors) == (1, 1, 1)


@pytest.mark.parametrize("data", [(b"\x00", b"\xff"), (b"\xaa\x0f", b"\xaa\xf0"), (b"\7", b"\3")])
def test_the_error_frame_of_a_clash_has_17_to_23_bits(data: tuple[bytes, bytes]) -> None:
    wire = Wire(1_000_000)
    nodes = [wire.attach(f"n{n}") for n in range(3)]
    for node, content in zip(nodes, data, strict=False):
        wire.submit(node, Frame(0x009, content), 0)
    first = errors(wire.advance(MS))[0]
    assert 17 * US <= first.free_ns - first.at_ns <= 23 * US


def test_a_passive_sender_keeps_running_with_a_pause_of_8_bits_after_each_frame() -> None:
    wire = Wire(1_000_000)
    node, _ = wire.attach("node", queue=Fifo(100)), wire.attach("other")
    inject(wire, corrupt(20))
    for _ in range(40):
        wire.submit(node, SYNC, 0)
    events = wire.advance(20 * MS)
    frames = delivered(events)
    assert len(frames) == 40
    assert states(events, node)[:2] == [NodeState.ERROR_WARNING, NodeState.ERROR_PASSIVE]
    gaps = [b.start_ns - a.end_ns for a, b in itertools.pairwise(frames)]
    # 20 failures are 160: passive until 33 frames have brought it to 127.
    assert gaps[:32] == [11 * US] * 32
    assert gaps[33:] == [3 * US] * 6


def test_only_the_frames_asked_for_are_corrupted() -> None:
    wire = Wire(1_000_000)
    a, b = wire.attach("a"), wire.attach("b")
    inject(wire, corrupt(2, can_id=0x101))
    for can_id in (0x100, 0x101, 0x102):
        wire.submit(a, Frame(can_id, b""), 0)
        wire.submit(b, Frame(can_id + 8, b""), 0)
    events = wire.advance(10 * MS)
    assert [event.frame.can_id for event in errors(events)] == [0x101, 0x101]
    assert len(delivered(events)) == 6


# --- 40: bus-off and recovery ---------------------------------------------------------------------


def test_32_failed_sends_in_a_row_take_a_node_off_and_drop_what_it_had() -> None:
    wire, node, other, _ = off_the_bus(None)
    assert node.counters.errors == 32
    assert (node.counters.sent, node.counters.dropped, len(node.queue.entries)) == (0, 1, 0)
    assert not wire.submit(node, SYNC, wire.now_ns)
    assert node.counters.refused == 1
    assert wire.submit(other, SYNC, wire.now_ns)
    assert wire.next_ns() != NEVER


def test_without_restart_a_node_stays_off() -> None:
    wire, node, _, _ = off_the_bus(None)
    assert wire.next_ns() == NEVER
    wire.advance(wire.now_ns + 10_000 * MS)
    assert node.state is NodeState.BUS_OFF


def test_on_an_idle_wire_a_restarted_node_is_back_after_1408_bits() -> None:
    wire, node, _, _ = off_the_bus(None)
    restart_ns = wire.now_ns + 5 * MS
    wire.advance(restart_ns)
    wire.restart(node)
    assert wire.next_ns() == restart_ns + 1408 * US
    events = wire.advance(restart_ns + 1408 * US)
    assert states(events, node) == [NodeState.ERROR_ACTIVE]
    assert (node.confinement.tec, node.confinement.rec) == (0, 0)
    assert wire.submit(node, SYNC, wire.now_ns)


def test_an_automatic_restart_counts_from_the_end_of_the_last_error_flag_or_its_delay() -> None:
    _, _, _, off_ns = off_the_bus(0)
    for restart_ns, back_ns in ((0, off_ns + 6 * US + 1408 * US), (MS, off_ns + MS + 1408 * US)):
        wire, node, _, _ = off_the_bus(restart_ns)
        assert wire.next_ns() == back_ns
        assert states(wire.advance(back_ns), node) == [NodeState.ERROR_ACTIVE]


def test_on_a_full_wire_recovery_takes_128_frames() -> None:
    wire, node, _, off_ns = off_the_bus(None)
    wire.attach("babbler", queue=Endless(BABBLE))
    wire.advance(off_ns + 10 * MS)
    wire.restart(node)
    after = wire.now_ns
    frames = 0
    while node.state is NodeState.BUS_OFF:
        due = wire.next_ns()
        assert due != NEVER
        frames += len(delivered(wire.advance(due)))
    # The frame on the wire at the restart counts by its end; the 128th end brings the node back.
    assert frames in (128, 129)
    assert wire.now_ns - after <= 129 * frame_bits(BABBLE) * US


# --- 41: open bus, no acknowledgement -------------------------------------------------------------


def test_a_lone_node_sends_for_ever_ends_passive_never_off_and_its_queue_fills() -> None:
    wire = Wire(1_000_000)
    host = wire.attach("host")
    taken = [wire.submit(host, Frame(0x00E, bytes(4)), k * MS) for k in range(100)]
    events = wire.advance(100 * MS)
    assert delivered(events) == []
    assert {event.kind for event in errors(events)} == {ErrorKind.ACK}
    assert host.state is NodeState.ERROR_PASSIVE
    assert host.confinement.tec == 128
    assert sum(taken) == 10
    assert wire.load > 0.9


def test_a_second_node_that_joins_gets_what_waited() -> None:
    wire = Wire(1_000_000)
    host = wire.attach("host")
    wire.submit(host, SYNC, 0)
    wire.advance(10 * MS)
    wire.attach("drive")
    assert len(delivered(wire.advance(11 * MS))) == 1
    assert host.state is NodeState.ERROR_WARNING


def test_an_open_line_cuts_a_node_off_and_a_closed_one_brings_its_queue_back() -> None:
    wire = Wire(1_000_000)
    host, right, left = (wire.attach(name) for name in ("host", "right", "left"))
    wire.submit(host, Frame(0x00E, b"\1"), 0)
    wire.advance(10 * US)
    wire.disconnect(host)
    wire.submit(right, Frame(0x009, b"\2"), 20 * US)
    for n in range(12):
        wire.submit(host, Frame(0x100 + n, b""), 30 * US)
    events = delivered(wire.advance(20 * MS))
    assert [(e.frame.data, e.heard_by) for e in events] == [
        (b"\1", (right, left)),
        (b"\2", (left,)),
    ]
    assert host.state is NodeState.ERROR_PASSIVE
    assert (len(host.queue.entries), host.counters.refused) == (9, 3)  # the first one took a place
    wire.reconnect(host)
    events = delivered(wire.advance(40 * MS))
    assert len(events) == 9
    assert host.counters.accepted == host.counters.sent
    assert wire.submit(left, SYNC, 40 * MS)
    assert delivered(wire.advance(41 * MS))[0].heard_by == (right, host)


def test_a_line_that_opens_and_closes_within_a_frame_changes_nothing() -> None:
    wire = Wire(1_000_000)
    host, drive = wire.attach("host"), wire.attach("drive")
    for _ in range(2):
        wire.submit(host, SYNC, 0)
    wire.advance(10 * US)
    wire.disconnect(host)
    wire.reconnect(host)
    assert len(delivered(wire.advance(MS))) == 2
    assert drive.confinement.rec == host.confinement.tec == 0


# --- 42: wrong bit rate ---------------------------------------------------------------------------


def test_a_listener_at_the_wrong_bit_rate_destroys_15_frames_then_is_passive_and_deaf() -> None:
    wire = Wire(1_000_000)
    host, drive = wire.attach("host", queue=Fifo(100)), wire.attach("drive")
    wrong = wire.attach("wrong", wrong_bit_rate=True)
    for _ in range(30):
        wire.submit(host, SYNC, 0)
    events = wire.advance(100 * MS)
    assert len(errors(events)) == 15
    assert {event.kind for event in errors(events)} == {ErrorKind.STUFF}
    assert wrong.state is NodeState.ERROR_PASSIVE
    frames = delivered(events)
    assert len(frames) == 30
    assert {event.heard_by for event in frames} == {(drive,)}
    assert states(events, host) == [NodeState.ERROR_WARNING, NodeState.ERROR_ACTIVE]


def test_a_sender_at_the_wrong_bit_rate_is_never_heard_and_ends_off_the_bus() -> None:
    wire = Wire(1_000_000)
    wire.attach("host")
    wire.attach("drive")
    wrong = wire.attach("wrong", wrong_bit_rate=True)
    wire.submit(wrong, SYNC, 0)
    events = wire.advance(100 * MS)
    assert delivered(events) == []
    assert len(errors(events)) == 32
    assert wrong.state is NodeState.BUS_OFF
