"""Orders of pace and leader: what is encoded comes back, and nothing else is one."""

import msgpack
from hypothesis import given
from hypothesis import strategies as st

from bridge.network.fault_orders import FaultOrder
from bridge.network.orders import order_of
from bridge.network.run_orders import LeaderOrder, Pace, PaceOrder, Standstill, order_tick
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
