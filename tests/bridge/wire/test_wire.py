"""One wire without faults: who sends when, what arrives when, what it costs, what is kept."""

import itertools
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.frame import EFF, RTR, Frame
from bridge.wire.bits import arbitration_key, frame_bits, most_bits
from bridge.wire.node import NEVER, Delivered, Event, Node
from bridge.wire.queues import Fifo, Mailboxes
from bridge.wire.response_time import Message, analyse
from bridge.wire.wire import Wire

US = 1000
MS = 1_000_000
RIGHT_HEARTBEAT, RIGHT_ENCODER, RIGHT_TORQUE = 0x001, 0x009, 0x00E
LEFT_HEARTBEAT, LEFT_ENCODER, LEFT_TORQUE = 0x021, 0x029, 0x02E


def delivered(events: list[Event]) -> list[Delivered]:
    return [event for event in events if isinstance(event, Delivered)]


def robot(wire: Wire) -> tuple[Node, Node, Node]:
    right = wire.attach("right", queue=Mailboxes())
    left = wire.attach("left", queue=Mailboxes())
    return right, left, wire.attach("host")


def moving(k: int, sign: float = 1.0) -> bytes:
    """An encoder frame's data of a wheel at about 2.4 rev/s, 1 kHz."""
    return struct.pack("<ff", sign * 0.0024 * k, sign * (2.4 + 0.01 * (k % 7)))


def test_an_idle_wire_takes_a_frame_at_once_and_delivers_it_three_bits_before_it_is_free() -> None:
    wire = Wire(1_000_000)
    sender, other = wire.attach("a"), wire.attach("b")
    frame = Frame(0x080, b"")  # 51 bits
    assert wire.submit(sender, frame, 100 * US)
    assert wire.submit(sender, frame, 100 * US)
    assert wire.next_ns() == 148 * US
    first, second = delivered(wire.advance(MS))
    assert (first.start_ns, first.end_ns) == (100 * US, 148 * US)
    assert (second.start_ns, second.end_ns) == (151 * US, 199 * US)
    assert first.sender is sender
    assert first.heard_by == (other,)


def test_at_half_the_bit_rate_a_frame_takes_twice_as_long() -> None:
    wire = Wire(500_000)
    sender, _ = wire.attach("a"), wire.attach("b")
    wire.submit(sender, Frame(0x080, b""), 0)
    (event,) = delivered(wire.advance(MS))
    assert event.end_ns == 96 * US


def test_a_rate_whose_bit_is_no_whole_nanosecond_keeps_time_to_the_nanosecond() -> None:
    wire = Wire(300_000)
    sender, _ = wire.attach("a", queue=Fifo(100)), wire.attach("b")
    for _ in range(100):
        wire.submit(sender, Frame(0x080, b""), 0)
    last = delivered(wire.advance(20 * MS))[-1]
    assert abs(last.end_ns - (100 * 51 - 3) * 1e9 / 300_000) < 100


def test_the_lowest_identifier_of_all_that_wait_goes_first() -> None:
    wire = Wire(1_000_000)
    nodes = [wire.attach(f"n{k}") for k in range(4)]
    can_ids = [0x300, 0x100 | RTR, 0x100 << 18 | EFF, 0x100]
    for node, can_id in zip(nodes, can_ids, strict=True):
        wire.submit(node, Frame(can_id, b""), 0)
    order = [event.frame.can_id for event in delivered(wire.advance(MS))]
    assert order == [0x100, 0x100 | RTR, 0x100 << 18 | EFF, 0x300]


def test_a_frame_on_the_wire_is_never_interrupted_so_an_urgent_one_waits_for_one_frame() -> None:
    wire = Wire(1_000_000)
    low, high, also = (wire.attach(name) for name in ("low", "high", "also"))
    wire.submit(low, Frame(0x700, bytes(8)), 0)
    wire.submit(also, Frame(0x600, bytes(8)), 1)
    wire.submit(high, Frame(0x001, b""), 1)
    first, second, third = delivered(wire.advance(MS))
    assert [event.frame.can_id for event in (first, second, third)] == [0x700, 0x001, 0x600]
    assert second.start_ns == frame_bits(first.frame) * US


