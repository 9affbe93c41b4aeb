"""Section [network]: the effects that each edge has, and entries that can't have any."""

import os
from pathlib import Path

import pytest

from configs.emulated_edges import EmulatedEdge, effects_of
from configs.errors import ScenarioError
from configs.loading import json_schema, load, loads, to_toml
from configs.netem import BernoulliLoss, ConstantDelay, TraceDelay
from configs.resolve import channels
from configs.scenario import Scenario

HALF = 'loss = { kind = "bernoulli", probability = 0.5 }'
EDGES = f"""
[network.default]
delay = {{ kind = "constant", delay_s = 0.1 }}
[[network.edge]]
edges = ["* -> r3", "leader -> *"]
{HALF}
[[network.edge]]
edges = ["r2 -> r3"]
delay = {{ kind = "constant", delay_s = 0.2 }}
"""


def paper(network: str, folder: str = "") -> Scenario:
    text = (Path(__file__).parents[2] / "configs" / "paper.toml").read_text("utf-8")
    return loads("paper.toml", text + network, folder=folder)


def constant(delay_s: float) -> ConstantDelay:
    return ConstantDelay(kind="constant", delay_s=delay_s)


def test_an_edge_has_of_each_effect_the_last_that_names_it() -> None:
    network = paper(EDGES).network
    lossy = BernoulliLoss(kind="bernoulli", probability=0.5)
    known = {
        ("r1", "r2"): (constant(0.1), None),
        ("r2", "r3"): (constant(0.2), lossy),
        ("leader", "r1"): (None, lossy),
    }
    for edge, expected in known.items():
        effects = effects_of(network, EmulatedEdge(*edge))
        assert (effects.delay, effects.loss) == expected


def test_a_robot_has_channels_from_what_it_hears_where_there_are_effects() -> None:
    scenario = paper(EDGES)
    assert [model.source for model in channels(scenario, "r1")] == ["leader"]
    assert [model.source for model in channels(scenario, "r3")] == ["r2"]
    assert channels(load("paper"), "r3") == ()
    seeds = [model.seed for name in scenario.names for model in channels(scenario, name)]
    assert len(set(seeds)) == len(seeds) == 4


def test_ages_are_recorded_of_neighbours_and_of_other_sources_whose_edges_have_effects() -> None:
    scenario = paper(EDGES)
    assert [scenario.aged(robot) for robot in ("r1", "r3")] == [("leader",), ("r2",)]
    places = paper(f'[[network.edge]]\nedges = ["localisation -> r3"]\n{HALF}\n')
    assert [places.aged(robot) for robot in ("r2", "r3")] == [("r1",), ("r2", "localisation")]
    assert load("paper").aged("r3") == ()


@pytest.mark.parametrize(
    ("edge", "remedy"),
    [
        ("r2 -> r1", "no such edge in the graph; r1 hears leader, localisation"),
        ("leader -> r2", "no such edge in the graph; r2 hears r1, localisation"),
        ("r4 -> *", "no such edge in the graph: it has r1 -> r2, r2 -> r3, r3 -> r4, leader -> r1"),
        ("r1 - r2", 'must read "r1 -> r2"'),
        ("r1 -> r9", "r9: must be one of r1, r2, r3, r4, *"),
        ("localisation -> leader", "leader: must be one of r1, r2, r3, r4, *"),
    ],
)
def test_an_entry_that_names_no_edge_is_refused(edge: str, remedy: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        paper(f'[[network.edge]]\nedges = ["{edge}"]\n{HALF}\n')
    assert f'network.edge.0.edges = "{edge}": {remedy}' in str(refused.value)


def test_a_trace_is_read_from_a_file_beside_the_scenario_and_written_out(tmp_path: Path) -> None:
    (tmp_path / "radio.txt").write_text("0.01\nlost  # a gap\n\n0.5\n")
    scenario = paper(
        '[network.default]\ndelay = { kind = "trace", delays_s = "radio.txt" }\n', str(tmp_path)
    )
    delay = scenario.network.default.delay
    assert delay == TraceDelay(kind="trace", delays_s=(0.01, -1.0, 0.5))
    assert loads("again", to_toml(scenario)) == scenario


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.1\nsoon\n", "radio.txt, line 2: 'soon' must be a delay of 0 to 60 s, or lost"),
        ("-0.1\n", "radio.txt, line 1: '-0.1' must be a delay of 0 to 60 s, or lost"),
        ("inf\n", "radio.txt, line 1: 'inf' must be a delay of 0 to 60 s, or lost"),
        ("# nothing\n", "radio.txt: has 0 delays: must be from 1 to 100000"),
        ("0\n" * 100_001, "radio.txt: has 100001 delays: must be from 1 to 100000"),
        ("0" * (1 << 22) + "\n", "radio.txt: larger than 4096 KiB"),
        ("\udcff", "no text in UTF-8"),
        (None, "can't be read: No such file or directory"),
    ],
)
def test_a_trace_that_can_not_be_used_is_refused_with_its_line(
    text: str | None, said: str, tmp_path: Path
) -> None:
    if text is not None:
        (tmp_path / "radio.txt").write_bytes(text.encode("utf-8", "surrogateescape"))
    network = '[network.default]\ndelay = { kind = "trace", delays_s = "radio.txt" }\n'
    with pytest.raises(ScenarioError) as refused:
        paper(network, str(tmp_path))
    assert "network.default.delay.delays_s" in str(refused.value)
    assert said in str(refused.value)


