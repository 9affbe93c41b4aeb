"""Graph files of other programs: there and back, what yEd and Graphviz write, and what is wrong."""

import tomllib
from pathlib import Path

import networkx as nx
import pytest
import tomli_w

from configs.edges import LEADER
from configs.errors import ScenarioError
from configs.graph import Graph, generated
from configs.graph_files import MOST_KIB, read_graph, to_dot, to_graphml
from configs.loading import load, loads, to_toml

FOUR = ("r1", "r2", "r3", "r4")
WEIGHTED = {("r1", "r3"): 0.5, (LEADER, "r3"): 2.0, ("r2", "r4"): 1.0 / 3.0}
GRAPH = Graph.of(FOUR, generated("tree", FOUR), ("r1", "r3"), WEIGHTED)
YED = """<?xml version="1.0" encoding="UTF-8"?>
<graphml xmlns="http://graphml.graphdrawing.org/xmlns" xmlns:y="http://www.yworks.com/xml/graphml">
  <key for="node" id="d6" yfiles.type="nodegraphics"/>
  <key for="edge" id="d10" yfiles.type="edgegraphics"/>
  <graph edgedefault="directed" id="G">
    <node id="n0"><data key="d6"><y:ShapeNode><y:NodeLabel>r1</y:NodeLabel></y:ShapeNode></data>
    </node>
    <node id="n1"><data key="d6"><y:ShapeNode><y:NodeLabel>r2</y:NodeLabel></y:ShapeNode></data>
    </node>
    <edge id="e0" source="n0" target="n1"><data key="d10"><y:PolyLineEdge>
      <y:EdgeLabel>0.5</y:EdgeLabel></y:PolyLineEdge></data></edge>
    <edge id="e1" source="n1" target="n0"><data key="d10"><y:PolyLineEdge/></data></edge>
  </graph>
</graphml>
"""


def written(folder: Path, name: str, text: str) -> Path:
    file = folder / name
    file.write_text(text, "utf-8")
    return file


def test_graphml_carries_edges_weights_and_leader_there_and_back(tmp_path: Path) -> None:
    edges = read_graph(written(tmp_path, "g.graphml", to_graphml(GRAPH)), FOUR)
    weights = {**edges.weights, **{(LEADER, robot): h for robot, h in edges.links.items()}}
    assert Graph.of(FOUR, edges.weights, list(edges.links), weights) == GRAPH


def test_dot_carries_edges_weights_and_leader_there_and_back(tmp_path: Path) -> None:
    edges = read_graph(written(tmp_path, "g.dot", to_dot(GRAPH, "g")), FOUR)
    assert edges.links == {"r1": 1.0, "r3": 2.0}
    assert edges.weights == pytest.approx(
        {("r1", "r2"): 1.0, ("r1", "r3"): 0.5, ("r2", "r4"): 1.0 / 3.0}, rel=1e-5
    )


def test_networkx_reads_the_graphml_with_its_weights(tmp_path: Path) -> None:
    digraph = nx.read_graphml(written(tmp_path, "g.graphml", to_graphml(GRAPH)))
    assert digraph.is_directed()
    assert digraph.edges["r1", "r3"]["weight"] == 0.5
    assert set(digraph.successors(LEADER)) == {"r1", "r3"}


def test_yeds_labels_are_names_and_weights(tmp_path: Path) -> None:
    edges = read_graph(written(tmp_path, "yed.graphml", YED), FOUR)
    assert edges.weights == {("r1", "r2"): 0.5, ("r2", "r1"): 1.0}
    assert edges.links == {}


