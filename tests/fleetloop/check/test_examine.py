"""All checks together: shipped scenarios, and kinds of scenarios that don't run well."""

import json

import pytest

from configs.loading import load, shipped
from fleetloop.check.command import check_scenario
from fleetloop.check.examine import examine
from fleetloop.check.finding import Finding, alike, in_words, worst

REALISTIC = "drive.preset='realistic'"


def found(name: str, *overrides: str) -> list[Finding]:
    return examine(name, load(name, overrides))


@pytest.mark.parametrize("name", shipped())
def test_no_shipped_scenario_has_an_error(name: str) -> None:
    assert worst(found(name)) in ("ok", "warning")


@pytest.mark.parametrize("name", ["paper", "twelve", "spline_gate"])
def test_shipped_scenarios_can_be_checked_with_realistic_drives(name: str) -> None:
    assert found(name, REALISTIC)


def test_alike_robots_share_a_finding() -> None:
    loops = [f for f in found("paper") if f.title.startswith("sampled speed loop")]
    assert [finding.robots for finding in loops] == [("r1", "r2", "r3", "r4")]


def test_findings_that_differ_in_numbers_share_a_line_that_names_the_others() -> None:
    one = Finding("warning", "torque", "0.4 of 0.5", ("r1",))
    two = Finding("warning", "torque", "0.45 of 0.5", ("r2",))
    assert alike([one, two]) == [one, two]
    assert in_words([one, two]) == ["warning: r1: torque: 0.4 of 0.5; likewise r2"]


def test_gains_for_1_khz_are_refused_at_100_hz_with_gains_that_suit() -> None:
    slow = "clock.control_period_s=0.01", "clock.countdown_s=0.5"
    loops = [f for f in found("paper", *slow) if f.title.startswith("sampled speed loop")]
    assert {finding.level for finding in loops} == {"error"}
    assert all("suits this rate" in finding.text for finding in loops)


def test_a_large_k1_is_warned_of_against_filters_and_period() -> None:
    warned = [f for f in found("realtime_100hz", "control.k1=60.0") if f.key == "control.k1"]
    assert {finding.level for finding in warned} == {"warning"}
    assert "k1 = " in warned[0].text
    assert "it is 60" in warned[0].text


def test_poses_that_are_held_while_the_reference_moves_on_are_warned_of() -> None:
    held = "localisation.source='external'", "clock.localisation_period_s=0.5"
    poses = [f for f in found("realtime_100hz", *held) if f.title.startswith("poses held")]
    assert {finding.level for finding in poses} == {"warning"}
    assert all("held 0.5 s" in finding.text for finding in poses)


def test_the_papers_first_torque_is_the_one_that_no_drive_has() -> None:
    first = next(f for f in found("paper") if f.title == "first torques")
    assert "691 N·m" in first.text
    limited = [f for f in found("paper", "drive.preset='limited'") if f.title == "first torques"]
    assert {f.level for f in limited} == {"warning"}
    # What the host limits, the law is told: it learns nothing from it.
    held = found("paper", "host.torque_limit_wheel_N_m=0.5")
    assert {f.level for f in held if f.title == "first torques"} == {"ok"}


def test_starts_that_the_sampled_adaptation_does_not_survive_are_warned_of() -> None:
    ratio = next(f for f in found("paper") if f.title.startswith("(35)"))
    assert ratio.level == "ok"
    away = "robot.r1.pose.theta_rad=3.1", "robot.r1.pose.x_m=-2.0", "robot.r1.pose.y_m=3.3"
    slow = "clock.control_period_s=0.002", "control.k4=0.9", "clock.countdown_s=0.5"
    warned = [f for f in found("paper", *away, *slow) if f.title.startswith("(35)")]
    assert "warning" in {f.level for f in warned}


def test_a_section_that_the_preset_does_not_look_at_is_warned_of() -> None:
    changed = ("motor.ambient_C=40.0", "encoder.index=true")
    titles = [f.title for f in found("paper", *changed) if "not used" in f.text]
    assert titles == ["[motor]", "[encoder]"]
    assert not [f for f in found("paper", *changed, REALISTIC) if "not used" in f.text]


def test_the_worst_level_is_told_to_machines(capsys: pytest.CaptureFixture[str]) -> None:
    for change, worst_level in (
        ("control.k1=2.0", "ok"),
        ("control.torque_limit_wheel_N_m=0.9", "warning"),
    ):
        check_scenario("realtime_100hz", (change, "duration_s=30.0"), as_json=True)
        said = json.loads(capsys.readouterr().out)
        assert (said["sound"], said["worst"]) == (True, worst_level)
        listed = {one["title"]: one for one in said["findings"]}
        spectral = listed["p²/q > max Im(ζ)²/Re(ζ)"]
        assert [spectral[key] for key in ("value", "limit", "basis")] == ["4", "> 0", "(46)"]
        assert all(one["basis"] for one in said["findings"])
        assert all(one["key"] for one in said["findings"] if one["level"] != "ok")


def test_every_line_of_a_table_is_whole_where_nobody_folds_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    weak = "drive.preset='limited'", "drive.current_limit_A=3.0", "duration_s=10.0", "expect=[]"
    check_scenario("two_robots", weak, as_json=False)
    lines = capsys.readouterr().out.splitlines()
    torques = [line for line in lines if "first torques" in line]
    assert len(torques) == 2
    for part in ("warning", "≤ 0.15 N·m at the wheel", "(34) at t = 0", "control.law"):
        assert all(part in line for line in torques)
    assert "to change" in lines[1]


def test_titles_in_brackets_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    unused = "encoder.index=true", "duration_s=5.0", "expect=[]"
    check_scenario("two_robots", unused, as_json=False)
    assert "[encoder]" in capsys.readouterr().out