def test_who_submits_at_the_start_of_a_frame_takes_part_and_a_nanosecond_later_waits() -> None:
    for late_ns, order in ((0, [0x001, 0x700]), (1, [0x700, 0x001])):
        wire = Wire(1_000_000)
        low, high = wire.attach("low"), wire.attach("high")
        wire.submit(low, Frame(0x700, b""), 5 * US)
        assert wire.next_ns() != NEVER
        wire.submit(high, Frame(0x001, b""), 5 * US + late_ns)
        assert [event.frame.can_id for event in delivered(wire.advance(MS))] == order


def test_a_full_queue_refuses_and_keeps_what_it_has() -> None:
    wire = Wire(1_000_000)
    host, _ = wire.attach("host"), wire.attach("drive")
    taken = [wire.submit(host, Frame(0x100 + n, b""), 0) for n in range(12)]
    assert taken == [True] * 10 + [False] * 2
    assert (len(host.queue.entries), host.counters.refused) == (10, 2)
    assert len(delivered(wire.advance(MS))) == 10


def test_a_frame_keeps_its_mailbox_until_it_was_sent() -> None:
    wire = Wire(1_000_000)
    drive, _ = wire.attach("drive", queue=Mailboxes(3)), wire.attach("host")
    taken = [wire.submit(drive, Frame(0x100 + n, b""), n) for n in range(4)]
    assert taken == [True, True, True, False]
    wire.advance(51 * US)
    assert wire.submit(drive, Frame(0x001, b""), 51 * US)


def test_a_node_that_leaves_takes_its_queue_along_but_not_the_frame_on_the_wire() -> None:
    wire = Wire(1_000_000)
    client, other = wire.attach("client"), wire.attach("other")
    for n in range(5):
        wire.submit(client, Frame(0x100 + n, b""), 0)
    wire.advance(10 * US)
    wire.detach(client)
    assert [event.frame.can_id for event in delivered(wire.advance(MS))] == [0x100]
    assert (client.counters.sent, client.counters.dropped) == (1, 4)
    with pytest.raises(ValueError, match="client has left"):
        wire.submit(client, Frame(0x100, b""), MS)
    assert wire.next_ns() == NEVER
    assert len(other.queue.entries) == 0


def test_who_joins_during_a_frame_does_not_hear_it() -> None:
    wire = Wire(1_000_000)
    sender, other = wire.attach("a"), wire.attach("b")
    wire.submit(sender, Frame(0x100, b""), 0)
    wire.advance(10 * US)
    late = wire.attach("late")
    wire.submit(sender, Frame(0x101, b""), 20 * US)
    first, second = delivered(wire.advance(MS))
    assert first.heard_by == (other,)
    assert second.heard_by == (other, late)


def test_time_does_not_go_back() -> None:
    wire = Wire(1_000_000)
    node = wire.attach("a")
    wire.advance(5)
    with pytest.raises(ValueError, match="4 ns is in the past; it is 5 ns"):
        wire.advance(4)
    with pytest.raises(ValueError, match="in the past"):
        wire.submit(node, Frame(1, b""), 4)


def test_a_bit_rate_beyond_classic_can_is_refused() -> None:
    with pytest.raises(ValueError, match="bit rate 5000000"):
        Wire(5_000_000)