def test_dot_with_sets_chains_defaults_subgraphs_and_ports_is_read(tmp_path: Path) -> None:
    text = """digraph "a b" { node [shape=circle]; edge [weight=2];
      leader -> r1 [weight=1]; r1 -> {r2; "r3"}; r2:e -> r3 -> "r4":w [label="0.5", weight=0.5];
      subgraph cluster_a { r4 -> r1 } // the way back
    }"""
    edges = read_graph(written(tmp_path, "g.gv", text), FOUR)
    assert edges.links == {"r1": 1.0}
    assert edges.weights == {
        ("r1", "r2"): 2.0,
        ("r1", "r3"): 2.0,
        ("r2", "r3"): 0.5,
        ("r3", "r4"): 0.5,
        ("r4", "r1"): 2.0,
    }


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("g.dot", "graph { r1 -- r2 }"),
        (
            "g.graphml",
            '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
            '<graph edgedefault="undirected"><node id="r1"/><node id="r2"/>'
            '<edge source="r1" target="r2"/></graph></graphml>',
        ),
    ],
)
def test_edges_without_direction_run_both_ways(name: str, text: str, tmp_path: Path) -> None:
    edges = read_graph(written(tmp_path, name, text), FOUR)
    assert edges.weights == {("r1", "r2"): 1.0, ("r2", "r1"): 1.0}


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("g.dot", "digraph { r1 -> ; }", "not a DOT file: Expected .*line:1"),
        ("g.dot", "", "not a DOT file"),
        ("g.dot", "digraph {" + "{" * 2000 + "}" * 2000 + "}", "nested too deeply"),
        ("g.dot", "digraph {} digraph {}", "holds 2 graphs"),
        ("g.dot", "digraph { r1 -> r9 }", "edge r1 -> r9: r9: no such robot; known: r1, r2"),
        ("g.dot", "digraph { r9 }", "node r9: no such robot"),
        ("g.dot", "digraph { r1 -> r1 }", "doesn't hear itself"),
        ("g.dot", "digraph { r1 -> leader }", "the virtual leader hears nobody"),
        ("g.dot", "digraph { r1 -> r2; r1 -> r2 }", "edge r1 -> r2: is there twice"),
        ("g.dot", "digraph { r1 -> r2 [weight=-1] }", "weight = '-1': must be a number from 0.001"),
        ("g.dot", "digraph { r1 -> r2 [weight=nan] }", "weight = 'nan'"),
        ("g.dot", 'digraph { r1 -> r2 [label="fast"] }', "weight = 'fast'"),
        ("g.graphml", "<graphml", "not a GraphML file: .* line 1"),
        ("g.graphml", "<html/>", "not a graph in GraphML"),
        ("g.graphml", '<!DOCTYPE x [<!ENTITY a "b">]><graphml/>', "entities"),
        ("g.graphml", YED.replace(">r2<", ">r1<"), "two nodes have this label"),
        ("g.txt", "r1 r2", "must be a file .graphml, .dot"),
    ],
)
def test_what_is_wrong_with_a_file_is_named(
    name: str, text: str, why: str, tmp_path: Path, capsys
) -> None:
    file = written(tmp_path, name, text)
    with pytest.raises(ScenarioError, match=why) as refused:
        read_graph(file, FOUR)
    assert str(refused.value).startswith(f"{file}: ")
    assert capsys.readouterr().out == ""  # parsers print nothing


def test_files_are_read_up_to_a_size(tmp_path: Path) -> None:
    huge = written(tmp_path, "g.dot", "digraph {" + " " * (MOST_KIB[".dot"] << 10) + "}")
    with pytest.raises(ScenarioError, match="larger than 128 KiB"):
        read_graph(huge, FOUR)
    with pytest.raises(ScenarioError, match="no such user"):
        read_graph(Path("~nobody_of_this_name/g.dot"), FOUR)
    with pytest.raises(ScenarioError, match="can't be read: No such file"):
        read_graph(tmp_path / "none.dot", FOUR)


def test_a_scenario_takes_its_graph_from_a_file_beside_it(tmp_path: Path) -> None:
    written(tmp_path, "my.graphml", to_graphml(GRAPH))
    data = tomllib.loads(to_toml(load("paper", ["expect=[]"])))
    data["graph"] = {"file": "my.graphml"}
    loaded = load(written(tmp_path, "mine.toml", tomli_w.dumps(data)))
    assert loaded.topology == GRAPH
    assert loads("again", to_toml(loaded)).topology == GRAPH  # without the file


@pytest.mark.parametrize(
    ("graph", "why"),
    [
        ("file='my.graphml', generator='ring'", "give the file or generator"),
        ("file='my.graphml', leader=['r1']", "give it those or leader"),
        ("file='my.graphml', weights='normalised'", "give it those or weights"),
        ("file='none.dot'", "none.dot: can't be read"),
        ("file=3", "must be a text, the path of a file"),
    ],
)
def test_a_scenario_says_what_is_wrong_with_its_graph_file(
    graph: str, why: str, tmp_path: Path
) -> None:
    written(tmp_path, "my.graphml", to_graphml(GRAPH))
    text = to_toml(load("paper", ["expect=[]"]))
    with pytest.raises(ScenarioError, match=why) as refused:
        loads("f", text, [f"graph={{{graph}}}"], folder=str(tmp_path))
    assert str(refused.value).startswith("--set graph=")
