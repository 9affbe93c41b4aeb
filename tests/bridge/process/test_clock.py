"""Instants between machines."""

import time

from support.clocks import ManualClock

from bridge.process.clock import monotonic_of, wall_of


class Clocks(ManualClock):
    """A machine whose wall clock is ahead of its monotonic one."""

    AHEAD_NS = 1_700_000_000 * 10**9

    def wall_ns(self) -> int:
        return self.now_ns + self.AHEAD_NS


def test_an_instant_comes_back_as_it_went() -> None:
    here, there = Clocks(5 * 10**9), Clocks(77 * 10**9)
    assert wall_of(4 * 10**9, here) == 4 * 10**9 + Clocks.AHEAD_NS
    assert monotonic_of(wall_of(4 * 10**9, here), there) == 4 * 10**9


def test_the_wall_clock_is_the_one_that_travels() -> None:
    before_ns = time.time_ns()
    assert abs(wall_of(time.monotonic_ns()) - before_ns) < 60 * 10**9
