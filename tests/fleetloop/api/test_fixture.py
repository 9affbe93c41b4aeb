"""`fleetloop_run`: a scenario within a test of somebody else's."""

import pytest

from fleetloop import load

SHORT = load("two_robots").with_(until_s=0.1, expect=[])
WRONG = SHORT.with_(expect=[{"signal": "x_e_m", "max_abs": 1e-9}])


def test_a_run_that_holds_is_returned(fleetloop_run, tmp_path) -> None:
    first, second = fleetloop_run(SHORT), fleetloop_run(SHORT.with_(seed=2))
    assert first.folder.parent == second.folder.parent == tmp_path
    assert (first.summary.seed, second.summary.seed) == (1, 2)


def test_one_that_does_not_hold_fails_the_test_in_the_words_of_its_verdict(fleetloop_run) -> None:
    with pytest.raises(pytest.fail.Exception) as caught:
        fleetloop_run(WRONG)
    assert caught.value.msg.startswith("two_robots: failed\nFAILED       x_e_m within ±1e-09")
    assert not fleetloop_run(WRONG, must_hold=False).held


def test_one_that_ends_before_its_expectations_may_be_let_through(fleetloop_run) -> None:
    cut = load("two_robots").with_(until_s=0.1)
    with pytest.raises(pytest.fail.Exception, match="not reached"):
        fleetloop_run(cut)
    assert fleetloop_run(cut, allow_unchecked=True).verdict == "not checked"


def test_a_scenario_that_can_not_be_run_fails_in_the_words_of_its_error(fleetloop_run) -> None:
    with pytest.raises(pytest.fail.Exception, match="no shipped scenario of that name"):
        fleetloop_run("two_robts")
