"""What is said of how far a study is."""

from support.clocks import ManualClock

from fleetloop.sweep.progress import Meter


def test_rate_and_time_left_are_those_of_this_command_alone() -> None:
    clock = ManualClock()
    meter = Meter("study", 1000, 400, quiet=True, clock=clock)
    meter.begin()
    assert meter.state() == ", starting"
    clock.passes(10.0)
    meter.advance(["held"] * 180 + ["failed"] * 20)
    assert meter.state() == ", 20 a second, 0:20 left"
    assert meter.line(meter.state()) == (
        "study: 600 of 1000 cases, 20 a second, 0:20 left: 180 held, 20 failed"
    )


def test_a_slow_study_has_its_rate_by_the_minute() -> None:
    clock = ManualClock()
    meter = Meter("study", 100, 0, quiet=True, clock=clock)
    clock.passes(60.0)
    meter.advance(["held"] * 3)
    assert meter.state() == ", 3 a minute, 32:20 left"
