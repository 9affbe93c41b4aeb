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


@given(st.lists(st.sampled_from(["both", "one", "none"]), max_size=50))
def test_each_tick_is_due_once_whatever_frames_its_question_has(came: list[str]) -> None:
    both = False
    clock = BusClock(SCHEDULE, lambda _: both)
    ticks = []
    for k, frames in enumerate(came):
        now_ns, both = k * SCHEDULE.period_ns, frames == "both"
        found = [] if frames == "none" else [clock.due(now_ns)]
        found += [clock.due_at_end(now_ns), clock.due_at_end(now_ns)]
        assert found.index(next(filter(lambda it: it is not None, found))) == (frames == "one")
        ticks += [tick for tick in found if tick is not None]
    first = -SCHEDULE.countdown_ticks
    assert ticks == list(range(first, first + len(came)))
