"""Stopping rules: the interval against SciPy's, the first cases by number, the budget."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest

from fleetloop.sweep.stopping import Rate, Tally, decided
from fleetloop.sweep.study import Stopping


@given(st.integers(0, 500), st.integers(1, 500), st.sampled_from([0.8, 0.95, 0.99]))
def test_the_interval_is_wilsons(failed: int, judged: int, confidence: float) -> None:
    failed = min(failed, judged)
    ours = Rate(failed, judged, confidence).interval
    theirs = binomtest(failed, judged).proportion_ci(confidence, "wilson")
    assert ours == pytest.approx((theirs.low, theirs.high), abs=1e-12)


@pytest.mark.parametrize("p", [0.05, 0.3, 0.5])
def test_the_interval_covers_the_true_rate_about_as_often_as_it_says(p: float) -> None:
    n = 200
    covered = sum(
        binom.pmf(k, n, p)
        for k in range(n + 1)
        if Rate(k, n, 0.95).interval[0] <= p <= Rate(k, n, 0.95).interval[1]
    )
    assert covered == pytest.approx(0.95, abs=0.02)


def test_without_a_judged_case_nothing_is_known() -> None:
    assert Rate(0, 0, 0.95).interval == (0.0, 1.0)
    assert Rate(0, 0, 0.95).value is None


def test_only_the_first_cases_count_all_of_which_are_done() -> None:
    tally = Tally(10)
    for number in (0, 1, 3, 4):
        tally.add(number, "failed")
    assert (tally.rate(0.95).failed, tally.rate(0.95).judged) == (2, 2)
    tally.add(2, "held")
    assert (tally.rate(0.95).failed, tally.rate(0.95).judged) == (4, 5)


def test_what_was_not_judged_is_no_part_of_the_rate() -> None:
    tally = Tally(5)
    verdicts = ("held", "invalid", "error", "not checked", "failed")
    for number, verdict in enumerate(verdicts):
        tally.add(number, verdict)
    assert (tally.rate(0.95).failed, tally.rate(0.95).judged) == (1, 2)
    assert (tally.rate_of_all(0.95).failed, tally.rate_of_all(0.95).judged) == (1, 2)


def test_a_study_ends_as_soon_as_its_rate_is_known_well_enough() -> None:
    stopping = Stopping(failure_rate_within=0.05, least_cases=30)
    draw = np.random.default_rng(3).random(2000) < 0.2
    tally = Tally(2000)
    for number, failed in enumerate(draw):
        tally.add(number, "failed" if failed else "held")
        if said := decided(stopping, tally, 0.0):
            break
    assert tally.rate(0.95).half_width <= 0.05
    n = tally.rate(0.95).judged
    assert Rate(tally.rate(0.95).failed, n - 1, 0.95).half_width > 0.049
    assert 200 < n < 300
    assert "within ±0.05" in said


def test_few_cases_are_not_looked_at() -> None:
    tally = Tally(40)
    for number in range(29):
        tally.add(number, "held")
    assert decided(Stopping(failure_rate_within=0.4), tally, 0.0) == ""
    tally.add(29, "held")
    assert decided(Stopping(failure_rate_within=0.4), tally, 0.0) != ""


def test_its_budget_is_wall_time() -> None:
    assert decided(Stopping(budget_s=60.0), Tally(1), 59.9) == ""
    assert decided(Stopping(budget_s=60.0), Tally(1), 60.0) == "budget_s = 60 s is over"
