"""Findings as a table: what, robots, value, limit, what it rests on, what to change.

A terminal that is too narrow for the lines folds them, and what to change stands below. Elsewhere
each line is whole.
"""

from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.table import Table

from configs.scenario import Scenario
from fleetloop.check.finding import Finding, named, robots_of
from fleetloop.terminal import ResultConsole

_COLUMNS = ("what", "robots", "value", "limit", "rests on", "to change")
_MARKS = {"ok": "[green]ok[/]", "warning": "[yellow]warning[/]", "error": "[red]error[/]"}


def print_findings(scenario: Scenario, findings: Sequence[Finding]) -> None:
    """Print the findings about a scenario."""
    console = ResultConsole()
    whole = _table(scenario, findings, _COLUMNS)
    if not console.is_terminal:
        console.print_whole(whole)
    elif _fits(console, whole):
        console.print(whole)
    else:
        console.print(_table(scenario, findings, _COLUMNS[:-1]))
        for finding in findings:
            if change := _change(finding):
                robots = named(finding.robots, scenario.names)
                where = f"{finding.title}, {robots}" if robots else finding.title
                said = escape(f"{where}: {change}")
                console.print(_MARKS[finding.level], said, highlight=False)


def _fits(console: Console, table: Table) -> bool:
    options = console.options.update(width=1 << 16)
    return Measurement.get(console, options, table).maximum <= console.width


def _table(scenario: Scenario, findings: Sequence[Finding], columns: Sequence[str]) -> Table:
    """A row for each finding; those that are ok share the row of the first robot."""
    graph = scenario.topology
    table = Table(
        title=f"{scenario.name}: robots {len(graph.robots)}, edges {len(graph.edges)}",
        title_justify="left",
        header_style="dim",
        box=None,
        padding=(0, 1),
    )
    for column in ("", *columns):
        table.add_column(column, overflow="fold")
    by_title: dict[str, list[Finding]] = {}
    for finding in findings:
        by_title.setdefault(finding.title, []).append(finding)
    for group in by_title.values():
        well = [finding for finding in group if finding.level == "ok"]
        rows = [_cells(finding, graph.robots) for finding in group if finding.level != "ok"]
        if well:
            others = named(robots_of(well[1:]), graph.robots)
            rows.insert(0, _cells(well[0], graph.robots, likewise=others))
        for row in rows:
            table.add_row(*row[: 1 + len(columns)])
    return table


def _cells(finding: Finding, everybody: Sequence[str], likewise: str = "") -> tuple[str, ...]:
    robots = named(finding.robots, everybody) + (f", likewise {likewise}" if likewise else "")
    what, value, limit = finding.title, finding.value, finding.limit
    cells = what, robots, value, limit, finding.basis, _change(finding)
    return _MARKS[finding.level], *map(escape, cells)


def _change(finding: Finding) -> str:
    """Key and remedy, in words."""
    key = "" if finding.key in finding.remedy else finding.key
    return ": ".join(part for part in (key, finding.remedy) if part)