def test_a_robot_at_1_khz_and_1_mbit_loads_its_bus_by_40_percent() -> None:
    wire = Wire(1_000_000)
    right, left, host = robot(wire)
    for k in range(1000):
        at = k * MS
        if k % 100 == 0:
            heartbeat = bytes.fromhex("0000000008000000")
            assert wire.submit(right, Frame(RIGHT_HEARTBEAT, heartbeat), at)
            assert wire.submit(left, Frame(LEFT_HEARTBEAT, heartbeat), at)
        assert wire.submit(right, Frame(RIGHT_ENCODER, moving(k)), at)
        assert wire.submit(left, Frame(LEFT_ENCODER, moving(k, -1.0)), at)
        torque = struct.pack("<f", 0.05 + 1e-4 * (k % 97))
        assert wire.submit(host, Frame(RIGHT_TORQUE, torque), at + 300 * US)
        assert wire.submit(host, Frame(LEFT_TORQUE, torque), at + 300 * US)
    events = delivered(wire.advance(1000 * MS))
    assert len(events) == 4020
    assert wire.load == pytest.approx(0.40, abs=0.02)


def longest(can_id: int, length: int) -> Frame:
    """The data of this length that need the most stuff bits, out of all runs of four and five."""
    patterns = [0x78787878787878, 0x3C3C3C3C3C3C3C, 0x1E1E1E1E1E1E1E, 0x0F0F0F0F0F0F0F, 0, -1]
    candidates = [
        ((pattern << 8 | low) & (1 << 8 * length) - 1).to_bytes(length, "big")
        for pattern in patterns
        for low in range(256)
    ]
    return max((Frame(can_id, data) for data in candidates), key=frame_bits)


@pytest.mark.parametrize("content", ["longest", "moving"])
def test_response_times_at_the_critical_instant_are_those_of_the_analysis(content: str) -> None:
    # Everything is due at once; worst for the right drive just after a frame of the left one began.
    bounds = {message.can_id: message.response_ns for message in analyse(ROBOT, 1_000_000).messages}
    assert bounds[RIGHT_TORQUE] == 500 * US
    assert bounds[LEFT_TORQUE] == 730 * US
    wire = Wire(1_000_000)
    right, left, host = robot(wire)
    lengths = {message.can_id: message.length for message in ROBOT}
    frames = {
        can_id: longest(can_id, length)
        if content == "longest"
        else Frame(can_id, (moving(41) if length == 8 else struct.pack("<f", 0.123)))
        for can_id, length in lengths.items()
    }
    spent: dict[int, int] = {}
    for blocking in (LEFT_HEARTBEAT, None):
        start = wire.now_ns + MS
        if blocking is not None:
            wire.submit(left, frames[blocking], start - 1)
        for can_id, frame in frames.items():
            if can_id != blocking:
                drive = right if can_id < LEFT_HEARTBEAT else left
                node = host if can_id in (RIGHT_TORQUE, LEFT_TORQUE) else drive
                assert wire.submit(node, frame, start)
        for event in delivered(wire.advance(start + 2 * MS)):
            latest = event.end_ns - start
            spent[event.frame.can_id] = max(spent.get(event.frame.can_id, 0), latest)
    for can_id, bound in bounds.items():
        assert spent[can_id] <= bound
    if content == "longest":
        assert spent[RIGHT_TORQUE] == pytest.approx(500 * US, rel=0.1)
        assert spent[LEFT_TORQUE] == pytest.approx(730 * US, rel=0.1)


ROBOT = [
    Message(can_id, length, period_ns)
    for can_id, length, period_ns in (
        (RIGHT_HEARTBEAT, 8, 100 * MS),
        (RIGHT_ENCODER, 8, MS),
        (RIGHT_TORQUE, 4, MS),
        (LEFT_HEARTBEAT, 8, 100 * MS),
        (LEFT_ENCODER, 8, MS),
        (LEFT_TORQUE, 4, MS),
    )
]

schedules = st.lists(
    st.tuples(
        st.integers(0, 3),  # node
        st.integers(0, 7),  # identifier, one set per node
        st.binary(max_size=8),
        st.integers(0, 300 * US),  # later than the one before
    ),
    max_size=60,
)


