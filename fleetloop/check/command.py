"""`fleetloop check`: findings about a scenario before it runs."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.table import Table

from configs.deployment import Deployment, load_deployment
from configs.errors import ExitStatus, ScenarioError
from configs.loading import json_schema, load, shipped
from configs.overrides import Overrides
from configs.roles import AGENT
from configs.scenario import Scenario
from fleetloop.check.examine import examine
from fleetloop.check.finding import Finding, resting_on, worst
from fleetloop.check.rehearsal import rehearse
from fleetloop.check.table import print_findings
from fleetloop.results.outcome import problems_of
from fleetloop.terminal import ResultConsole, say, say_json

_VERDICTS = {
    "ok": "sound",
    "warning": "no error; mind the warnings",
    "error": "would not work as it is",
}


def check_scenario(
    source: str, overrides: Overrides, *, deployment: Path | None = None, as_json: bool
) -> int:
    """Check a scenario, print the findings; exit status 1 if a necessary condition fails.

    With `as_json`, errors in the file itself are JSON as well; the exit status is then 2.

    Raises:
        ScenarioError: the file itself is wrong, or its deployment.
    """
    try:
        scenario, found = _find(source, overrides, deployment)
    except ScenarioError as error:
        if not as_json:
            raise
        _say_json(problems=problems_of(error))
        return ExitStatus.USAGE
    unsound = any(finding.level == "error" for finding in found)
    if as_json:
        _say_json(findings=found)
        return ExitStatus.FAILED if unsound else ExitStatus.OK
    print_findings(scenario, found)
    say(_VERDICTS[worst(found)])
    return ExitStatus.FAILED if unsound else ExitStatus.OK


def _find(
    source: str, overrides: Overrides, deployment: Path | None
) -> tuple[Scenario, list[Finding]]:
    scenario = load(source, overrides)
    found = examine(source, scenario, overrides)
    if worst(found) != "error":
        found += resting_on("the run itself", rehearse(scenario))
    if deployment is not None:
        placed = place_findings(scenario, load_deployment(deployment, scenario))
        found += resting_on("the deployment", placed)
    return scenario, found


def _say_json(
    *, findings: Sequence[Finding] = (), problems: Sequence[dict[str, object]] = ()
) -> None:
    sound = not problems and all(finding.level != "error" for finding in findings)
    listed = [asdict(finding) for finding in findings]
    whole = {
        "sound": sound,
        "worst": "error" if problems else worst(findings),
        "problems": list(problems),
        "findings": listed,
    }
    say_json(whole)


def place_findings(scenario: Scenario, deployment: Deployment) -> list[Finding]:
    """Where each robot's controller, bus and drives are."""
    found = []
    for robot in scenario.names:
        bus = dict(deployment.bus_of(robot))
        drives = "emulated" if deployment.emulates(robot) else "REAL"
        where = "here" if deployment.runs_here(AGENT.process(robot)) else "elsewhere"
        text = f"controller {where}, {drives} drives on {bus['interface']} {bus['channel']}"
        found.append(Finding("ok", "place", text, (robot,)))
    return found


def list_scenarios(*, as_json: bool) -> None:
    """Print the shipped scenarios."""
    if as_json:
        each = [{"name": name, "description": load(name).description} for name in shipped()]
        say_json({"shipped": each})
        return
    table = Table(box=None, show_header=False, padding=(0, 1))
    for name in shipped():
        table.add_row(name, load(name).description)
    say("Shipped scenarios, for `fleetloop run NAME` and `fleetloop check NAME`:")
    ResultConsole().print(table)


def print_schema() -> None:
    """Print the JSON Schema of scenario files."""
    say_json(json_schema())
