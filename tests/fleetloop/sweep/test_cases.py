"""Cases: their scenarios, their commands, and what is said of values that make none."""

import shlex

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.studies import FEW, MASS, SHORT, P, cases_of, plan_of

from configs.errors import ScenarioError
from configs.loading import load
from configs.scenario import Scenario
from fleetloop.sweep.cases import Cases
from fleetloop.sweep.plan import Plan
from fleetloop.sweep.study import shipped

EVERY = """
[[factor]]
name = "v"
key = "robot.*.v_m_s"
uniform = [0.1, 0.6]
[[factor]]
graph = { max_in_degree = 2 }
[[factor]]
key = "control.law"
values = ["adaptive_dsc", "adaptive_dsc_robust"]
[[factor]]
key = "seed"
integers = [1, 1000000]
"""
SAMPLED = SHORT + 'design = "random"\ncases = 1000\n' + MASS + EVERY + FEW
CASES = cases_of(SAMPLED)


def of_command(command: str) -> Scenario:
    """The scenario that a command runs."""
    program, verb, source, *words = shlex.split(command)
    assert (program, verb) == ("fleetloop", "run")
    assert words[:2] == ["--in-process", "--force"]
    assert words[2::2] == ["--set"] * (len(words) // 2 - 1)
    return load(source, words[3::2])


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 999))
def test_the_command_of_a_case_runs_exactly_its_scenario(number: int) -> None:
    case = CASES.case(number)
    assert of_command(CASES.command(case)) == CASES.scenario(case)


@pytest.mark.parametrize("name", shipped())
def test_the_cases_of_shipped_studies_are_what_their_commands_run(name: str) -> None:
    cases = Cases(Plan.of(name))
    for number in range(0, cases.study.total, cases.study.total // 5):
        assert of_command(cases.command(cases.case(number))) == cases.scenario(cases.case(number))


def test_a_key_of_every_robot_gives_all_the_same_value() -> None:
    scenario = CASES.scenario(CASES.case(5))
    value = CASES.shown(CASES.case(5))["v"]
    assert [robot.v_m_s for robot in scenario.robot] == [value, value]


def test_a_case_leaves_no_trace_in_the_next_one() -> None:
    fresh = cases_of(SAMPLED)
    before = fresh.scenario(fresh.case(7))
    fresh.scenario(fresh.case(8))
    assert fresh.scenario(fresh.case(7)) == before


def test_values_that_make_no_scenario_are_named_with_their_case() -> None:
    text = SHORT + 'design = "grid"\n' + P.replace("2.0]", "-2.0]") + FEW
    cases = cases_of(text)
    cases.scenario(cases.case(1))
    with pytest.raises(ScenarioError) as found:
        cases.scenario(cases.case(2))
    assert str(found.value).startswith("case 2: p = -2.0: must be")


def test_a_plan_that_was_saved_makes_the_same_cases(tmp_path) -> None:
    plan = plan_of(SAMPLED)
    plan.save(tmp_path)
    again = Plan.resume(tmp_path)
    assert again == plan
    one, other = Cases(again), CASES
    assert one.command(one.case(17)) == other.command(other.case(17))


def test_a_folder_without_a_study_is_refused(tmp_path) -> None:
    with pytest.raises(ScenarioError, match=r"no study was begun there: no study\.toml"):
        Plan.resume(tmp_path)
    (tmp_path / "study.toml").write_text(SAMPLED, "utf-8")
    with pytest.raises(ScenarioError, match=r"study\.toml: a file, not the folder of a study"):
        Plan.resume(tmp_path / "study.toml")


def test_a_base_beside_the_study_is_found_from_anywhere(tmp_path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "base.toml").write_text(load("two_robots").to_toml(), "utf-8")
    study = SHORT.replace('"two_robots"', '"base.toml"') + 'design = "grid"\n' + P + FEW
    (folder / "study.toml").write_text(study, "utf-8")
    plan = Plan.of(str(folder / "study.toml"))
    assert plan.base.source == str(folder / "base.toml")
    cases = Cases(plan)
    assert of_command(cases.command(cases.case(0))) == cases.scenario(cases.case(0))


def test_a_key_of_two_factors_is_refused_and_both_are_named() -> None:
    one = P + 'name = "slow"\n'
    for key in ("coordination.p", "robot.*.body.body_mass_kg"):
        other = f'[[factor]]\nname = "q"\nkey = "{key}"\nuniform = [1.0, 2.0]\n'
        again = other.replace('"q"', '"r"').replace("*", "r2")
        head = SHORT + 'design = "random"\ncases = 3\n'
        with pytest.raises(ScenarioError, match=r"study\.toml: factor\..*sets it already"):
            cases_of(head + (one if key == "coordination.p" else other) + again + FEW)


@pytest.mark.parametrize("text", ["until_s", "until_s=-3", "control.nope=1"])
def test_an_error_in_set_names_the_study_and_its_place(text: str) -> None:
    head = SHORT.replace('"until_s=0.1",', f'"until_s=0.1", "{text}",')
    with pytest.raises(ScenarioError, match=r"study\.toml: set\.1"):
        cases_of(head + 'design = "grid"\n' + P + FEW)
