"""Scenario files: what is accepted, what is refused and in which words."""

import itertools
import json
import re
import tomllib
from collections.abc import Iterable, Iterator
from importlib import resources
from pathlib import Path

import pytest
from support.scenario_text import SMALL, problems

from configs.errors import ScenarioError
from configs.loading import json_schema, load, loads, shipped, to_toml
from configs.overrides import Override


@pytest.mark.parametrize("name", shipped())
def test_every_shipped_scenario_loads_and_survives_being_written_out(name: str) -> None:
    scenario = load(name)
    assert scenario.name == name
    assert loads("again", to_toml(scenario)) == scenario


def test_the_scenarios_that_the_paper_needs_are_shipped() -> None:
    needed = {"paper", "paper_ring", "paper_tree", "paper_star", "paper_extra", "two_robots"}
    assert needed <= set(shipped())


def test_gains_that_another_law_has_are_to_be_deleted() -> None:
    with pytest.raises(ScenarioError) as refused:
        load("paper", ["control.law='fixed_dsc'"])
    lines = str(refused.value).splitlines()
    assert [line.split(" = ")[0] for line in lines] == [
        f"paper.toml: control.{key}" for key in ("k5", "eta", "rho")
    ]
    for line in lines:
        assert "fixed_dsc doesn't have this key of adaptive_dsc; delete it" in line


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
    control = paper.control.parameters
    assert (control.k1, control.k2, control.k3, control.k4) == (2.0, 3.0, 1.5, 3.0)
    assert (control.gamma_1_s, control.gamma_2_s, control.gamma_3_s) == (0.01, 0.01, 0.01)
    assert (paper.coordination.p, paper.coordination.q) == (2.0, 1.0)
    body = paper.body_of(paper.robot[0])
    assert (body.wheel_radius_m, body.half_track_m, body.com_offset_m) == (0.04, 0.1, 0.02)
    assert (body.body_mass_kg, body.wheel_mass_kg) == (2.3, 0.28)


def test_the_schema_in_the_package_is_the_schema_of_the_types() -> None:
    text = resources.files("configs").joinpath("scenario.schema.json").read_text("utf-8")
    assert json.loads(text) == json_schema(), "run: fleetloop check --schema"


def test_all_problems_of_a_file_come_at_once() -> None:
    lines = problems(
        SMALL,
        "control.k1=-1.0",
        "coordination.pp=1.0",
        "robot.r2.type='tank'",
        "seed=-1",
        "expect=[{signal='speed', max=1.0, from_s=31.0}]",
    )
    text = "\n".join(lines)
    assert len(lines) == 6
    for key in (
        "control.k1",
        "coordination.pp",
        "robot.r2.type",
        "seed",
        "expect.0.signal",
        "expect.0.from_s",
    ):
        assert f"file.toml: {key} = " in text


def test_a_run_may_end_before_its_windows_or_after_its_scenario() -> None:
    late = "expect=[{signal='s', max=1.0, from_s=20.0, to_s=25.0}]"
    short = loads("f", SMALL, (late, "until_s=5.0"))
    assert (short.duration_s, short.ends_at_s) == (30.0, 5.0)
    assert loads("again", to_toml(short)) == short
    assert loads("f", SMALL, (late, "duration_s=2.0", "until_s=26.0")).ends_at_s == 26.0


def test_an_unknown_scenario_names_those_that_are_shipped() -> None:
    with pytest.raises(ScenarioError, match=r"papr: no such file.*did you mean paper\?"):
        load("papr")


def test_a_file_that_is_no_toml_is_named(tmp_path: Path) -> None:
    file = tmp_path / "broken.toml"
    file.write_text("schema = = 1")
    with pytest.raises(ScenarioError, match=r"broken\.toml: not a TOML file"):
        load(file)


MANY = """
schema = 1
name = "Many Wrong"
duration_s = -1.0
[clock]
control_period_s = 0.0
share_period_s = 0.0005
[path]
kind = "circle"
[drive]
left_node = 0
[graph]
edges = ["r1 -> r9", "r1 to r2"]
[[robot]]
name = "r1"
[[robot]]
name = "r2"
pose = { x_m = 0.0, y_m = 2.0 }
type = "tank"
[[expect]]
max_abs = 1.0
[[expect]]
signal = "s"
robots = ["r8"]
"""


