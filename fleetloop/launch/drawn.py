"""Scenario → what 3-D views of its record draw besides its rows."""

from collections.abc import Sequence
from itertools import pairwise

from configs.brief import Drawing, DrawnRobot, Wheels
from configs.curves import formation_offset, reference_path
from configs.leader_speed import SpeedChange, corners, speed_at
from configs.resolve import leader_brief
from configs.scenario import Scenario
from fleetloop.results.palette import robot_style


def drawing(scenario: Scenario) -> Drawing:
    """Robots in the colours of pages and figures, their paths as far as the leader goes, edges."""
    least_m, most_m = ways_m(leader_brief(scenario).speed_changes, scenario.ends_at_s)
    starts = [robot.s_0 for robot in scenario.robot]
    span = min(starts) + least_m, max(starts) + most_m
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


def ways_m(changes: Sequence[SpeedChange], until_s: float) -> tuple[float, float]:
    """The least and the greatest way of the leader, the integral of its speed from 0 on [m].

    Of all times from 0, where the way is 0, to `until_s`.
    """
    way_m = least_m = most_m = 0.0
    for begin, end in pairwise(corners(changes, round(until_s * 1e9))):
        first, last, lasts_s = (
            speed_at(changes, begin),
            speed_at(changes, end),
            (end - begin) * 1e-9,
        )
        parts = [(first, last, lasts_s)]
        if first * last < 0.0:  # it turns in between
            turns_s = lasts_s * first / (first - last)
            parts = [(first, 0.0, turns_s), (0.0, last, lasts_s - turns_s)]
        for at_first, at_last, part_s in parts:
            way_m += (at_first + at_last) / 2.0 * part_s
            least_m, most_m = min(least_m, way_m), max(most_m, way_m)
    return least_m, most_m
