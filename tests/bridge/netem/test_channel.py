"""One emulated edge: when messages arrive, in which order, and what becomes of the others."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.netem.channel import Channel
from configs.netem import (
    LEAST_BANDWIDTH_BIT_S,
    LEAST_MEAN_S,
    LOST_S,
    BernoulliLoss,
    ConstantDelay,
    DistanceLoss,
    Effects,
    LognormalDelay,
    NormalDelay,
    Partition,
    TraceDelay,
    UniformDelay,
)

MS = 1_000_000


def channel(age_limit_ms: int = 1000, **effects: object) -> Channel[int]:
    return Channel(Effects(**effects), "1 r1 -> r2", age_limit_ms * MS)


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


@pytest.mark.parametrize(
    "less",
    [
        {"loss": BernoulliLoss(kind="bernoulli", probability=0.3)},
        {"partitions": (Partition(from_s=0.1, to_s=0.2),)},
        {"bandwidth_bit_s": 1e6, "message_bytes": 1, "queue_messages": 1},
    ],
    ids=lambda value: next(iter(value)),
)
def test_a_lost_message_changes_no_draw_of_others_and_of_their_copies(
    less: dict[str, object],
) -> None:
    usual = {"delay": UniformDelay(kind="uniform", max_s=0.02), "duplication": 0.5}
    sends = [at for at in range(0, 400, 4) for _ in range(3)]
    found = arrivals(channel(**usual | less), sends, 500)
    known = arrivals(channel(**usual), sends, 500)
    assert len(found) < len(known)
    if "bandwidth_bit_s" not in less:  # 8 µs each
        assert set(found) <= set(known)
    else:
        times = {number: sorted(at for at, n in known if n == number) for _, number in known}
        here = {number: sorted(at for at, n in found if n == number) for _, number in found}
        assert all(
            len(here[n]) == len(times[n])
            and all(0 <= a - b <= 1 for a, b in zip(here[n], times[n], strict=True))
            for n in here
        )


def test_copies_change_no_delay_of_the_messages_themselves() -> None:
    delay = UniformDelay(kind="uniform", max_s=0.02)
    sends = list(range(0, 400, 4))
    without = set(arrivals(channel(delay=delay), sends, 500))
    assert without < set(arrivals(channel(delay=delay, duplication=0.5), sends, 500))


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
        delay=TraceDelay(
            kind="trace", delays_s=tuple(ms * 1e-3 if ms >= 0 else LOST_S for ms in delays)
        ),
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


@pytest.mark.parametrize(
    "effects",
    [
        {"bandwidth_bit_s": LEAST_BANDWIDTH_BIT_S, "message_bytes": 65536},
        {"bandwidth_bit_s": 1e12, "message_bytes": 1},
        {"delay": LognormalDelay(kind="lognormal", mean_s=LEAST_MEAN_S, std_s=60.0)},
        {"delay": LognormalDelay(kind="lognormal", mean_s=60.0, std_s=60.0)},
        {"delay": NormalDelay(kind="normal", mean_s=60.0, std_s=60.0)},
        {"partitions": (Partition(from_s=0.0, to_s=1e9),)},
        {"distance": DistanceLoss(range_m=5e-324, exponent=100.0)},
        {"distance": DistanceLoss(range_m=1e12, exponent=5e-324)},
    ],
    ids=str,
)
def test_effects_at_their_bounds_carry_messages(effects: dict[str, object]) -> None:
    edge = channel(duplication=1.0, **effects)
    for n in range(100):
        edge.send(n * MS, n, distance_m=float(n))
    edge.receive(60_100 * MS)
    counts = edge.counts
    assert counts.sent == 100
    assert counts.delivered + counts.lost <= counts.sent + counts.duplicated


@pytest.mark.parametrize("seed", ["1 r1 -> r2", "2 r1 -> r2"])
def test_equal_seeds_give_equal_arrivals(seed: str) -> None:
    effects = Effects(delay=UniformDelay(kind="uniform", max_s=0.01))
    one, other = (Channel[int](effects, seed, MS) for _ in range(2))
    assert arrivals(one, [0, 3, 5], 20) == arrivals(other, [0, 3, 5], 20)
