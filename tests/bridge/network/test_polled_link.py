"""Waiting on a polled link, by a clock that only its pauses move."""

from collections.abc import Iterator
from itertools import accumulate

import pytest
from support.clocks import ManualClock

from bridge.network.session import ONE_THREAD, common, config_of, few_threads, open_bounded, set_key
from bridge.network.zenoh_link import _LONGEST_PAUSE_S, _PAUSE_SHARE, PolledLink


class Pauses(ManualClock):
    def __init__(self) -> None:
        super().__init__()
        self.pauses_s: list[float] = []

    def sleep(self, seconds: float) -> None:
        self.pauses_s.append(seconds)
        super().sleep(max(seconds, 1e-9))


@pytest.fixture
def waiting() -> Iterator[tuple[PolledLink, Pauses]]:
    config = config_of(common("peer", 1.0))
    set_key(config, "listen/endpoints", [])
    with few_threads(ONE_THREAD):
        session = open_bounded(config, 10.0)
    clock = Pauses()
    with PolledLink(session, 4, clock=clock) as link:
        link.subscribe("nobody/says/this", "tag")
        yield link, clock


def test_a_wait_ends_at_its_bound_after_pauses_that_grow(
    waiting: tuple[PolledLink, Pauses],
) -> None:
    link, clock = waiting
    assert link.receive(0.0) is None
    assert not clock.pauses_s
    assert link.receive(0.03) is None
    assert clock.monotonic_s() == pytest.approx(0.03)
    *growing, last = clock.pauses_s
    assert growing == sorted(growing)
    assert last <= growing[-1] == _LONGEST_PAUSE_S


def test_where_nothing_comes_looks_grow_rarer_over_waits_one_after_the_other(
    waiting: tuple[PolledLink, Pauses],
) -> None:
    link, clock = waiting
    for _ in range(100):
        assert link.receive(0.1) is None
    assert clock.monotonic_s() == pytest.approx(10.0)
    assert max(clock.pauses_s) == pytest.approx(0.1)  # a wait has a bound, and is kept to it
    ended_s = accumulate(clock.pauses_s)
    assert all(
        pause_s <= max(_LONGEST_PAUSE_S, _PAUSE_SHARE * at_s) + 1e-9
        for pause_s, at_s in zip(clock.pauses_s, ended_s, strict=True)
    )
    assert len(clock.pauses_s) < 400  # of 5000 without
