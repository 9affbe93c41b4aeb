"""Instants between machines."""

import time

from bridge.process.clock import monotonic_of, wall_of


def test_an_instant_comes_back_as_it_went() -> None:
    now_ns = time.monotonic_ns()
    assert abs(monotonic_of(wall_of(now_ns)) - now_ns) < 10_000_000


def test_the_wall_clock_is_the_one_that_travels() -> None:
    assert abs(wall_of(time.monotonic_ns()) - time.time_ns()) < 10_000_000
