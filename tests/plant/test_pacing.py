"""The pace of lockstep: which ticks may begin, and when."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from configs.brief import LEAD_TICKS, Schedule
from configs.loading import load
from configs.resolve import schedule
from plant.pacing import Pacing

SCHEDULE: Schedule = replace(schedule(load("two_robots")), ticks=1000)
S = 10**9


def test_as_fast_as_it_can_buses_are_apart_by_the_lookahead_and_no_tick_is_due_later() -> None:
    pacing = Pacing(SCHEDULE)
    assert (pacing.window, pacing.due_ns(900), pacing.paused) == (LEAD_TICKS, 0, False)


@given(speed=st.floats(1e-3, 1e3), tick=st.integers(1, 500), later=st.integers(0, 500))
def test_at_a_speed_ticks_are_due_by_it_from_where_it_was_set(
    speed: float, tick: int, later: int
) -> None:
    pacing = Pacing(SCHEDULE)
    pacing.set_speed(speed, tick, 7 * S)
    assert pacing.window == 0
    expected_ns = 7 * S + later * SCHEDULE.period_ns / speed
    assert pacing.due_ns(tick + later) == pytest.approx(expected_ns, rel=1e-6, abs=later + 1)
    pacing.set_speed(0.0, tick, 8 * S)
    assert (pacing.window, pacing.due_ns(tick + later)) == (LEAD_TICKS, 0)


def test_a_pause_lets_what_has_begun_end_and_steps_count_from_there() -> None:
    pacing = Pacing(SCHEDULE)
    assert pacing.step(10) == "the run isn't paused"
    assert pacing.pause(41) == pacing.last_tick == 41
    assert pacing.pause(41) == 41
    assert pacing.step(10) == pacing.last_tick == 51
    assert pacing.pause(45) == 45  # in the midst of steps
    assert pacing.step(10_000) == SCHEDULE.ticks  # the closing tick is the last
    pacing.resume()
    assert not pacing.paused
    assert pacing.pause(SCHEDULE.ticks) == "the run is at its last tick"


@given(st.lists(st.integers(1, 300), max_size=8))
def test_steps_add_up(steps: list[int]) -> None:
    pacing = Pacing(replace(SCHEDULE, ticks=10_000))
    pacing.pause(0)
    for ticks in steps:
        pacing.step(ticks)
    assert pacing.last_tick == sum(steps)
