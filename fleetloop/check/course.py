"""A robot's course: where its path wants it at the instants of a forecast, and how fast.

    v = v̄_d ṡ,  ω = ω̄_d ṡ                                     forward speed, turn rate  (10), (11)

A path is regular (Assumption 2.4) if v̄_d has a positive lower bound. It is looked for by halving:
between two places Γ' may come near 0 only where the chord of its hodograph does.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import cos, hypot, inf, sin

import numpy as np
from numpy.typing import NDArray

from agents.laws.failure import ShapeError, raised
from agents.laws.interface import Reference, RobotPath
from agents.paths import robot_path
from configs.complaints import refusal
from configs.curves import formation_offset, reference_path
from configs.errors import Problem, ScenarioError
from configs.loading import blamed
from configs.overrides import Overrides
from configs.paths import AT_CENTRE, Spline
from configs.plugins import Choice
from configs.scenario import Scenario
from configs.sections import (
    Robot,
)
from fleetloop.check.coordination import Forecast

Series = NDArray[np.float64]
PLACES = 40_000
"""Path points evaluated for a scenario, all robots together, about."""
STANDS_STILL = 1e-3
"""v̄_d below this is no path: a millimetre per metre of s."""
_HALVINGS = 40


@dataclass(frozen=True, slots=True)
class Course:
    """One robot's reference motion in time."""

    robot: Robot
    t_s: Series
    v: Series  # [m/s]
    omega: Series  # [rad/s]
    v_bar: Series  # (10), [m per unit of s]
    omega_bar: Series  # (11), [rad per unit of s]
    place_m: Series  # of the reference, columns x, y


def courses(scenario: Scenario, ahead: Forecast) -> list[Course]:
    """The courses of all robots while they are members; their paths are regular."""
    every = max(1, len(ahead.t_s) * len(scenario.robot) // PLACES)
    found = []
    for n, robot in enumerate(scenario.robot):
        path = path_of(scenario, robot)
        there = np.flatnonzero(ahead.there[::every, n]) * every
        if not len(there):  # it joins after the forecast
            there = np.array([len(ahead.t_s) - 1])
        references = [path(float(s)) for s in ahead.s[there, n]]
        v_bar = np.array([reference.v_bar for reference in references])
        omega_bar = np.array([reference.omega_bar for reference in references])
        s_dot, t_s = ahead.s_dot[there, n], ahead.t_s[there]
        place_m = np.array([(reference.x, reference.y) for reference in references])
        v, omega = v_bar * s_dot, omega_bar * s_dot
        found.append(Course(robot, t_s, v, omega, v_bar, omega_bar, place_m))
    return found


def path_of(scenario: Scenario, robot: Robot) -> RobotPath:
    """The path Γ_i of a robot."""
    path = robot_path(reference_path(scenario.path), formation_offset(robot.offset))
    own = [one for one in (scenario.path, robot.offset) if isinstance(one, Choice)]
    return _named(path, robot.name, own) if own else path


def _named(path: RobotPath, robot: str, own: Sequence[Choice]) -> RobotPath:
    """A path whose errors name the origin of its code."""

    def at(s: float) -> Reference:
        try:
            return path(s)
        except ZeroDivisionError:  # it stands still there
            raise
        except ShapeError as error:
            raise ScenarioError(f"{robot}'s path at s = {s:.4g} m: {error}") from error
        except Exception as error:
            names = " and ".join(one.name for one in own)
            why = raised(error)
            raise ScenarioError(f"{robot}'s path, of {names}, at s = {s:.4g} m: {why}") from error

    return at


def refuse_irregular(
    source: str, scenario: Scenario, ahead: Forecast, overrides: Overrides = ()
) -> None:
    """Refuse a scenario in which a robot's path stands still somewhere on its way.

    Whoever set the key is blamed: the file `source`, or one of the options `overrides`.

    Raises:
        ScenarioError: naming robots, keys and places.
    """
    problems = []
    for n, robot in enumerate(scenario.robot):
        first, last = float(ahead.s[:, n].min()), float(ahead.s[:, n].max())
        count = max(200, PLACES // len(scenario.robot) // 10)
        places = np.linspace(first, last, count).tolist()
        at, slowest = slowest_place(path_of(scenario, robot), places)
        if slowest < STANDS_STILL:
            problems.append(blamed(source, _irregular(scenario, robot, at), overrides))
    if problems:
        raise refusal(problems)


def slowest_place(path: RobotPath, places: Sequence[float]) -> tuple[float, float]:
    """(s, v̄_d) where v̄_d is least on [first, last] of increasing places."""
    best = (places[0], inf)

    def hodograph(s: float) -> tuple[float, float]:
        nonlocal best
        speed, heading = _speed_and_heading(path, s)
        if speed < best[1]:
            best = s, speed
        return speed * cos(heading), speed * sin(heading)

    def look(
        a: float, at_a: tuple[float, float], b: float, at_b: tuple[float, float], n: int
    ) -> None:
        near, far = sorted((hypot(*at_a), hypot(*at_b)))
        apart = _chord_from_origin(at_a, at_b)
        if n == 0 or best[1] < STANDS_STILL or apart > 0.5 * near or far == 0.0:
            return
        middle = 0.5 * (a + b)
        at_middle = hodograph(middle)
        look(a, at_a, middle, at_middle, n - 1)
        look(middle, at_middle, b, at_b, n - 1)

    before, at_before = places[0], hodograph(places[0])
    for place in places[1:]:
        at_place = hodograph(place)
        look(before, at_before, place, at_place, _HALVINGS)
        before, at_before = place, at_place
    return best


def _irregular(scenario: Scenario, robot: Robot, at: float) -> Problem:
    """The key to change: the offset, unless the centre's own path stands still there."""
    law = "the law wants v̄_d > 0 everywhere (Assumption 2.4)"
    centre = robot_path(reference_path(scenario.path), AT_CENTRE)
    speed, _ = _speed_and_heading(centre, at)
    if speed < STANDS_STILL:
        remedy = f"the path stands still at s = {at:.4g} m; {law}"
        if isinstance(scenario.path, Spline):
            value: object = scenario.path.points_m
            return Problem("path.points_m", value, f"{remedy}: don't turn back on a point")
        if isinstance(scenario.path, Choice):
            return Problem("path.kind", scenario.path.name, remedy)
        return Problem("path", asdict(scenario.path), remedy)
    turn = abs(centre(at).omega_bar)
    remedy = f"{robot.name}'s path stands still at s = {at:.4g} m; {law}"
    if turn > 0.0:
        remedy += f": keep the offset off the path's centre of curvature, {speed / turn:.4g} m away"
    if isinstance(robot.offset, Choice):
        return Problem(f"robot.{robot.name}.offset.kind", robot.offset.name, remedy)
    offset = asdict(robot.offset)
    kind = offset.pop("kind")
    if kind == "structure":
        key = f"robot.{robot.name}.offset.left_m"
        return Problem(key, offset["left_m"], remedy)
    return Problem(f"robot.{robot.name}.offset", offset, remedy)


def _speed_and_heading(path: RobotPath, s: float) -> tuple[float, float]:
    try:
        reference = path(s)
    except ZeroDivisionError:  # exactly there
        return 0.0, 0.0
    return reference.v_bar, reference.theta


def _chord_from_origin(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Distance of the origin from the segment between two points."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    along = 0.0 if square == 0.0 else min(max(-(a[0] * dx + a[1] * dy) / square, 0.0), 1.0)
    return hypot(a[0] + along * dx, a[1] + along * dy)
