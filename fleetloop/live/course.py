"""The planned course of each robot in the plane, and what bounds its wheels' torque. Pure."""

from math import inf

import numpy as np

from agents.paths import robot_path
from configs.curves import formation_offset, reference_path
from configs.leader_speed import SpeedChange, speed_at
from configs.resolve import leader_brief
from configs.scenario import Scenario
from fleetloop.check.torque import limits

_POINTS = 400
_MARGIN_M = 0.5
"""A course goes on so far behind the last s that is planned."""
_MOST_M = 500.0
"""Of a path that is drawn."""


def planned_s_m(changes: tuple[SpeedChange, ...], end_s: float) -> float:
    """The way of the virtual leader until a time: ∫ v_r dt, backwards counted as nothing."""
    t_ns = np.linspace(0.0, end_s * 1e9, 2000)
    speeds = np.array([max(speed_at(changes, t), 0.0) for t in t_ns])
    return float(np.trapezoid(speeds, t_ns * 1e-9))


def courses(scenario: Scenario) -> dict[str, np.ndarray]:
    """Of each robot, points (n, 2) of its path from where it starts to where it is to end."""
    far_m = planned_s_m(leader_brief(scenario).speed_changes, scenario.ends_at_s)
    centre = reference_path(scenario.path)
    found = {}
    start_m = min(robot.s_0 for robot in scenario.robot)
    end_m = max(robot.s_0 for robot in scenario.robot) + min(far_m + _MARGIN_M, _MOST_M)
    for robot in scenario.robot:
        path = robot_path(centre, formation_offset(robot.offset))
        points = []
        for s in np.linspace(min(start_m, robot.s_0), end_m, _POINTS):
            try:
                points.append(path(float(s))[:2])
            except Exception:  # a path of the user's own, beyond the end that it has
                continue
        found[robot.name] = np.array(points, dtype=float).reshape(-1, 2)
    return found


def torque_limits_wheel_N_m(scenario: Scenario) -> dict[str, float | None]:
    """Of each robot, the least bound of a wheel's torque at standstill; None: nothing bounds it."""
    found = {}
    for robot in scenario.robot:
        least = min((one.torque_wheel_N_m for one in limits(scenario, robot)), default=inf)
        found[robot.name] = None if least == inf else least
    return found
