"""Orders of pace and leader: what is encoded comes back, and nothing else is one."""

from collections import deque
from types import SimpleNamespace

import msgpack
from hypothesis import given
from hypothesis import strategies as st

from bridge.network.fault_orders import FaultAnswer, FaultOrder
from bridge.network.orders import OrderInbox, order_of
from bridge.network.refused_messages import Refusals
from bridge.network.run_orders import LeaderOrder, Pace, PaceOrder, Standstill, order_tick
from configs.faults.bodies import Push
from configs.leader_speed import SpeedChange
from configs.reach import Reach

FINITE = st.floats(allow_nan=False, allow_infinity=False)
TICKS = st.integers(-(1 << 40), 1 << 40)
REACHES = st.builds(Reach, FINITE, FINITE, FINITE, FINITE, FINITE)
ORDERS = st.one_of(
    st.builds(PaceOrder, TICKS, st.sampled_from(Pace), st.floats(0.0, 1e9)),
    st.builds(LeaderOrder, TICKS, TICKS, st.booleans(), FINITE, st.integers(0, 1 << 50), REACHES),
    st.builds(Standstill, TICKS),
)


@given(ORDERS)
def test_an_order_is_decoded_as_it_was_encoded_and_as_no_other(order) -> None:
    assert order_of(order.encode()) == order
    kinds = (PaceOrder, LeaderOrder, Standstill, FaultOrder)
    assert [kind for kind in kinds if kind.decode(order.encode())] == [type(order)]


@given(st.one_of(st.binary(max_size=64), st.lists(st.integers() | FINITE | st.text()).map(repr)))
def test_bytes_that_are_no_order_are_none(payload) -> None:
    made = payload if isinstance(payload, bytes) else payload.encode()
    order = order_of(made)
    assert order is None or isinstance(order, Standstill)


def test_what_is_no_pace_and_no_speed_is_refused() -> None:
    for fields in (
        (1, "faster", 1.0),
        (1, "speed", -1.0),
        (1, "speed", float("nan")),
        (1, "speed", 1),
        (True, "speed", 1.0),
        (1, 5, True, 0.5, -1, [0.0] * 5),
        (1, 5, True, float("inf"), 0, [0.0] * 5),
        (1, 5, True, 0.5, 0, [0.0] * 4),
        (1, 5, 1, 0.5, 0, [0.0] * 5),
    ):
        assert order_of(msgpack.packb((1, *fields))) is None, fields


def test_an_order_acts_at_its_tick_or_says_why_not() -> None:
    assert order_tick(0, 7, 100, exact=False) == 7
    assert order_tick(9, 7, 100, exact=True) == 9
    assert order_tick(5, 7, 100, exact=True) == (
        "tick 5 has gone: tick 7 is the next that it can act at"
    )
    assert order_tick(100, 7, 100, exact=False) == "the run ends before: it has 100 ticks"
    change = LeaderOrder(1, 0, False, 0.3, 5, Reach(*[0.0] * 5)).change(7, 1000)
    assert change == SpeedChange(7000, 0.3, 5)


def test_an_inbox_takes_orders_counts_others_and_notes_that_time_stands_still() -> None:
    said: list[bytes] = []
    heard: list = []
    link = SimpleNamespace(
        publisher=lambda _: SimpleNamespace(put=said.append),
        each=lambda _, act: heard.append(act),
    )
    refusals = Refusals()
    inbox = OrderInbox(link, "run", "agent/r1", refusals)
    fault = FaultOrder(3, False, "push", ("r1",), Push(kind="push", at_s=0.0), 0, None, False)
    pause = PaceOrder(4, Pace.PAUSE)
    for payload in (fault.encode(), b"?", Standstill(8).encode(), pause.encode()):
        heard[0](payload)
    assert isinstance(inbox.waiting, deque)
    assert inbox.take() == [fault, pause]
    assert inbox.stands
    assert len(refusals.lines()) == 1
    inbox.answer(pause, 7)
    inbox.answer(fault, "why not")
    assert [FaultAnswer.decode(one) for one in said] == [
        FaultAnswer(4, 7),
        FaultAnswer(3, 0, "why not"),
    ]