def test_all_problems_come_at_once_across_sections_whatever_is_missing() -> None:
    text = "\n".join(problems(MANY))
    for key in (
        "name = ",
        "duration_s = -1.0",
        "clock.control_period_s = 0.0",
        "path.radius_m = (missing)",
        "drive.left_node = 0",
        'graph.edges = "r1 -> r9"',
        'graph.edges = "r1 to r2"',
        "robot.r1.pose = (missing)",
        'robot.r2.type = "tank"',
        "expect.0.signal = (missing)",
        'expect.1.robots = "r8"',
        'expect.1 = "s": give max_abs, min or max',
    ):
        assert f"file.toml: {key}" in text, text
    # What would follow from values put in for wrong ones isn't said.
    assert "share_period_s" not in text
    assert len(text.splitlines()) == 12


def test_robots_that_are_all_wrong_hide_nothing_else() -> None:
    text = SMALL.replace("x_m = 0.0", 'x_m = "a"') + '[graph]\nedges = ["r1 -> r9"]\n'
    lines = problems(text)
    assert [line.split(" = ")[0] for line in lines] == [
        "file.toml: robot.r1.pose.x_m",
        "file.toml: robot.r2.pose.x_m",
        "file.toml: graph.edges",
    ]


def test_what_is_wrong_with_a_bound_or_a_name_is_said_alone_and_hides_nothing() -> None:
    text = SMALL.replace('"small"', '"Not So"').replace('"r2"', '"r1"')
    lines = problems(text, "expect=[{signal='s', max_abs=-1.0}]")
    assert [line.split(" = ")[0] for line in lines] == [
        "file.toml: name",
        "file.toml: expect.0.max_abs",
        "file.toml: robot.name",
    ]


def test_bounds_are_told_to_the_last_digit() -> None:
    (line,) = problems(SMALL, f"seed={2**60}")
    assert line.endswith("must be 9007199254740991 or less")


def test_what_is_no_scenario_is_named_for_what_it_is(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"a folder, not the file of a scenario$"):
        load(tmp_path)
    file = tmp_path / "file.toml"
    file.touch()
    with pytest.raises(ScenarioError, match=f"not the file of a scenario; there is {file}$"):
        load(tmp_path)
    for no_path in (3, None, b"two_robots"):
        with pytest.raises(TypeError, match="the path of a scenario file, or a shipped name"):
            load(no_path)
    file.write_bytes(b"\xff\x00")
    with pytest.raises(ScenarioError, match="no text in UTF-8"):
        load(file)


WRONG = ["x", -1, float("nan"), {"a": 1}]
PYDANTIC = re.compile(r"Input|should|valid |pydantic|type=|validator|of the wrong kind")


def keys_of(data: object, key: str = "") -> Iterator[str]:
    items: Iterable[tuple[object, object]] = ()
    if isinstance(data, dict):
        items = data.items()
    elif isinstance(data, list):
        items = enumerate(data)
    for part, inner in items:
        yield f"{key}{part}"
        yield from keys_of(inner, f"{key}{part}.")


def test_whatever_stands_at_a_key_is_refused_in_our_words() -> None:
    whole = to_toml(load("realistic"))
    keys = [k for k in keys_of(tomllib.loads(whole)) if not re.match(r"robot\.[1-9]", k)]
    refused = 0
    for key, wrong in itertools.product(keys, WRONG):
        try:
            loads("f", whole, (Override("here", key, wrong),))
        except ScenarioError as error:
            refused += 1
            assert not PYDANTIC.search(str(error)), str(error)
    assert refused > 2 * len(keys)


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
    assert scenario.control_of(second).parameters.k4 == 1.5
    assert scenario.control_of(second).parameters.k1 == scenario.control.parameters.k1


def test_graphs_that_switch_too_often_to_be_carried_out_are_refused() -> None:
    random = "graph={edges=['r1 -> r2'], switch=[{random=true, probability=0.5, dwell_s=0.002}]}"
    assert load("two_robots", [random]).topology.switches
    with pytest.raises(ScenarioError, match=r"windows of edges in 3600 s; at most 100000"):
        load("two_robots", [random, "duration_s=3600.0"])
