"""Keys that are set from outside a scenario's file: what they reach, and who is blamed."""

from math import nan

import pytest
from support.scenario_text import SMALL, changed

from configs.errors import ScenarioError
from configs.loading import loads
from configs.overrides import Override


def test_an_override_reaches_robots_by_name_and_keeps_the_rest() -> None:
    scenario = loads("f", SMALL, ("robot.r2.pose.x_m=-6.5", "coordination.p=3"))
    assert scenario.robot[1].pose.x_m == -6.5
    assert scenario.robot[1].pose.y_m == 2.0
    assert scenario.coordination.p == 3.0


@pytest.mark.parametrize("override", ["k1", "=3", "robot.r7.pose.x_m=1", "name.x=1"])
def test_an_override_that_names_nothing_is_refused(override: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        loads("file.toml", SMALL, (override,))
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"--set {override}: ")


def blamed(*overrides: str | Override) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        loads("file.toml", SMALL, overrides)
    return str(caught.value).splitlines()


def test_what_an_option_set_is_blamed_on_the_option_whoever_finds_it() -> None:
    assert blamed(Override("--seed -3", "seed", -3)) == ["--seed -3: must be 0 or more"]
    (line,) = blamed("clock.share_period_s=0.0015")
    assert line.startswith("--set clock.share_period_s=0.0015: must be a whole multiple of")
    (line,) = blamed("path={kind='circle'}")
    assert line == "--set path={kind='circle'}: path.radius_m = (missing): must be given"
    assert blamed("robot.r2=3") == ["--set robot.r2=3: must be a table"]
    (line,) = blamed("robot.0.v_m_s='fast'")
    assert line == "--set robot.0.v_m_s='fast': must be a number"


def test_options_and_file_are_blamed_each_for_its_own_at_once() -> None:
    text = changed(SMALL, "control.k1=-1.0")
    with pytest.raises(ScenarioError) as caught:
        loads(
            "file.toml", text, ("robot.r9.s_0=1.0", Override("--duration nan", "duration_s", nan))
        )
    assert str(caught.value).splitlines() == [
        "--set robot.r9.s_0=1.0: no 'r9' there; known: r1, r2",
        "--duration nan: must be a finite number",
        "file.toml: control.k1 = -1.0: must be greater than 0",
    ]
    assert [complaint.where for complaint in caught.value.complaints][-1] == "file.toml"


def test_the_last_option_that_set_a_key_is_blamed() -> None:
    assert blamed("seed=-1", Override("--seed -2", "seed", -2)) == ["--seed -2: must be 0 or more"]