def played(
    schedule: list[tuple[int, int, bytes, int]], *, ask: bool
) -> tuple[list[Delivered], list[tuple[int, int, Frame]], Wire, list[Node]]:
    """Submit a schedule; `ask`: look and advance as often as one can in between."""
    wire = Wire(500_000)
    kinds = (Fifo(5), Mailboxes(3), Fifo(10), Mailboxes(3))
    nodes = [wire.attach(f"n{n}", queue=queue) for n, queue in enumerate(kinds)]
    events: list[Event] = []
    accepted = []
    now = 0
    for number, (n, low, data, later) in enumerate(schedule):
        now += later
        if ask:
            while (due := wire.next_ns()) <= now:
                events += wire.advance(due)
            wire.advance(wire.now_ns)
        frame = Frame(low * 4 + n, data[:7] + bytes([number]))
        if wire.submit(nodes[n], frame, now):
            accepted.append((now, n, frame))
    events += wire.advance(now + 50 * MS)
    return delivered(events), accepted, wire, nodes


@given(schedules)
def test_every_accepted_frame_is_delivered_once_in_order_and_none_overlap(
    schedule: list[tuple[int, int, bytes, int]],
) -> None:
    events, accepted, wire, nodes = played(schedule, ask=False)
    assert sorted(frame for _, _, frame in accepted) == sorted(event.frame for event in events)
    for node in nodes:
        counters = node.counters
        assert counters.accepted == counters.sent
        assert counters.dropped == len(node.queue.entries) == 0
    for before, after in itertools.pairwise(events):
        assert after.start_ns >= before.end_ns + 3 * 2000
    sent_ns = {frame: at for at, _, frame in accepted}
    for event in events:
        assert event.start_ns >= sent_ns[event.frame]
        assert event.end_ns - event.start_ns == (frame_bits(event.frame) - 3) * 2000
    for can_id in {event.frame.can_id for event in events}:
        went_in = [frame for _, _, frame in accepted if frame.can_id == can_id]
        assert went_in == [event.frame for event in events if event.frame.can_id == can_id]
    assert wire.busy_ns == sum(frame_bits(event.frame) for event in events) * 2000


@given(schedules)
def test_a_lower_identifier_never_waits_for_a_higher_one_that_started_after_it_was_ready(
    schedule: list[tuple[int, int, bytes, int]],
) -> None:
    # Only of the mailboxes: in a FIFO a frame waits behind the others of its node by intention.
    events, accepted, _, _ = played(schedule, ask=False)
    ready = {frame: at for at, n, frame in accepted if n in (1, 3)}
    for event in events:
        at = ready.get(event.frame)
        if at is None:
            continue
        overtaking = [
            other
            for other in events
            if at <= other.start_ns < event.start_ns
            and arbitration_key(other.frame.can_id) > arbitration_key(event.frame.can_id)
        ]
        assert overtaking == []


@given(schedules)
def test_the_same_calls_give_the_same_events_however_often_one_looks(
    schedule: list[tuple[int, int, bytes, int]],
) -> None:
    runs = [played(schedule, ask=ask)[0] for ask in (False, False, True)]
    told = [[(e.end_ns, e.start_ns, e.sender.name, e.frame) for e in events] for events in runs]
    assert told[0] == told[1] == told[2]


@given(schedules)
def test_of_frames_that_are_due_at_once_none_waits_for_more_than_those_before_it(
    schedule: list[tuple[int, int, bytes, int]],
) -> None:
    # Each frame at once on an idle wire.
    wire = Wire(1_000_000)
    nodes = [wire.attach(f"n{n}", queue=Fifo(100)) for n in range(4)]
    frames = sorted({low * 4 + n: (n, data) for n, low, data, _ in schedule}.items())
    for can_id, (n, data) in frames:
        wire.submit(nodes[n], Frame(can_id, data), 0)
    longest_bits = most_bits(8)
    for rank, event in enumerate(delivered(wire.advance(100 * MS))):
        assert event.end_ns <= (rank + 1) * longest_bits * US
