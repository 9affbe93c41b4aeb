"""Waiting on a polled link, by a clock that only its pauses move."""

import pytest
from support.clocks import ManualClock

from bridge.network.session import ONE_THREAD, common, config_of, few_threads, open_bounded, set_key
from bridge.network.zenoh_link import _LONGEST_PAUSE_S, PolledLink


class Pauses(ManualClock):
    def __init__(self) -> None:
        super().__init__()
        self.pauses_s: list[float] = []

    def sleep(self, seconds: float) -> None:
        self.pauses_s.append(seconds)
        super().sleep(max(seconds, 1e-9))


def test_a_wait_ends_at_its_bound_after_pauses_that_grow() -> None:
    config = config_of(common("peer", 1.0))
    set_key(config, "listen/endpoints", [])
    with few_threads(ONE_THREAD):
        session = open_bounded(config, 10.0)
    clock = Pauses()
    with PolledLink(session, 4, clock=clock) as link:
        link.subscribe("nobody/says/this", "tag")
        assert link.receive(0.0) is None
        assert not clock.pauses_s
        assert link.receive(1.0) is None
    assert clock.monotonic_s() == pytest.approx(1.0)
    *growing, last = clock.pauses_s
    assert growing == sorted(growing)
    assert last <= growing[-1] == _LONGEST_PAUSE_S
