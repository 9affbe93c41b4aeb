"""Tuning files: what is in them, and that what is wrong names key, value and remedy."""

import pytest
from support.tunings import HEAD, PEAK, SEEDS, TINY, P, plan_of, tuning_of

from configs.errors import ScenarioError
from fleetloop.tune import tuning as tunings
from fleetloop.tune.plan import TuningPlan
from fleetloop.tune.tuning import differences


def refused(text: str) -> str:
    with pytest.raises(ScenarioError) as error:
        tuning_of(text)
    return str(error.value)


@pytest.mark.parametrize("name", tunings.shipped())
def test_a_shipped_tuning_fits_its_base(name: str) -> None:
    assert TuningPlan.of(name).check(name).study.total >= 1


def test_what_is_written_out_is_read_as_the_same() -> None:
    tuning = tuning_of(TINY)
    assert tuning_of(tuning.to_toml()) == tuning


def test_a_trial_is_a_study_whose_parameters_are_factors_of_one_level() -> None:
    study = tuning_of(TINY).study_of({"p": 1.5, "q": 0.25})
    assert study.total == 2
    assert [(one.column, one.values) for one in study.factor[1:]] == [("p", (1.5,)), ("q", (0.25,))]
    assert study.keep.quantities == ("peak_x_e_m",)


def test_all_trials_have_the_same_cases() -> None:
    text = TINY.replace('"grid"', '"latin_hypercube"\ncases = 4').replace(
        "integers = [1, 2]", "integers = [1, 99999]"
    )
    plan = plan_of(text)
    one, other = (plan.cases({"p": p, "q": 1.0}) for p in (0.5, 3.0))
    seeds = [[cases.case(n).values[0] for n in range(4)] for cases in (one, other)]
    assert seeds[0] == seeds[1]
    assert len(set(seeds[0])) == 4


def test_no_case_may_fail_unless_the_file_says_otherwise() -> None:
    assert [one.label for one in tuning_of(TINY).demands] == ["failure rate ≤ 0"]
    more = TINY + '[[constraint]]\nquantity = "failure_rate"\nat_most = 0.1\n'
    assert [one.label for one in tuning_of(more).demands] == ["failure rate ≤ 0.1"]


@pytest.mark.parametrize(
    ("was", "is_now", "words"),
    [
        ("trials = 12", "trials = 0", "tuning.toml: trials = 0: must be"),
        ("trials = 12", "trails = 12", "trails"),
        ("uniform = [0.5, 4.0]", "uniform = [4.0, 0.5]", "parameter.0.uniform"),
        ("baseline = 3.0", "baseline = 5.0", "parameter.0.baseline = 5.0: must be one of"),
        ("baseline = 3.0\n", "", 'parameter.0.baseline = "missing": must be given, or of no'),
        ('"peak_x_e_m"', '"pique_x_e_m"', 'objective.quantity = "pique_x_e_m": no such quantity'),
        (PEAK, "", "objective"),
        ('key = "coordination.q"', 'key = "coordination.p"', "parameter.1.name"),
        ('design = "grid"', 'design = "grid"\ncheck_cases = 5', "check_cases = 5: a grid has no"),
    ],
)
def test_a_wrong_value_is_named(was: str, is_now: str, words: str) -> None:
    assert words in refused(TINY.replace(was, is_now))


def test_a_constraint_that_is_said_twice_is_refused() -> None:
    one = '[[constraint]]\nquantity = "peak_y_e_m"\nat_most = 1.0\n'
    assert "constraint.1.quantity" in refused(TINY + one + one)


@pytest.mark.parametrize(
    ("was", "is_now", "words"),
    [
        ('"peak_x_e_m"', '"peak_x_f_m"', 'objective.quantity = "x_f_m": no such signal'),
        ('"peak_x_e_m"', '"expect_9_margin"', "the base has no such expectation"),
        ('"coordination.p"', '"coordination.r"', "parameter.0.key"),
        ("uniform = [0.5, 4.0]", "uniform = [-0.5, 4.0]", "parameter.0: p = -0.5: makes no valid"),
    ],
)
def test_what_does_not_fit_the_base_is_named(was: str, is_now: str, words: str) -> None:
    with pytest.raises(ScenarioError) as error:
        plan_of(TINY.replace(was, is_now)).check("tuning.toml")
    assert words in str(error.value)


def test_a_difference_names_key_and_both_values() -> None:
    ours, theirs = tuning_of(TINY), tuning_of(TINY.replace("seed = 1", "").replace("tiny", "tinny"))
    assert differences(ours, theirs) == ['title: "tinny", there "tiny"']
    assert differences(ours, tuning_of(TINY.replace("trials = 12", "trials = 13"))) == []


def test_a_tuning_without_a_baseline_has_none() -> None:
    text = HEAD + SEEDS + P.replace("baseline = 3.0\n", "") + PEAK
    assert tuning_of(text).baseline is None
