"""`fleetloop check`: what can be said of a scenario before it runs."""

import json
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.table import Table

from configs.briefing import robot_briefs
from configs.deployment import Deployment, agent_role, load_deployment
from configs.loading import json_schema, load, shipped
from configs.scenario import Scenario
from configs.stability import Finding, findings
from fleetloop.bus_load import bus_findings
from fleetloop.summary import check_expectations
from fleetloop.terminal import say

FINE, UNSOUND = 0, 1
_MARKS = {"ok": "[green]ok[/]", "warning": "[yellow]warning[/]", "error": "[red]error[/]"}


def check_scenario(
    source: str, overrides: tuple[str, ...], *, deployment: Path | None = None, as_json: bool
) -> int:
    """Check a scenario, print the findings; exit status 1 if one of them is an error.

    Raises:
        ScenarioError: the file itself is wrong, or its deployment.
    """
    scenario = load(source, overrides)
    check_expectations(scenario.expect)
    found = [*findings(scenario), *bus_findings(scenario, robot_briefs(scenario))]
    if deployment is not None:
        found += place_findings(scenario, load_deployment(deployment, scenario))
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


def place_findings(scenario: Scenario, deployment: Deployment) -> list[Finding]:
    """Where each robot's controller, bus and drives are."""
    found = []
    for robot in scenario.names:
        bus = dict(deployment.bus_of(robot))
        drives = "emulated" if deployment.emulates(robot) else "REAL"
        where = "here" if deployment.runs_here(agent_role(robot)) else "elsewhere"
        text = f"controller {where}, {drives} drives on {bus['interface']} {bus['channel']}"
        found.append(Finding("ok", f"{robot}: place", text))
    return found


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
