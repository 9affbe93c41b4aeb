"""Error flags on order: a node is told to destroy what is on the wire."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.frame import EFF, ERR, RTR, Frame
from bridge.wire.bits import frame_bits
from bridge.wire.confinement import NodeState
from bridge.wire.node import Delivered, ErrorFrame, ErrorKind, Event, Node
from bridge.wire.queues import Fifo
from bridge.wire.wire import Wire

US = 1000
MS = 1_000_000
DATA = Frame(0x123, b"12345678")
ERROR = Frame(ERR | EFF, b"")


def three() -> tuple[Wire, Node, Node, Node]:
    """A wire at 1 Mbit/s with a sender, a listener and who is told to destroy."""
    wire = Wire(1_000_000)
    names = ("sender", "listener", "injector")
    sender, listener, injector = (wire.attach(name, queue=Fifo(100)) for name in names)
    return wire, sender, listener, injector


def errors(events: list[Event]) -> list[ErrorFrame]:
    return [event for event in events if isinstance(event, ErrorFrame)]


def delivered(events: list[Event]) -> list[Delivered]:
    return [event for event in events if isinstance(event, Delivered)]


def test_the_frame_in_flight_is_destroyed_at_the_next_bit_counted_and_sent_again() -> None:
    wire, sender, listener, injector = three()
    wire.submit(sender, DATA, 0)
    assert wire.submit(injector, ERROR, 40_300)
    events = wire.advance(MS)
    (error,) = errors(events)
    # The flag begins with bit 41; flag, the others' flags, delimiter and intermission: 23 bits.
    assert (error.at_ns, error.free_ns, error.kind) == (41 * US, 64 * US, ErrorKind.STUFF)
    assert (error.senders, error.ordered_by, error.frame) == ((sender,), (injector,), DATA)
    (passed,) = delivered(events)
    assert (passed.start_ns, passed.frame) == (64 * US, DATA)
    assert (sender.confinement.tec, sender.confinement.rec) == (8 - 1, 0)
    assert (listener.confinement.tec, listener.confinement.rec) == (0, 1 - 1)
    assert (injector.confinement.tec, injector.confinement.rec) == (0, 0)
    assert injector.counters.sent == 1
    assert not injector.queue.entries


def test_on_an_idle_wire_all_others_see_six_dominant_bits() -> None:
    wire, sender, listener, injector = three()
    wire.advance(100 * US)
    wire.submit(injector, ERROR, 100 * US)
    (error,) = wire.advance(MS)
    assert isinstance(error, ErrorFrame)
    assert (error.start_ns, error.at_ns, error.free_ns) == (100 * US, 106 * US, 123 * US)
    assert (error.senders, error.frame) == ((), ERROR)
    assert [node.confinement.rec for node in (sender, listener, injector)] == [1, 1, 0]
    assert wire.busy_ns == 23 * US


@pytest.mark.parametrize(("can_id", "bit"), [(0x123, 4), (0x7FF, 2), (0x000, 6), (0x400, 2)])
def test_who_starts_with_the_flag_sees_it_at_its_first_recessive_bit(can_id: int, bit: int) -> None:
    wire, sender, _, injector = three()
    wire.submit(injector, ERROR, 10 * US)
    wire.submit(sender, Frame(can_id, b""), 10 * US)
    events = wire.advance(MS)
    (error,) = errors(events)
    assert (error.at_ns, error.free_ns) == ((10 + bit) * US, 33 * US)
    assert sender.confinement.tec == 8 - 1
    assert delivered(events)[0].start_ns == 33 * US


def test_in_the_intermission_it_waits_for_the_wire_to_be_free() -> None:
    wire, sender, _, injector = three()
    wire.submit(sender, DATA, 0)
    end_ns = (frame_bits(DATA) - 3) * US
    assert len(wire.advance(end_ns)) == 1
    wire.submit(injector, ERROR, end_ns)
    wire.submit(sender, DATA, end_ns)
    (error,) = errors(wire.advance(MS))
    assert error.start_ns == end_ns + 3 * US
    assert error.senders == (sender,)


def test_32_of_them_take_a_sender_off_the_bus_and_leave_the_injector_as_it_was() -> None:
    wire, sender, listener, injector = three()
    wire.submit(sender, DATA, 0)
    for n in range(1, 33):  # a flag, 23 bits, and the 8 that a passive sender pauses: then again
        wire.submit(injector, ERROR, 60 * n * US)
    assert len(errors(wire.advance(MS * 2))) == 32
    assert sender.state is NodeState.BUS_OFF
    assert listener.confinement.rec == 32
    assert injector.state is NodeState.ERROR_ACTIVE
    assert not injector.queue.entries


def test_it_waits_its_turn_behind_the_frames_of_its_own_node() -> None:
    wire, _, listener, injector = three()
    wire.submit(injector, DATA, 0)
    wire.submit(injector, ERROR, 0)
    wire.submit(injector, DATA, 0)
    events = wire.advance(MS)
    assert [type(event) for event in events] == [Delivered, ErrorFrame, Delivered]
    assert injector.confinement.tec == 0
    assert listener.confinement.rec == 0  # one seen destroyed, one received


def test_who_is_off_the_bus_and_who_has_no_room_cannot_order_one() -> None:
    wire, sender, _, injector = three()
    small = wire.attach("small", queue=Fifo(1))
    wire.submit(sender, DATA, 0)
    wire.advance(10 * US)
    assert wire.submit(small, DATA, 10 * US)
    assert not wire.submit(small, ERROR, 10 * US)
    injector.confinement.tec = 256
    injector.state = NodeState.BUS_OFF
    assert not wire.submit(injector, ERROR, 11 * US)


def test_who_leaves_with_its_flag_on_the_wire_leaves_the_flag_there() -> None:
    wire, sender, _, injector = three()
    wire.submit(sender, DATA, 0)
    wire.submit(injector, ERROR, 50 * US + 1)
    wire.advance(50 * US + 2)
    wire.detach(injector)
    events = wire.advance(MS)
    assert len(errors(events)) == len(delivered(events)) == 1
    assert injector.counters.dropped == 0


@given(
    st.lists(
        st.tuples(
            st.integers(0, 300_000),
            st.integers(0, 3),
            st.sampled_from(
                [DATA, ERROR, Frame(0, b""), Frame(EFF | RTR | 5, bytes(3)), Frame(0x80, b"")]
            ),
        ),
        max_size=40,
    ),
    st.integers(1, 7),
)
def test_whatever_is_sent_is_accounted_for_and_nothing_depends_on_how_time_is_cut(
    orders: list[tuple[int, int, Frame]], cuts: int
) -> None:
    def run(step_ns: int) -> tuple[list[str], list[tuple[int, int, int]]]:
        wire = Wire(500_000)
        nodes = [wire.attach(str(n), queue=Fifo(8), restart_ns=MS) for n in range(4)]
        events: list[Event] = []
        for at_ns, who, frame in sorted(orders, key=lambda order: order[0]):
            while wire.now_ns + step_ns < at_ns:
                wire.next_ns()
                events += wire.advance(wire.now_ns + step_ns)
            wire.submit(nodes[who], frame, at_ns)
        events += wire.advance(20 * MS)
        for node in nodes:
            counted = node.counters
            assert counted.accepted == counted.sent + counted.dropped + len(node.queue.entries)
        return [repr(event) for event in events], [
            (node.confinement.tec, node.confinement.rec, node.counters.sent) for node in nodes
        ]

    assert run(MS) == run(cuts * 7_001)
