"""`fleetloop check`: what can be said of a scenario before it runs."""

import json
from dataclasses import asdict

from rich.console import Console
from rich.table import Table

from configs.briefing import robot_briefs
from configs.loading import json_schema, load, shipped
from configs.stability import findings
from fleetloop.bus_load import bus_findings
from fleetloop.summary import check_expectations
from fleetloop.terminal import say

FINE, UNSOUND = 0, 1
_MARKS = {"ok": "[green]ok[/]", "warning": "[yellow]warning[/]", "error": "[red]error[/]"}


def check_scenario(source: str, overrides: tuple[str, ...], *, as_json: bool) -> int:
    """Check a scenario, print the findings; exit status 1 if one of them is an error.

    Raises:
        ScenarioError: the file itself is wrong.
    """
    scenario = load(source, overrides)
    check_expectations(scenario.expect)
    found = [*findings(scenario), *bus_findings(scenario, robot_briefs(scenario))]
    unsound = any(finding.level == "error" for finding in found)
    if as_json:
        say(json.dumps({"sound": not unsound, "findings": [asdict(f) for f in found]}, indent=2))
        return UNSOUND if unsound else FINE
    graph = scenario.topology
    table = Table(
        title=f"{scenario.name}: {len(graph.robots)} robots, {len(graph.edges)} edges",
        show_header=False,
        box=None,
        padding=(0, 1),
    )
    for finding in found:
        table.add_row(_MARKS[finding.level], finding.title, finding.text)
    Console().print(table)
    say("would not work as it is" if unsound else "sound")
    return UNSOUND if unsound else FINE


def list_scenarios() -> None:
    """Print the shipped scenarios."""
    table = Table(box=None, show_header=False, padding=(0, 1))
    for name in shipped():
        table.add_row(name, load(name).description)
    say("Shipped scenarios, for `fleetloop run NAME` and `fleetloop check NAME`:")
    Console().print(table)


def print_schema() -> None:
    """Print the JSON Schema of scenario files."""
    say(json.dumps(json_schema(), indent=2))
