"""Scenario → what 3-D views of its record draw besides its rows."""

from itertools import pairwise

from configs.brief import Drawing, DrawnRobot, Wheels
from configs.curves import formation_offset, reference_path
from configs.leader_speed import SpeedChange, corners, speed_at
from configs.resolve import leader_brief
from configs.scenario import Scenario
from fleetloop.results.palette import robot_style


def drawing(scenario: Scenario) -> Drawing:
    """Robots in the colours of pages and figures, their paths as far as the leader goes, edges."""
    ahead_m = way_m(leader_brief(scenario).speed_changes, scenario.ends_at_s)
    starts = [robot.s_0 for robot in scenario.robot]
    span = min(starts) + min(ahead_m, 0.0), max(starts) + max(ahead_m, 0.0)
    path = reference_path(scenario.path)
    robots = []
    for number, robot in enumerate(scenario.robot):
        body = scenario.body_of(robot)
        wheels = Wheels(body.wheel_radius_m, body.half_track_m)
        colour = robot_style(number).colour
        robots.append(DrawnRobot(colour, wheels, (path, formation_offset(robot.offset)), span))
    edges = tuple(
        (edge.speaker, hearer, edge.windows)
        for hearer, heard in scenario.topology.hears.items()
        for edge in heard
    )
    return Drawing(tuple(robots), edges, scenario.coordination.silence_limit_s)


def way_m(changes: tuple[SpeedChange, ...], until_s: float) -> float:
    """The integral of the leader's speed from 0 to a time [m]."""
    return sum(
        (speed_at(changes, a) + speed_at(changes, b)) / 2.0 * (b - a) * 1e-9
        for a, b in pairwise(corners(changes, round(until_s * 1e9)))
    )