@pytest.mark.timeout(10)
@pytest.mark.parametrize("endless", ["/dev/zero", "pipe"])
def test_a_pipe_or_device_is_no_trace(endless: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    trace = f'delay = {{ kind = "trace", delays_s = "{endless}" }}'
    with pytest.raises(ScenarioError, match="must be a regular file, not a pipe or a device"):
        paper(f"[network.default]\n{trace}\n", str(tmp_path))


def test_a_trace_may_begin_with_a_mark_of_byte_order(tmp_path: Path) -> None:
    (tmp_path / "radio.txt").write_text("0.01\r\n", "utf-8-sig")
    network = '[network.default]\ndelay = { kind = "trace", delays_s = "radio.txt" }\n'
    assert paper(network, str(tmp_path)).network.default.delay == TraceDelay(
        kind="trace", delays_s=(0.01,)
    )


def test_of_negative_delays_only_the_mark_of_a_loss_is_one() -> None:
    with pytest.raises(ScenarioError) as refused:
        paper('[network.default]\ndelay = { kind = "trace", delays_s = [0.1, -0.5] }\n')
    assert "delays_s.1 = -0.5: must be a delay of 0 to 60 s, or -1: lost" in str(refused.value)


@pytest.mark.parametrize(
    ("effect", "remedy"),
    [
        ("bandwidth_bit_s = 1e-310", "must be 1 or more"),
        ('delay = { kind = "lognormal", mean_s = 1e-300, std_s = 60.0 }', "must be 1e-09 or more"),
    ],
)
def test_numbers_that_no_arithmetic_bears_are_refused(effect: str, remedy: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        paper(f"[network.default]\n{effect}\n")
    assert remedy in str(refused.value)


def test_the_schema_knows_arrays_and_files_of_a_trace() -> None:
    delays = json_schema()["$defs"]["TraceDelay"]["properties"]["delays_s"]
    assert {choice["type"] for choice in delays["anyOf"]} == {"array", "string"}


def test_no_robot_has_the_name_of_the_localisation_system() -> None:
    text = (Path(__file__).parents[2] / "configs" / "two_robots.toml").read_text("utf-8")
    with pytest.raises(ScenarioError) as refused:
        loads("here", text.replace("r1", "localisation"))
    assert str(refused.value) == (
        'here: robot.name = "localisation": edges have the localisation system by this name;'
        " give the robot another"
    )


@pytest.mark.parametrize(
    ("effect", "said"),
    [
        ("partitions = [{ from_s = 3.0, to_s = 2.0 }]", "partitions.0.to_s = 2.0: must be above"),
        (
            'delay = { kind = "uniform", min_s = 0.2, max_s = 0.1 }',
            "delay.max_s = 0.1: must not be",
        ),
    ],
)
def test_bounds_out_of_order_are_named_at_their_keys(effect: str, said: str) -> None:
    with pytest.raises(ScenarioError, match=said):
        paper(f"[network.default]\n{effect}\n")


@pytest.mark.parametrize("edge", ["leader -> *", "leader->r1", " localisation -> r1"])
def test_what_has_no_place_has_no_distance(edge: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        paper(f'[[network.edge]]\nedges = ["{edge}"]\ndistance = {{ range_m = 2.0 }}\n')
    assert "network.edge.0.distance" in str(refused.value)
    assert "only between robots" in str(refused.value)
