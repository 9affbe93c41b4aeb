"""One wrong value of a scenario file: one line with file, key and what is right."""

import pytest
from support.scenario_text import SMALL, problems


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
