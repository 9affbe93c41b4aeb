"""`fleetloop graph`: print, draw and write the directed graph of a scenario."""

from pathlib import Path

from rich.table import Table

from configs.edges import LEADER, edge_text, presence
from configs.errors import InfrastructureError, ScenarioError
from configs.graph import Graph
from configs.graph_files import to_dot, to_graphml
from configs.loading import load
from configs.overrides import Overrides
from configs.resolve import schedule
from configs.scenario import Scenario
from fleetloop.check.finding import Finding
from fleetloop.check.graph import gain_class, graph_conditions, synchronisation
from fleetloop.terminal import ResultConsole, note, say, say_json

PICTURES = (".svg", ".png", ".pdf")
TEXTS = (".graphml", ".dot", ".gv")
_MOST_COLUMNS = 24
"""Of the adjacency matrix in a table; of a larger fleet, robots are listed with whom they hear."""


def show_graph(source: str, overrides: Overrides, *, out: Path | None, as_json: bool) -> None:
    """Print the graph of a scenario, and write it to a file.

    Raises:
        ScenarioError: the scenario is wrong, or the file's ending names no kind.
        InfrastructureError: the file can't be written.
    """
    if out is not None and out.suffix not in (*TEXTS, *PICTURES):
        raise ScenarioError(f"--out {out}: must end in {', '.join((*TEXTS, *PICTURES))}")
    scenario = load(source, overrides)
    graph, gains = scenario.topology, scenario.coordination
    findings = [
        *graph_conditions(graph),
        synchronisation(graph, gains.p, gains.q),
        gain_class(graph, gains.p, gains.q),
    ]
    if out is not None:
        _write(scenario, out)
    if as_json:
        say_json(_described(graph, findings))
        return
    console = ResultConsole()
    console.print_whole(_table(scenario.name, graph))
    if graph.switches:
        console.print_whole(_times(scenario))
    for finding in findings:
        say(f"{finding.title}: {finding.text}")
    if out is not None:
        note(f"wrote {out}")


def _table(name: str, graph: Graph) -> Table:
    """A row a robot: what it hears, its in-degree, its leader link, whether it is a root."""
    few = len(graph.robots) <= _MOST_COLUMNS
    edges = f"{len(graph.edges)} edge{'s' if len(graph.edges) != 1 else ''}"
    table = Table(title=f"{name}: {len(graph.robots)} robots, {edges}", box=None, padding=(0, 1))
    table.add_column("hears")
    for column in graph.robots if few else ("whom",):
        table.add_column(column, justify="right" if few else "left")
    table.add_column("d_i", justify="right")
    table.add_column("h_i", justify="right")
    table.add_column("root")
    roots = graph.roots()
    for robot in graph.robots:
        heard = {edge.speaker: edge.weight for edge in graph.hears[robot]}
        link = graph.links.get(robot)
        row = [_shown(heard.get(other, 0.0)) for other in graph.robots]
        if not few:
            row = [", ".join(_weighted(speaker, a) for speaker, a in heard.items())]
        row += [_shown(graph.in_degree(robot)), _shown(link.weight if link else 0.0)]
        table.add_row(robot, *row, "yes" if robot in roots else "")
    return table


def _times(scenario: Scenario) -> Table:
    """A row an edge that comes and goes: how much of the run it exists."""
    ticks = schedule(scenario)
    table = Table(title="edges that come and go", box=None, padding=(0, 1))
    table.add_column("edge")
    for column in ("exists", "windows", "longest absence"):
        table.add_column(column, justify="right")
    for edge, windows in scenario.topology.windows.items():
        if windows is None:
            continue
        there, absent = presence(windows, ticks.ticks)
        begun = sum(begin < ticks.ticks for begin, _ in windows)
        row = f"{there:.1%}", str(begun), f"{absent * ticks.period_s:g} s"
        table.add_row(edge_text(edge), *row)
    return table


def _shown(weight: float) -> str:
    return f"{weight:.4g}" if weight else "·"


def _weighted(speaker: str, weight: float) -> str:
    return speaker if weight == 1.0 else f"{speaker} × {weight:.4g}"


def _described(graph: Graph, findings: list[Finding]) -> dict[str, object]:
    """The graph for programs."""
    return {
        "robots": list(graph.robots),
        "adjacency": graph.adjacency().tolist(),
        LEADER: {robot: link.weight for robot, link in graph.links.items()},
        "in_degrees": {robot: graph.in_degree(robot) for robot in graph.robots},
        "roots": list(graph.roots()),
        "windows_ticks": {
            edge_text(edge): [list(window) for window in windows]
            for edge, windows in graph.windows.items()
            if windows is not None
        },
        "findings": [{"title": f.title, "level": f.level, "text": f.text} for f in findings],
    }


def _write(scenario: Scenario, file: Path) -> None:
    graph = scenario.topology
    try:
        if file.suffix == ".graphml":
            file.write_text(to_graphml(graph), "utf-8")
        elif file.suffix in TEXTS:
            file.write_text(to_dot(graph, scenario.name), "utf-8")
        else:
            from fleetloop.results.graph_drawing import drawn

            drawn(graph, f"Directed graph of {scenario.name}").savefig(file)
    except OSError as error:
        raise InfrastructureError(f"can't write {file}: {error.strerror or error}") from error
