"""The laws of a comparison and the scenario under each."""

from pathlib import Path

import pytest
from support.own_files import write_own_files

from configs.errors import ScenarioError
from configs.loading import load
from fleetloop.compare.contenders import contenders, gains_in_words, scenario_under


def under(label: str, source: str = "paper", *overrides: str, seed: int | None = None):
    (one,) = contenders(label)
    return scenario_under(load(source, overrides), one, folder="", seed=seed)


def test_laws_are_told_apart_by_commas_outside_of_lists() -> None:
    made = contenders("adaptive_dsc:k5=[1.0,2.0], my_law:Mine , fixed_dsc:factor=3:k4=2")
    assert [one.law for one in made] == ["adaptive_dsc", "my_law:Mine", "fixed_dsc"]
    assert [one.gains for one in made] == [{"k5": [1.0, 2.0]}, {}, {"factor": 3, "k4": 2}]
    assert made[2].label == "fixed_dsc:factor=3:k4=2"


def test_a_gain_is_that_of_the_law_then_the_scenarios_then_the_default() -> None:
    scenario = under("fixed_dsc:factor=3", "paper", "control.k4=2.5", "control.k1=1.5")
    gains = scenario.control.parameters
    assert (gains.factor, gains.k4, gains.k1, gains.k2) == (3.0, 2.5, 1.5, 3.0)
    assert under("fixed_dsc:k4=2", "paper", "control.k4=2.5").control.parameters.k4 == 2.0


def test_robots_keep_their_own_gains_and_lose_their_own_law() -> None:
    own = ("robot.r2.control={law='adaptive_dsc_robust', k4=1.0}", "robot.r3.control.k1=0.5")
    scenario = under("fixed_dsc", "paper", *own)
    laws = [scenario.control_of(robot) for robot in scenario.robot]
    assert {law.name for law in laws} == {"fixed_dsc"}
    assert [law.parameters.k4 for law in laws] == [3.0, 1.0, 3.0, 3.0]
    assert [law.parameters.k1 for law in laws] == [2.0, 2.0, 0.5, 2.0]


def test_only_the_law_the_seed_and_expectations_of_its_own_signals_change() -> None:
    about_the_law = "expect=[{signal='kappa_hat', max_abs=1.0}, {signal='x_e_m', max_abs=1.0}]"
    before = load("paper", (about_the_law,))
    after = under("backstepping_analytic", "paper", about_the_law, seed=7)
    assert [expect.signal for expect in after.expect] == ["x_e_m"]
    assert after.seed == 7
    kept = {"control": before.control, "seed": before.seed, "expect": before.expect}
    assert after.model_copy(update=kept) == before


def test_a_law_beside_the_scenario_is_found(tmp_path: Path) -> None:
    write_own_files(tmp_path)
    (one,) = contenders("my_law:Unicycle:k_x_1_s=2.5")
    scenario = scenario_under(load("paper"), one, folder=str(tmp_path))
    assert scenario.control.parameters.k_x_1_s == 2.5
    assert gains_in_words(scenario).startswith("k_x_1_s = 2.5, k_i_1_s2 = 0.2")


@pytest.mark.parametrize(
    ("label", "said"),
    [
        ("fixd_dsc", "--laws fixd_dsc: control.law = .*did you mean fixed_dsc"),
        ("fixed_dsc:factor=-1", "--laws fixed_dsc:factor=-1: control.factor = -1: must be 0"),
        ("fixed_dsc:k5=3", "--laws fixed_dsc:k5=3: control.k5 = 3: unknown key"),
        (" , ", "names no law"),
        ("fixed_dsc,fixed_dsc", "fixed_dsc comes twice"),
        ("fixed_dsc:=3", "must read gain=value"),
    ],
)
def test_what_is_wrong_with_a_law_names_the_option(label: str, said: str) -> None:
    with pytest.raises(ScenarioError, match=said):
        for one in contenders(label):
            scenario_under(load("paper"), one, folder="")
