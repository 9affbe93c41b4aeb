"""Scenario files: what is accepted, what is refused and in which words."""

import json
from importlib import resources
from pathlib import Path

import pytest

from configs.errors import ScenarioError
from configs.loading import json_schema, load, loads, shipped, to_toml

SMALL = """
schema = 1
name = "small"
[[robot]]
name = "r1"
pose = { x_m = 0.0, y_m = 1.0 }
[[robot]]
name = "r2"
pose = { x_m = 0.0, y_m = 2.0 }
"""


def problems(text: str, *overrides: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        loads("file.toml", text, overrides)
    assert caught.value.exit_code == 2
    return str(caught.value).splitlines()


@pytest.mark.parametrize("name", shipped())
def test_every_shipped_scenario_loads_and_survives_being_written_out(name: str) -> None:
    scenario = load(name)
    assert scenario.name == name
    assert loads("again", to_toml(scenario)) == scenario


def test_the_scenarios_that_the_paper_needs_are_shipped() -> None:
    needed = {"paper", "paper_ring", "paper_tree", "paper_star", "paper_extra", "two_robots"}
    assert needed <= set(shipped())


def test_the_paper_scenario_has_the_numbers_of_section_4() -> None:
    paper = load("paper")
    assert [(r.pose.x_m, r.pose.y_m) for r in paper.robot] == [
        (-8.0, 5.0),
        (-7.0, 1.5),
        (-5.5, -1.0),
        (-6.0, -6.0),
    ]
    assert paper.topology.edges == (("r1", "r2"), ("r2", "r3"), ("r3", "r4"))
    assert paper.topology.leader == ("r1",)
    assert paper.leader.speed_m_s == 0.6
    control = paper.control
    assert (control.k1, control.k2, control.k3, control.k4) == (2.0, 3.0, 1.5, 3.0)
    assert (control.gamma_1_s, control.gamma_2_s, control.gamma_3_s) == (0.01, 0.01, 0.01)
    assert (paper.coordination.p, paper.coordination.q) == (2.0, 1.0)
    body = paper.body_of(paper.robot[0])
    assert (body.wheel_radius_m, body.half_track_m, body.com_offset_m) == (0.04, 0.1, 0.02)
    assert (body.body_mass_kg, body.wheel_mass_kg) == (2.3, 0.28)


def test_the_schema_in_the_package_is_the_schema_of_the_types() -> None:
    text = resources.files("configs").joinpath("scenario.schema.json").read_text("utf-8")
    assert json.loads(text) == json_schema(), "run: fleetloop check --schema"


@pytest.mark.parametrize(
    ("override", "key", "right"),
    [
        ("clock.control_period_s=0", "clock.control_period_s", "greater than 0"),
        ("clock.control_period_s=-0.001", "clock.control_period_s", "greater than 0"),
        ("clock.share_period_s=0.0015", "clock.share_period_s", "whole multiple"),
        ("clock.countdown_s=0.0", "clock.countdown_s", "too short to arm"),
        ("robot_types.etsro.body_mass_kg=-1.0", "robot_types.etsro.body_mass_kg", "greater than 0"),
        ("control.law='pid'", "control.law", "adaptive_dsc"),
        ("control.k1='two'", "control.k1", "number"),
        ("control.k9=1.0", "control.k9", "unknown key"),
        ("coordination.pp=1.0", "coordination.pp", "did you mean p?"),
        ("path={kind='helix'}", "path.kind", "figure_eight"),
        ("path={radius_m=1.0}", "path.kind", "must be given"),
        ("graph={generator='snake'}", "graph.generator", "'ring'"),
        ("robot.r1.body.mass=1.0", "robot.r1.body.mass", "body_mass_kg"),
        ("robot_types.tank.mass=1.0", "robot_types.tank.mass", "body_mass_kg"),
        ("path={kind='circle'}", "path.radius_m", "must be given"),
        ("drive.protocol='canopen'", "drive.protocol", "odrive"),
        ("drive.left_node=0", "drive.left_node", "differ from drive.right_node"),
        ("drive.iq_period_s=0.0015", "drive.iq_period_s", "whole milliseconds"),
        ("drive.under_voltage_V=40.0", "drive.under_voltage_V", "below drive.over_voltage_V = 30"),
        ("drive.derate_from_C=130.0", "drive.derate_from_C", "below drive.derate_to_C = 120"),
        ("drive.firmware='0.5.6'", "drive.firmware", "pattern"),
        ("graph={edges=['r1 > r2']}", "graph.edges", "r1 -> r2"),
        ("graph={edges=['r1 -> r9']}", "graph.edges", "known: r1, r2"),
        ("graph={edges=['r1 -> r1']}", "graph.edges", "doesn't hear itself"),
        ("graph={edges=[], leader=['r1','r2']}", "graph.edges", "no root"),
        ("graph={edges=['r2 -> r1'], leader=['r1']}", "graph.leader", "does not reach r2"),
        ("graph={generator='chain', leader=[]}", "graph.leader", "at least one robot"),
        ("robot.r2.name='r1'", "robot.name", "two robots have this name"),
        ("robot.r2.type='tank'", "robot.r2.type", "known: etsro"),
        ("expect=[{signal='s', robots=['r7'], max=1.0}]", "expect.0.robots", "known: r1, r2"),
        ("expect=[{signal='s'}]", "expect.0", "max_abs, min or max"),
        ("schema=2", "schema", "1"),
        ("duration_s='long'", "duration_s", "number"),
        ("network.endpoint='udp/x'", "network.endpoint", "pattern"),
    ],
)
def test_one_wrong_value_gives_one_line_with_file_key_and_what_is_right(
    override: str, key: str, right: str
) -> None:
    (line,) = problems(SMALL, override)
    assert line.startswith(f"file.toml: {key} = "), line
    assert right in line


def test_all_problems_of_a_file_come_at_once() -> None:
    lines = problems(
        SMALL, "control.k1=-1.0", "coordination.pp=1.0", "robot.r2.type='tank'", "duration_s=0"
    )
    text = "\n".join(lines)
    assert len(lines) == 4
    for key in ("control.k1", "coordination.pp", "robot.r2.type", "duration_s"):
        assert f"file.toml: {key} = " in text


def test_an_unknown_scenario_names_those_that_are_shipped() -> None:
    with pytest.raises(ScenarioError, match=r"papr: no such file.*did you mean paper\?"):
        load("papr")


def test_a_file_that_is_no_toml_is_named(tmp_path: Path) -> None:
    file = tmp_path / "broken.toml"
    file.write_text("schema = = 1")
    with pytest.raises(ScenarioError, match=r"broken\.toml: not a TOML file"):
        load(file)


def test_an_override_reaches_robots_by_name_and_keeps_the_rest() -> None:
    scenario = loads("f", SMALL, ("robot.r2.pose.x_m=-6.5", "coordination.p=3"))
    assert scenario.robot[1].pose.x_m == -6.5
    assert scenario.robot[1].pose.y_m == 2.0
    assert scenario.coordination.p == 3.0


@pytest.mark.parametrize("override", ["k1", "=3", "robot.r7.pose.x_m=1", "name.x=1"])
def test_an_override_that_names_nothing_is_refused(override: str) -> None:
    (line,) = problems(SMALL, override)
    assert line.startswith(f"--set {override}: ")


def test_a_scenario_can_not_be_changed_after_loading() -> None:
    scenario = loads("f", SMALL)
    with pytest.raises(ValueError, match="frozen"):
        scenario.duration_s = 5.0


def test_a_robot_may_differ_from_its_type_and_from_the_fleet() -> None:
    text = SMALL + "body = { body_mass_kg = 5.0 }\ncontrol = { k4 = 1.5 }\n"
    scenario = loads("f", text)
    first, second = scenario.robot
    assert scenario.body_of(first).body_mass_kg == 2.3
    assert scenario.body_of(second).body_mass_kg == 5.0
    assert scenario.body_of(second).wheel_mass_kg == 0.28
    assert scenario.control_of(second).k4 == 1.5
    assert scenario.control_of(second).k1 == scenario.control.k1
