"""One emulated edge: when messages arrive, in which order, and what becomes of the others."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.netem.channel import Channel
from configs.netem import (
    BernoulliLoss,
    ConstantDelay,
    Effects,
    Partition,
    TraceDelay,
    UniformDelay,
)

MS = 1_000_000


def channel(age_limit_ms: int = 1000, **effects: object) -> Channel[int]:
    return Channel(Effects(**effects), "1 r1 -> r2", age_limit_ms * MS)  # type: ignore[arg-type]


def trace(*delays_ms: float) -> TraceDelay:
    return TraceDelay(kind="trace", delays_s=tuple(ms * 1e-3 for ms in delays_ms))


def arrivals(edge: Channel[int], sends_ms: list[int], until_ms: int) -> list[tuple[int, int]]:
    """(arrival [ms], message) of messages numbered in the order of sending, looked at every ms."""
    found = []
    for now in range(until_ms + 1):
        for number, at in enumerate(sends_ms):
            if at == now:
                edge.send(now * MS, number)
        found += [(now, message) for _, message in edge.receive(now * MS)]
    return found


def test_without_effects_a_message_arrives_as_it_is_sent() -> None:
    assert arrivals(channel(), [0, 7], 10) == [(0, 0), (7, 1)]


def test_a_constant_delay_keeps_the_order() -> None:
    delay = ConstantDelay(kind="constant", delay_s=0.005)
    assert arrivals(channel(delay=delay), [0, 1, 2], 10) == [(5, 0), (6, 1), (7, 2)]


def test_a_quick_message_overtakes_a_slow_one() -> None:
    edge = channel(delay=trace(8, 1))
    assert arrivals(edge, [0, 1], 10) == [(2, 1), (8, 0)]
    assert edge.counts.reordered == 1


def test_without_reordering_it_waits_for_the_slow_one() -> None:
    edge = channel(delay=trace(8, 1, 1), reordering=False)
    assert arrivals(edge, [0, 1, 9], 12) == [(8, 0), (8, 1), (10, 2)]
    assert edge.counts.reordered == 0


def test_a_second_copy_has_a_delay_of_its_own() -> None:
    edge = channel(delay=trace(3, 5), duplication=1.0)
    assert arrivals(edge, [0], 10) == [(3, 0), (5, 0)]
    assert (edge.counts.sent, edge.counts.duplicated, edge.counts.delivered) == (1, 1, 2)


def test_messages_leave_through_the_bandwidth_one_after_the_other() -> None:
    edge = channel(bandwidth_bit_s=8e3, message_bytes=2)  # 2 ms each
    assert arrivals(edge, [0, 0, 0, 9], 12) == [(2, 0), (4, 1), (6, 2), (11, 3)]


def test_what_finds_the_queue_full_is_lost() -> None:
    edge = channel(bandwidth_bit_s=8e3, message_bytes=2, queue_messages=1)
    assert arrivals(edge, [0, 0, 0, 0], 20) == [(2, 0), (4, 1)]  # one leaves, one waits
    assert edge.counts.lost == 2


def test_what_is_sent_or_due_while_the_edge_is_cut_is_lost() -> None:
    cut = Partition(from_s=0.010, to_s=0.020)
    edge = channel(delay=trace(4), partitions=(cut,))
    assert arrivals(edge, [5, 6, 15, 19, 20], 30) == [(9, 0), (24, 4)]
    assert edge.counts.lost == 3


def test_a_message_older_than_the_limit_at_its_arrival_is_late() -> None:
    edge = channel(age_limit_ms=5, delay=trace(5, 6))
    arrivals(edge, [0, 10], 20)
    assert edge.counts.late == 1


def test_one_effect_more_changes_no_draw_of_another() -> None:
    delay = UniformDelay(kind="uniform", max_s=0.02)
    loss = BernoulliLoss(kind="bernoulli", probability=0.3)
    sends = list(range(0, 400, 4))
    with_loss = arrivals(channel(delay=delay, loss=loss), sends, 500)
    without = arrivals(channel(delay=delay), sends, 500)
    assert set(with_loss) < set(without)
    assert 0.5 < len(with_loss) / len(without) < 0.9


@given(
    sends=st.lists(st.integers(0, 60), max_size=40).map(sorted),
    delays=st.lists(st.integers(-1, 30), min_size=1, max_size=9),
    duplication=st.sampled_from([0.0, 0.4]),
    ordered=st.booleans(),
    rate=st.sampled_from([None, 4e3]),
    cut_ms=st.integers(1, 90),
)
def test_every_message_is_delivered_or_lost_and_none_before_it_is_sent(
    sends: list[int],
    delays: list[int],
    duplication: float,
    ordered: bool,
    rate: float | None,
    cut_ms: int,
) -> None:
    edge = channel(
        delay=TraceDelay(kind="trace", delays_s=tuple(ms * 1e-3 for ms in delays)),
        duplication=duplication,
        reordering=not ordered,
        bandwidth_bit_s=rate,
        message_bytes=1,
        queue_messages=3,
        partitions=(Partition(from_s=cut_ms * 1e-3, to_s=cut_ms * 1e-3 + 0.01),),
    )
    found = arrivals(edge, sends, 300)
    counts = edge.counts
    assert counts.sent == len(sends)
    assert counts.sent + counts.duplicated == counts.delivered + counts.lost
    assert counts.delivered == len(found)
    assert all(at >= sends[number] for at, number in found)
    if ordered:
        assert counts.reordered == 0


@pytest.mark.parametrize("seed", ["1 r1 -> r2", "2 r1 -> r2"])
def test_equal_seeds_give_equal_arrivals(seed: str) -> None:
    effects = Effects(delay=UniformDelay(kind="uniform", max_s=0.01))
    one, other = (Channel[int](effects, seed, MS) for _ in range(2))
    assert arrivals(one, [0, 3, 5], 20) == arrivals(other, [0, 3, 5], 20)
