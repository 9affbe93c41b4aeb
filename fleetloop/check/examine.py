"""All checks of a scenario in order."""

from configs.errors import ScenarioError
from configs.overrides import Overrides
from configs.resolve import robot_briefs
from configs.scenario import Scenario
from fleetloop.check.bus_load import bus_findings
from fleetloop.check.coordination import Forecast, forecast
from fleetloop.check.course import courses, path_of, refuse_irregular
from fleetloop.check.derivatives import derivative_findings
from fleetloop.check.emulated import emulated_forecast, needs_emulation
from fleetloop.check.finding import Finding, alike, resting_on, worst
from fleetloop.check.geometry import geometry_findings
from fleetloop.check.graph import graph_findings
from fleetloop.check.law import law_findings
from fleetloop.check.membership import membership_findings
from fleetloop.check.network import network_findings
from fleetloop.check.poses import pose_findings
from fleetloop.check.sampling import sampling_findings
from fleetloop.check.start import start_findings
from fleetloop.check.torque import torque_findings
from fleetloop.check.wheels import wheel_findings


def examine(source: str, scenario: Scenario, overrides: Overrides = ()) -> list[Finding]:
    """All that follows from a valid scenario without running it.

    `source` names its file, `overrides` are what options set in it.

    Raises:
        ScenarioError: a robot's path isn't regular.
    """
    ahead = _look_ahead(scenario)
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
            *membership_findings(scenario),
            *network_findings(scenario, ahead),
            *shapes,
            *sampling_findings(scenario, along),
            *pose_findings(scenario, along),
            *geometry_findings(scenario, along, ahead),
            *torque_findings(scenario, along),
            *wheel_findings(scenario, along),
            *start_findings(scenario, ahead),
            *resting_on("Law", law_findings(scenario)),
            *bus_findings(scenario, robot_briefs(scenario)),
            *resting_on("drive.preset", unused(scenario)),
        ]
    )


def _look_ahead(scenario: Scenario) -> Forecast:
    """The path variables of a run, over its network as it is emulated."""
    if not needs_emulation(scenario):
        return forecast(scenario)
    robots = {robot.name: robot for robot in scenario.robot}
    return emulated_forecast(scenario, lambda name: path_of(scenario, robots[name]))


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
