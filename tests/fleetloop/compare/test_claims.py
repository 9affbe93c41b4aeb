"""The paper's claims: relations that docs/comparison.md states, and the verdicts' own rules.

Four seconds of the paper's first robot, from its path on: what filters, estimates and derivatives
leave behind is there at once.
"""

from dataclasses import replace
from pathlib import Path

import pytest

from bridge.process.lifecycle import Stop
from configs.loading import load
from fleetloop.compare.claims import Claim, Verdict, claims
from fleetloop.compare.contenders import contenders, scenario_under
from fleetloop.compare.jobs import Outcome, Trial
from fleetloop.compare.results import Row
from fleetloop.compare.step_cost import StepCost
from fleetloop.jobs.job import Told
from fleetloop.jobs.pool import Failed

SLOW_FILTERS = "adaptive_dsc:gamma_1_s=0.05:gamma_2_s=0.05:gamma_3_s=0.05"
FAST_LEARNER = "adaptive_dsc:k5=[2.0,2.0,2.0,2.0,2.0,2.0,2.0,2.0]"
LAWS = (
    f"adaptive_dsc,{SLOW_FILTERS},{FAST_LEARNER},adaptive_dsc:k4=20,adaptive_dsc:k4=6,fixed_dsc:factor=3,"
    "backstepping_numeric"
)
NUMERIC = "backstepping_numeric"
BEHIND_IT = ("robot.r1.pose.x_m=-4.5", "duration_s=1.0")
ON_THE_PATH = (
    "robot=[{name='r1', pose={x_m=-3.5, y_m=3.0}, v_m_s=0.6, offset={kind='world', y_m=2.0}}]",
    "graph={generator='chain'}",
    "coordination.v_hat_0=0.6",
    "duration_s=4.0",
    "expect=[]",
)


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Row]:
    return run(LAWS, ON_THE_PATH, tmp_path_factory.mktemp("claims"))


def run(laws: str, start: tuple[str, ...], out: Path) -> dict[str, Row]:
    scenario = load("paper", start)
    made = {}
    for n, one in enumerate(contenders(laws)):
        under = scenario_under(scenario, one, folder="")
        done = Trial(Told.of(under, ""), out / str(n), False).work(lambda _: None, Stop())
        made[one.label] = Row(one.label, under, {1: done})
    return made


def judged(rows: dict[str, Row], *labels: str) -> dict[str, Claim]:
    return {one.claim: one for one in claims([rows[label] for label in labels])}


def verdict(found: dict[str, Claim], begins: str) -> Verdict:
    (one,) = (claim for text, claim in found.items() if text.startswith(begins))
    return one.verdict


def final(row: Row) -> float:
    assert row.worst is not None
    return row.worst["final_position_rms_m"]


def test_errors_of_the_papers_law_converge_to_a_small_neighbourhood(rows) -> None:
    found = judged(rows, "adaptive_dsc")
    assert verdict(found, "all errors converge") is Verdict.HOLDS
    assert 0.0 < final(rows["adaptive_dsc"]) < 0.02


def test_adaptation_beats_parameters_that_are_wrong_by_a_factor_of_three(rows) -> None:
    found = judged(rows, "adaptive_dsc", "fixed_dsc:factor=3")
    assert verdict(found, "adaptation handles unknown") is Verdict.HOLDS
    found = rows["adaptive_dsc"].worst["theta_hat_error"]
    assert found["end"] < found["start"] == pytest.approx(1.0)


def test_numerical_derivatives_ask_for_more_torque_than_filters_off_the_path(
    rows, tmp_path: Path
) -> None:
    behind = run("adaptive_dsc,backstepping_numeric", ON_THE_PATH + BEHIND_IT, tmp_path)
    assert verdict(judged(behind, *behind), "filters do better") is Verdict.HOLDS
    assert verdict(judged(rows, "adaptive_dsc", NUMERIC), "filters do better") is not Verdict.HOLDS


