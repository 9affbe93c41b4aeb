"""`fleetloop graph`: what it prints and the files it writes."""

import json
from pathlib import Path

import pytest

from configs.errors import InfrastructureError, ScenarioError
from configs.graph import Graph, generated
from configs.graph_files import read_graph
from configs.loading import load
from fleetloop.graph.command import show_graph
from fleetloop.results.graph_drawing import drawn

WEIGHTS = ("graph.weights={'r1 -> r2'=0.5, 'leader -> r1'=2.0}",)


def test_adjacency_degrees_links_roots_and_both_sides_are_printed(capsys) -> None:
    show_graph("paper_extra", WEIGHTS, out=None, as_json=False)
    text = capsys.readouterr().out
    row = next(line for line in text.splitlines() if line.split()[:1] == ["r2"])
    assert row.split() == ["r2", "0.5", "·", "·", "1", "1.5", "·"]
    assert "r1 · · · · · 2 yes" in " ".join(text.split())
    assert "p²/q > max Im(ζ)²/Re(ζ): 4 > " in text
    assert "r1 reaches all others" in text


def test_a_large_fleet_is_listed_with_whom_each_hears(capsys) -> None:
    robots = [f"{{name='r{n}', pose={{x_m=0.0, y_m={n}.0}}}}" for n in range(1, 31)]
    fleet = (f"robot=[{', '.join(robots)}]", "graph={generator='tree'}", "expect=[]")
    show_graph("two_robots", fleet, out=None, as_json=False)
    lines = capsys.readouterr().out.splitlines()
    assert next(line for line in lines if " r30 " in line).split() == ["r30", "r15", "1", "·"]


def test_json_has_the_matrix_and_the_findings(capsys) -> None:
    show_graph("paper", WEIGHTS, out=None, as_json=True)
    said = json.loads(capsys.readouterr().out)
    assert said["adjacency"] == [[0, 0, 0, 0], [0.5, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]
    assert said["leader"] == {"r1": 2.0}
    assert said["roots"] == ["r1"]
    assert {finding["level"] for finding in said["findings"]} == {"ok"}


def test_edges_that_come_and_go_are_listed_with_how_long_they_exist(capsys) -> None:
    show_graph("switching", (), out=None, as_json=False)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["r2", "->", "r3", "33.3%", "80", "1", "s"] in lines
    show_graph("switching", (), out=None, as_json=True)
    windows = json.loads(capsys.readouterr().out)["windows_ticks"]
    assert windows["r2 -> r3"][:2] == [[50, 100], [200, 250]]


@pytest.mark.parametrize("ending", ["graphml", "dot"])
def test_a_written_graph_is_read_back(ending: str, tmp_path: Path) -> None:
    file = tmp_path / f"g.{ending}"
    show_graph("paper_extra", WEIGHTS, out=file, as_json=False)
    graph = load("paper_extra", WEIGHTS).topology
    edges = read_graph(file, graph.robots)
    assert edges.weights == {
        (edge.speaker, robot): edge.weight for robot in graph.robots for edge in graph.hears[robot]
    }
    assert edges.links == {"r1": 2.0}


@pytest.mark.parametrize(("ending", "magic"), [("svg", b"<?xml"), ("png", b"\x89PNG")])
def test_pictures_are_drawn(ending: str, magic: bytes, tmp_path: Path) -> None:
    file = tmp_path / f"g.{ending}"
    show_graph("twelve", (), out=file, as_json=False)
    assert file.read_bytes().startswith(magic)


def test_files_that_cannot_be_written_are_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"must end in \.graphml"):
        show_graph("paper", (), out=tmp_path / "g.xls", as_json=False)
    with pytest.raises(InfrastructureError, match="No such file"):
        show_graph("paper", (), out=tmp_path / "none" / "g.dot", as_json=False)


def test_weights_that_are_not_one_stand_on_their_arrows() -> None:
    robots = ("r1", "r2", "r3")
    edges = generated("complete", robots)
    graph = Graph.of(robots, edges, ("r1",), {("r1", "r2"): 0.25, ("leader", "r1"): 3.0})
    texts = {text.get_text() for text in drawn(graph, "g").axes[0].texts}
    assert {"leader", *robots, "0.25", "3"} <= texts
    assert "1" not in texts
