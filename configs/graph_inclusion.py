"""The graph of a file in its scenario: `graph.file` is replaced by the edges that the file has."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from configs.edges import LEADER, edge_text
from configs.errors import Problem, ScenarioError

_OTHERS = ("edges", "generator", "adjacency")


def includes_graph(data: Mapping[str, Any]) -> bool:
    """Whether parsed TOML has a `graph.file`; what isn't a text is refused with the other keys."""
    graph = data.get("graph")
    return isinstance(graph, dict) and isinstance(graph.get("file"), str)


def included_graph(data: dict[str, Any], folder: Path) -> Problem | None:
    """Put edges, weights and leader links of `graph.file` into [graph], in place of that key.

    So a scenario that is written again needs no file beside it. Returns what is wrong with it.
    """
    if not includes_graph(data):
        return None
    graph = data["graph"] = dict(data["graph"])
    file = graph.pop("file")
    robots = data.get("robot")
    names = [
        robot["name"]
        for robot in (robots if isinstance(robots, list) else ())
        if isinstance(robot, dict) and isinstance(robot.get("name"), str)
    ]
    from configs.graph_files import read_graph  # its parsers are slow to import

    try:
        weights, links = read_graph(folder / file, names)
    except ScenarioError as error:
        return Problem("graph.file", file, str(error))
    for other in _OTHERS:
        if other in graph:
            graph.pop(other)
            return Problem("graph.file", file, f"give the file or {other}: it is the whole graph")
    graph["edges"] = [edge_text(edge) for edge in weights]
    if links:
        if "leader" in graph:
            remedy = f"the file has edges from {LEADER}; give it those or leader"
            return Problem("graph.leader", graph.pop("leader"), remedy)
        graph["leader"] = list(links)
    weights |= {(LEADER, robot): h for robot, h in links.items()}
    if any(weight != 1.0 for weight in weights.values()):
        if "weights" in graph:
            remedy = "the file has weights; give it those or weights"
            return Problem("graph.weights", graph.pop("weights"), remedy)
        graph["weights"] = {edge_text(edge): a for edge, a in weights.items() if a != 1.0}
    return None
