"""What is due at a tick, and when that is, from the schedule's periods and delays."""

from hypothesis import given
from hypothesis import strategies as st

from configs.brief import Schedule
from configs.ticks import Ticks

EVERY = st.integers(1, 40)


@given(EVERY, EVERY, st.integers(0, 50), st.integers(-60, 400))
def test_due_is_what_was_shared_or_taken_its_delay_ago(
    share_every: int, localise_every: int, delay: int, tick: int
) -> None:
    schedule = Schedule(1_000_000, 400, 60, share_every, localise_every, delay, 2.0, 20.0)
    ticks = Ticks(schedule)
    shared = {k for k in range(401) if k % share_every == 0}
    taken = {k for k in range(401) if k % localise_every == 0}
    assert ticks.shares(tick) == (tick in shared)
    assert ticks.localises(tick) == (tick in taken)
    assert ticks.bus_time_ns(tick) == (tick + 60) * 1_000_000
    posed, placed = tick - delay in taken, tick - max(delay, 1) in taken
    assert ticks.owes(tick) == (tick in shared or posed or placed)
