"""The bus as a controller's clock: each tick once, in order, with its frames or without."""

from hypothesis import given
from hypothesis import strategies as st

from agents.bus_clock import BusClock
from configs.loading import load
from configs.resolve import schedule

SCHEDULE = schedule(load("two_robots"))


def test_a_tick_is_due_with_both_encoder_frames_and_not_before() -> None:
    heard = False
    clock = BusClock(SCHEDULE, lambda _: heard)
    first = -SCHEDULE.countdown_ticks
    assert clock.due(100) is None
    heard = True
    assert clock.due(200) == first
    assert clock.due(300) is None  # the next tick's time has not come
    assert clock.due(SCHEDULE.period_ns) == first + 1


@given(st.lists(st.booleans(), max_size=50))
def test_each_tick_is_due_once_whether_its_frames_came_or_its_period_passed(
    came: list[bool],
) -> None:
    clock = BusClock(SCHEDULE, lambda _: True)
    ticks = []
    for k, here in enumerate(came):
        ticks.append(clock.due(k * SCHEDULE.period_ns) if here else clock.due_without_frames())
    first = -SCHEDULE.countdown_ticks
    assert ticks == list(range(first, first + len(came)))
