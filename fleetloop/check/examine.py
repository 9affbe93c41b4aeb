"""All checks of a scenario in order."""

from configs.errors import ScenarioError
from configs.overrides import Overrides
from configs.resolve import robot_briefs
from configs.scenario import Scenario
from fleetloop.check.bus_load import bus_findings
from fleetloop.check.coordination import forecast
from fleetloop.check.course import courses, refuse_irregular
from fleetloop.check.derivatives import derivative_findings
from fleetloop.check.finding import Finding, alike, worst
from fleetloop.check.graph import graph_findings
from fleetloop.check.law import law_findings
from fleetloop.check.sampling import sampling_findings
from fleetloop.check.start import start_findings
from fleetloop.check.torque import torque_findings


def examine(source: str, scenario: Scenario, overrides: Overrides = ()) -> list[Finding]:
    """All that follows from a valid scenario without running it.

    `source` names its file, `overrides` are what options set in it.

    Raises:
        ScenarioError: a robot's path isn't regular.
    """
    ahead = forecast(scenario)
    shapes = list(derivative_findings(scenario, ahead))
    try:
        refuse_irregular(source, scenario, ahead, overrides)
    except ScenarioError:
        if worst(shapes) == "error":  # by derivatives that are wrong
            return shapes
        raise
    along = courses(scenario, ahead)
    return alike(
        [
            *graph_findings(scenario, ahead),
            *shapes,
            *sampling_findings(scenario, along),
            *torque_findings(scenario, along),
            *start_findings(scenario, ahead),
            *law_findings(scenario),
            *bus_findings(scenario, robot_briefs(scenario)),
            *unused(scenario),
        ]
    )


def unused(scenario: Scenario) -> list[Finding]:
    """Sections that say something and aren't looked at."""
    preset = scenario.drive.preset
    if preset == "realistic":
        return []
    sections = {"motor": scenario.motor, "encoder": scenario.encoder, "supply": scenario.supply}
    return [
        Finding("warning", f"[{name}]", f'not used: drive.preset is "{preset}", not "realistic"')
        for name, section in sections.items()
        if section != type(section)()
    ]
