"""Injected faults of a wire: frames dropped, duplicated, delayed or corrupted."""

import itertools
import random

import pytest
from support.frame_faults import frame_fault, inject

from bridge.frame import Frame
from bridge.wire.bits import least_bits
from bridge.wire.node import NEVER, Delivered, Event, time_of
from bridge.wire.wire import Wire

US = 1000
MS = 1_000_000
SYNC = Frame(0x080, b"")  # 51 bits


def delivered(events: list[Event]) -> list[Delivered]:
    return [event for event in events if isinstance(event, Delivered)]


# --- 43: CAN FD -----------------------------------------------------------------------------------


def test_a_frame_that_only_can_fd_could_carry_is_refused_and_leaves_no_trace() -> None:
    wire = Wire(1_000_000)
    node, _ = wire.attach("node"), wire.attach("other")
    with pytest.raises(ValueError, match="12 bytes of data"):
        wire.submit(node, Frame(0x00E, bytes(12)), 0)
    assert (wire.next_ns(), len(node.queue.entries), node.counters.accepted) == (NEVER, 0, 0)


# --- drop, duplicate, delay -----------------------------------------------------------------------


def test_a_dropped_frame_is_accepted_and_never_sent() -> None:
    wire = Wire(1_000_000)
    node, _ = wire.attach("node"), wire.attach("other")
    inject(wire, frame_fault("can_drop", can_id=0x80, count=1))
    taken = [wire.submit(node, SYNC, 0) for _ in range(3)]
    assert taken == [True] * 3
    assert len(delivered(wire.advance(MS))) == 2
    counters = node.counters
    assert (counters.accepted, counters.sent, counters.dropped) == (3, 2, 1)


def test_a_duplicated_frame_comes_twice() -> None:
    wire = Wire(1_000_000)
    node, _ = wire.attach("node"), wire.attach("other")
    inject(wire, frame_fault("can_duplicate", count=1))
    for _ in range(2):
        wire.submit(node, SYNC, 0)
    assert len(delivered(wire.advance(MS))) == 3
    assert node.counters.accepted == node.counters.sent == 3


def test_a_delayed_frame_goes_to_arbitration_later_by_exactly_that() -> None:
    wire = Wire(1_000_000)
    node, _ = wire.attach("node"), wire.attach("other")
    inject(wire, frame_fault("can_delay", count=1, delay_s=0.005))
    wire.submit(node, Frame(0x100, b""), 0)
    wire.submit(node, Frame(0x101, b""), 0)
    assert len(node.queue.entries) == 1  # the other one is withheld
    first, second = delivered(wire.advance(10 * MS))
    assert (first.frame.can_id, second.frame.can_id) == (0x101, 0x100)
    assert second.start_ns == 5 * MS
    assert node.counters.accepted == node.counters.sent == 2


# --- everything at once ---------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(20))
def test_whatever_goes_wrong_every_frame_is_accounted_for_and_none_overlap(seed: int) -> None:
    rng = random.Random(seed)
    wire = Wire(500_000)
    nodes = [wire.attach(f"n{n}", restart_ns=rng.choice([None, 0, MS])) for n in range(4)]
    events: list[Event] = []
    kinds = ("can_drop", "can_duplicate", "can_delay", "can_corrupt", "can_corrupt")
    for _ in range(400):
        now = wire.now_ns + rng.randrange(400 * US)
        node = rng.choice(nodes)
        events += wire.advance(now)
        match rng.randrange(20):
            case 0:
                inject(wire, frame_fault(rng.choice(kinds), count=rng.randrange(1, 40)))
            case 1:
                wire.disconnect(node)
            case 2 | 3:
                wire.reconnect(node)
            case 4:
                wire.restart(node)
            case 5 if len(nodes) > 3:
                wire.detach(node)
                nodes = [wire.attach("new", wrong_bit_rate=rng.random() < 0.3), *nodes]
            case _ if node.attached:
                wire.submit(node, Frame(rng.randrange(8), rng.randbytes(rng.randrange(9))), now)
            case _:
                pass
    events += wire.advance(wire.now_ns + 50 * MS)
    for node in nodes:
        c = node.counters
        assert c.accepted == c.sent + c.dropped + len(node.queue.entries)
    frames = delivered(events)
    assert sum(1 + len(event.merged) for event in frames) == sum(n.counters.sent for n in nodes)
    times = [time_of(event) for event in events]
    assert times == sorted(times)
    for before, after in itertools.pairwise(frames):
        assert after.start_ns >= before.end_ns + 3 * 2000 - 1
    shortest_ns = least_bits(0) * 2000
    assert wire.busy_ns >= len(frames) * shortest_ns - shortest_ns
    assert wire.busy_ns <= wire.now_ns


@pytest.mark.parametrize("seed", range(20))
def test_groups_apart_babblers_and_nodes_that_fail_leave_every_frame_accounted_for(
    seed: int,
) -> None:
    rng = random.Random(seed)
    wire = Wire(500_000)
    nodes = [wire.attach(f"n{n}", restart_ns=rng.choice([None, 0, MS])) for n in range(5)]
    events: list[Event] = []
    for _ in range(400):
        now = wire.now_ns + rng.randrange(400 * US)
        node = rng.choice(nodes)
        events += wire.advance(now)
        frame = Frame(rng.randrange(8), rng.randbytes(rng.randrange(9)))
        disturb = [
            lambda node: wire.disconnect(node, rng.choice(nodes)),
            wire.reconnect,
            wire.reconnect,
            wire.restart,
            wire.discard,
            wire.fail,
            wire.quieten,
            wire.quieten,
            lambda node, frame=frame: wire.babble(node, frame, rng.randrange(50, 900) * US),
            lambda _: inject(wire, frame_fault("can_corrupt", count=rng.randrange(1, 9))),
        ]
        if rng.random() < 0.3:
            rng.choice(disturb)(node)
        else:
            wire.submit(node, frame, now)
    events += wire.advance(wire.now_ns + 5 * MS)
    for node in nodes:
        c = node.counters
        assert c.accepted == c.sent + c.dropped + len(node.queue.entries)
        assert node.state is node.confinement.state
    times = [time_of(event) for event in events]
    assert times == sorted(times)
    sent = sum(1 + len(event.merged) for event in delivered(events))
    assert sent == sum(node.counters.sent for node in nodes)
