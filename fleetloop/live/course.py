"""The planned course of each robot in the plane, and what bounds its wheels' torque. Pure."""

import numpy as np

from agents.paths import robot_path
from configs.curves import formation_offset, reference_path
from configs.resolve import leader_brief
from configs.scenario import Scenario
from fleetloop.launch.drawn import ways_m
from fleetloop.torque_limits import tightest

_POINTS, _LEAST_POINTS, _MOST_POINTS = 8000, 100, 400
"""Of all courses, and of each: a browser draws all of them in every frame."""
_MARGIN_M = 0.5
"""A course goes on so far behind the last s that is planned."""
_MOST_M = 500.0
"""Of a path that is drawn."""


def courses(scenario: Scenario) -> dict[str, np.ndarray]:
    """Of each robot, points (n, 2) of its path as far as it is to drive, forwards and backwards."""
    least_m, most_m = ways_m(leader_brief(scenario).speed_changes, scenario.ends_at_s)
    centre = reference_path(scenario.path)
    found = {}
    count = min(max(_POINTS // len(scenario.robot), _LEAST_POINTS), _MOST_POINTS)
    start_m = min(robot.s_0 for robot in scenario.robot) + max(least_m, -_MOST_M)
    end_m = max(robot.s_0 for robot in scenario.robot) + min(most_m + _MARGIN_M, _MOST_M)
    for robot in scenario.robot:
        path = robot_path(centre, formation_offset(robot.offset))
        points = []
        for s in np.linspace(start_m, end_m, count):
            try:
                here = path(float(s))
            except Exception:  # a path of the user's own, beyond the end that it has
                continue
            points.append((here.x, here.y))
        found[robot.name] = np.array(points, dtype=float).reshape(-1, 2)
    return found


def torque_limits_wheel_N_m(scenario: Scenario) -> dict[str, float | None]:
    """Of each robot, the least bound of a wheel's torque at standstill; None: nothing bounds it."""
    found = {robot.name: tightest(scenario, robot) for robot in scenario.robot}
    return {name: None if one is None else one.torque_wheel_N_m for name, one in found.items()}
