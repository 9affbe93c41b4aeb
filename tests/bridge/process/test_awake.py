"""A clock that stands still while its process does."""

import pytest
from support.clocks import ManualClock

from bridge.process.awake import AFTERMATH_S, LATE_S, LOOK_S, STALL_S, AwakeClock, Lateness


class Machine:
    """A clock that is set by hand."""

    def __init__(self) -> None:
        self.time = ManualClock(1000 * 10**9)
        self.stalls: list[float] = []
        self.held = False
        self.clock = AwakeClock(
            held=lambda: self.held,
            on_stall=self.stalls.append,
            clock=self.time,
        )
        self.began_s = self.clock.now()

    def passes(self, seconds: float) -> None:
        self.time.passes(seconds)

    def awake_s(self) -> float:
        return round(self.clock.now() - self.began_s, 6)


def test_looks_that_are_close_count_the_time_between_them() -> None:
    machine = Machine()
    for _ in range(10):
        machine.passes(LOOK_S)
        machine.awake_s()
    assert machine.awake_s() == 1.0
    machine.passes(LOOK_S + 0.9 * STALL_S)  # late, and no stall yet
    assert machine.awake_s() == round(1.0 + LOOK_S + 0.9 * STALL_S, 6)
    assert machine.stalls == []


def test_a_stall_counts_as_the_wait_that_it_was_to_be_and_is_told() -> None:
    machine = Machine()
    machine.passes(60.0)
    assert machine.awake_s() == LOOK_S
    assert [round(stall, 6) for stall in machine.stalls] == [60.0 - LOOK_S]


def test_time_in_which_the_others_are_held_up_does_not_count() -> None:
    machine = Machine()
    machine.held = True
    for _ in range(50):
        machine.passes(LOOK_S)
        assert machine.awake_s() == 0.0
    machine.held = False
    machine.passes(LOOK_S)
    assert machine.awake_s() == LOOK_S


def test_work_is_no_stall() -> None:
    machine = Machine()
    machine.passes(5.0)
    machine.clock.resume()
    machine.passes(LOOK_S)
    assert machine.awake_s() == round(5.0 + LOOK_S, 6)
    assert machine.stalls == []


def test_a_stall_of_who_keeps_deadlines_is_found_once_and_is_over_after_a_while() -> None:
    lateness = Lateness(0.01)
    found = [lateness.note(tick, 1e-4) for tick in range(100)]
    # Stood still for 0.3 s: what was missed is caught up with, tick by tick.
    found += [lateness.note(100 + n, 0.3 - 0.01 * n) for n in range(30)]
    assert [tick for tick, begins in enumerate(found) if begins] == [100]
    assert lateness.stalls == [(100, 0.3)]
    over = next(
        tick for tick in range(130, 1000) if not (lateness.note(tick, 0.0), lateness.late)[1]
    )
    assert over == pytest.approx(126 + AFTERMATH_S / 0.01 + LATE_S / 0.01, abs=4)
    assert lateness.note(over + 1, 1.0)


def test_late_by_less_than_two_slow_periods_is_no_stall() -> None:
    lateness = Lateness(0.1)
    assert not lateness.note(1, 0.19)
    assert lateness.note(2, 0.21)
