"""Scenario files: what is accepted, what is refused and in which words."""

import itertools
import json
import re
import tomllib
from collections.abc import Iterable, Iterator
from importlib import resources
from pathlib import Path

import pytest
from support.scenario_text import SMALL, changed

from configs.errors import ScenarioError
from configs.loading import json_schema, load, loads, shipped, to_toml
from configs.overrides import Override


def problems(text: str, *changes: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        loads("file.toml", changed(text, *changes))
    assert caught.value.exit_status == 2
    return str(caught.value).splitlines()


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


@pytest.mark.parametrize(
    ("override", "key", "right"),
    [
        ("clock.control_period_s=0", "clock.control_period_s", "greater than 0"),
        ("clock.control_period_s=-0.001", "clock.control_period_s", "greater than 0"),
        ("clock.share_period_s=0.0015", "clock.share_period_s", "whole multiple"),
        ("clock.share_period_s=3.0", "clock.share_period_s", "not be above coordination.silence"),
        (
            "path={kind='spline', closed=true, points_m=[[0.0,0.0],[1.0,0.0],[1.0,1.0],[0.0,0.0]]}",
            "path.points_m",
            "leave the last one out",
        ),
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
        ("drive.encoder_period_s=0.0005", "drive.encoder_period_s", "whole milliseconds"),
        (
            "drive.encoder_period_s=0.002",
            "drive.encoder_period_s",
            "at most clock.control_period_s",
        ),
        ("drive.under_voltage_V=40.0", "drive.under_voltage_V", "below drive.over_voltage_V = 30"),
        ("drive.derate_from_C=130.0", "drive.derate_from_C", "below drive.derate_to_C = 120"),
        ("drive.firmware='0.5.6'", "drive.firmware", "0.6.10"),
        ("graph={edges=['r1 > r2']}", "graph.edges", "r1 -> r2"),
        ("graph={edges=['r1 -> r9']}", "graph.edges", "known: r1, r2"),
        ("graph={edges=['r1 -> r1']}", "graph.edges", "doesn't hear itself"),
        ("graph={edges=[], leader=['r1','r2']}", "graph.edges", "no root"),
        ("graph={edges=['r2 -> r1'], leader=['r1']}", "graph.leader", "does not reach r2"),
        ("graph={generator='chain', leader=[]}", "graph.leader", "at least one robot"),
        ("graph={weights='heavy'}", "graph.weights", "unit"),
        ("graph={weights={'r1 -> r2'=0.0}}", "graph.weights.r1 -> r2", "0.001 or more"),
        ("graph={weights={'r2 -> r1'=0.5}}", "graph.weights.r2 -> r1", "but r1 -> r2"),
        ("graph={weights={'leader -> r2'=0.5}}", "graph.weights.leader -> r2", "leader -> r1"),
        ("graph={weights={'r1'=0.5}}", "graph.weights.r1", "must read"),
        ("graph={adjacency=[[0,0]]}", "graph.adjacency", "1 rows of 2; must be 2 × 2"),
        ("graph={adjacency=[[0,0],[1,2]]}", "graph.adjacency.1.1", "r2 doesn't hear itself"),
        ("graph={adjacency=[[0,0],[1e-9,0]]}", "graph.adjacency.1.0", "must be 0, or 0.001 to"),
        ("graph={adjacency=[[0,0],[-1,0]]}", "graph.adjacency.1.0", "0 or more"),
        ("graph={adjacency=[[0,1],[0,0]]}", "graph.leader", "looks transposed: row i holds"),
        ("graph={adjacency=[[0,0],[0,0]], leader=['r1','r2']}", "graph.edges", "no root"),
        ("graph={adjacency=[[0,0],[1,0]], edges=[]}", "graph.adjacency", "give one of"),
        (
            "graph={adjacency=[[0,0],[1,0]], weights={'r1 -> r2'=0.5}}",
            "graph.weights",
            "entries of adjacency are the weights",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{}]}",
            "graph.switch.0",
            "give one of edges, generator, rotate, random",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{edges=[], generator='ring'}]}",
            "graph.switch.0",
            "give one of",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{rotate=[['r1 -> r2']]}]}",
            "graph.switch.0.dwell_s",
            "must be given with rotate",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{edges=[], dwell_s=1.0}]}",
            "graph.switch.0.dwell_s",
            "goes with rotate or random",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{random=true, dwell_s=1.0}]}",
            "graph.switch.0.random",
            "give probability or pool",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{edges=[], probability=0.5}]}",
            "graph.switch.0.probability",
            "goes with random = true",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{edges=['r1 -> r9']}]}",
            "graph.switch.0.edges",
            "known: r1, r2",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{rotate=[['r1'], []], dwell_s=1.0}]}",
            "graph.switch.0.rotate.0",
            "must read",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{edges=['r2 -> leader']}]}",
            "graph.switch.0.edges",
            "leader: no such robot",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{edges=['leader -> r1'], leader=['r1']}]}",
            "graph.switch.0.leader",
            "give it those or leader",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{edges=[], leader=['r7']}]}",
            "graph.switch.0.leader",
            "known: r1, r2",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{at_s=0.0015, edges=[]}]}",
            "graph.switch.0.at_s",
            "whole multiple",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{rotate=[[]], dwell_s=0.0005}]}",
            "graph.switch.0.dwell_s",
            "whole multiple",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{at_s=30.0, edges=[]}]}",
            "graph.switch.0.at_s",
            "below duration_s = 30",
        ),
        (
            "graph={edges=['r1 -> r2'], switch=[{at_s=2.0, edges=[]}, {at_s=2.0, edges=[]}]}",
            "graph.switch",
            "at_s must increase",
        ),
        (
            "graph={edges=[], leader=['r1', 'r2'], switch=[{at_s=1.0, edges=[], leader=['r1']}]}",
            "graph.edges",
            "whatever exists of it when",
        ),
        ("robot.r2.name='leader'", "robot.name", "virtual leader"),
        ("robot.r2.name='r1'", "robot.name", "two robots have this name"),
        ("robot.r2.type='tank'", "robot.r2.type", "known: etsro"),
        ("expect=[{signal='s', robots=['r7'], max=1.0}]", "expect.0.robots", "known: r1, r2"),
        ("expect=[{signal='s'}]", "expect.0", "max_abs, min or max"),
        ("expect=[{signal='x_error', max=1.0}]", "expect.0.signal", "did you mean x_e_m?"),
        ("expect=[{signal='speed', max=1.0}]", "expect.0.signal", "s_spread"),
        ("expect=[{signal='s', min=2.0, max=1.0}]", "expect.0.min", "at most max = 1"),
        ("expect=[{signal='s', min=2.0, max_abs=1.0}]", "expect.0.min", "at most max_abs = 1"),
        ("expect=[{signal='s', max=-2.0, max_abs=1.0}]", "expect.0.max", "at least -max_abs = -1"),
        ("expect=[{signal='s', max=1.0, from_s=30.0}]", "expect.0.from_s", "duration_s = 30"),
        ("expect=[{signal='s', max=1.0, to_s=30.5}]", "expect.0.to_s", "leave it out"),
        ("expect=[{signal='s', max=1.0, from_s=3.0, to_s=2.0}]", "expect.0.from_s", "to_s = 2"),
        (
            "expect=[{signal='s', max=1.0, from_s=3.0001, to_s=3.0009}]",
            "expect.0.from_s",
            "no tick",
        ),
        ("until_s=0.0005", "until_s", "whole multiple"),
        ("schema=2", "schema", "1"),
        ("duration_s='long'", "duration_s", "number"),
        ("network.endpoint='udp/x'", "network.endpoint", "tcp/HOST:PORT"),
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
    with pytest.raises(ScenarioError, match="can't be read: Is a directory"):
        load(tmp_path)
    file = tmp_path / "file.toml"
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