def test_from_a_start_that_faces_away_the_papers_law_diverges_and_the_robust_one_does_not(
    tmp_path: Path,
) -> None:
    away = ("robot.r1.pose={x_m=-3.6, y_m=3.4, theta_rad=2.3}", "robot.r1.v_m_s=0.0")
    still = ("coordination.v_hat_0=0.0", "duration_s=1.5")
    found = run("adaptive_dsc,adaptive_dsc_robust", (*ON_THE_PATH, *away, *still), tmp_path)
    assert "its motion diverged" in found["adaptive_dsc"].troubles[0]
    assert found["adaptive_dsc_robust"].sound
    assert verdict(judged(found, "adaptive_dsc"), "all errors") is Verdict.DOES_NOT_HOLD


def test_the_estimate_of_the_disturbance_changes_next_to_nothing(tmp_path: Path) -> None:
    disturbed = ("disturbance.amplitude_wheel_N_m=0.1", "duration_s=2.0")
    start = ON_THE_PATH + disturbed
    with_it, without = run("adaptive_dsc,adaptive_dsc:eta=0", start, tmp_path).values()
    assert final(with_it) == pytest.approx(final(without), rel=0.02)


def test_faster_filters_and_a_larger_speed_gain_leave_less_error(rows) -> None:
    for before, after in ((SLOW_FILTERS, "adaptive_dsc"), ("adaptive_dsc", "adaptive_dsc:k4=6")):
        found = judged(rows, before, after)
        assert verdict(found, "larger k_1") is Verdict.HOLDS


def test_sampled_a_speed_gain_beyond_its_limit_breaks_the_law(rows) -> None:
    found = judged(rows, "adaptive_dsc", "adaptive_dsc:k4=20")
    assert verdict(found, "larger k_1") is Verdict.DOES_NOT_HOLD


def test_slower_adaptation_does_not_leave_less_error(rows) -> None:
    found = judged(rows, FAST_LEARNER, "adaptive_dsc")
    assert verdict(found, "a smaller K_5") is Verdict.DOES_NOT_HOLD


def test_a_claim_whose_laws_are_not_there_is_not_testable(rows) -> None:
    found = judged(rows, "backstepping_numeric")
    assert {claim.verdict for claim in found.values()} == {Verdict.NOT_TESTABLE}
    assert "needs adaptive_dsc among the laws" in {claim.measured for claim in found.values()}


def test_the_cost_of_a_step_is_judged_by_the_ratio_to_the_paper_law(rows) -> None:
    (rival,) = contenders("backstepping_analytic")
    scenario = scenario_under(load("paper"), rival, folder="")
    ours = replace(rows["adaptive_dsc"], cost=StepCost(4.0, 1.0))
    for ratio, held in ((1.5, Verdict.HOLDS), (1.02, Verdict.DOES_NOT_HOLD)):
        costs = Row(rival.label, scenario, {}, StepCost(5.0, ratio))
        found = {one.claim: one for one in claims([ours, costs])}
        assert verdict(found, "a simpler law") is held


def test_a_paper_law_that_stops_does_not_converge(rows) -> None:
    broken = Row("adaptive_dsc", rows["adaptive_dsc"].scenario, {1: Failed("stands still")})
    found = {one.claim: one for one in claims([broken, rows["fixed_dsc:factor=3"]])}
    assert verdict(found, "all errors converge") is Verdict.DOES_NOT_HOLD
    assert verdict(found, "adaptation handles") is Verdict.DOES_NOT_HOLD


def test_numbers_are_the_worst_over_the_seeds(rows) -> None:
    ours, wrong = rows["adaptive_dsc"], rows["fixed_dsc:factor=3"]
    (one,), (other,) = ours.outcomes, wrong.outcomes
    both = Row("both", ours.scenario, {1: one, 2: other})
    assert final(both) == max(final(ours), final(wrong))
    settled = one.measures["settle_s"]
    never = replace(one, measures=one.measures | {"settle_s": settled | {"x_e_m": None}})
    assert Row("never", ours.scenario, {1: one, 2: never}).worst["settle_s"]["x_e_m"] is None


def test_a_run_is_an_outcome_with_numbers_and_courses(rows) -> None:
    (one,) = rows["adaptive_dsc"].outcomes
    assert isinstance(one, Outcome)
    assert set(one.courses) == {
        "x_e_m",
        "y_e_m",
        "theta_e_rad",
        "torque_wheel_N_m",
        "theta_hat_error",
    }
