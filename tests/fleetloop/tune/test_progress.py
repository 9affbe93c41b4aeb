"""What the bar of a tuning says."""

from fleetloop.tune.progress import Meter
from fleetloop.tune.scores import Score, Trial


class Still:
    """A clock that is set."""

    now_s = 100.0

    def monotonic_s(self) -> float:
        return self.now_s


def trial(*, feasible: bool) -> Trial:
    missed = {"failure rate ≤ 0": 0.0 if feasible else 0.5}
    return Trial(7, {}, Score(0.0125, {}, missed, {"held": 2}, {}, ""))


def test_the_time_left_follows_from_the_trials_of_this_command() -> None:
    clock = Still()
    with Meter("gains", 60, 20, quiet=True, clock=clock) as meter:
        meter.begin()
        assert meter.state() == ""
        clock.now_s += 30.0
        meter.advance(30, trial(feasible=True))
        assert meter.state() == ", best 0.0125 (trial 7), 1:30 left"


def test_a_best_trial_that_misses_a_constraint_is_said_to() -> None:
    with Meter("gains", 60, 0, quiet=True, clock=Still()) as meter:
        meter.advance(8, trial(feasible=False))
        assert meter.state() == ", best 0.0125 (trial 7, not feasible)"


def test_what_comes_after_the_trials_is_said() -> None:
    with Meter("gains", 8, 0, quiet=True, clock=Still()) as meter:
        meter.advance(8, trial(feasible=True))
        meter.check()
        assert meter.state().endswith("judged on other cases now")
