"""Findings about the paths: regularity, the smallest turning radius, how close robots come.

    v̄_d > 0 everywhere                        Assumption 2.4; its least value is told
    1/|κ| = v̄_d / |ω̄_d|                       of the robot's own path, its offset included
    min |Γ_i(s) − Γ_j(s)|                      spacing at equal s, where the fleet agrees
    min |Γ_i(s_i(t)) − Γ_j(s_j(t))|            on the way there, by the forecast of this run

Robots are discs about their axle's centre of radius b + r; the emulation lets them pass through
each other.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf

import numpy as np

from configs.scenario import Scenario
from fleetloop.check.coordination import Forecast
from fleetloop.check.course import STANDS_STILL, Course, Series, path_of
from fleetloop.check.finding import Finding

AWAY_M = 1e9
PLACES, LEAST_PLACES = 1_000, 40
"""Path points for the spacing at equal s, all robots together, about, and of each at least."""


def geometry_findings(
    scenario: Scenario, courses: Sequence[Course], ahead: Forecast
) -> Iterator[Finding]:
    """Regularity and turning radius of every robot's path, and the spacing of the fleet."""
    for course in courses:
        yield from _curvature(scenario, course)
    if len(courses) > 1:
        yield _spacing(scenario, courses, ahead)


def _curvature(scenario: Scenario, course: Course) -> Iterator[Finding]:
    robots = (course.robot.name,)
    yield Finding(
        "ok",
        "regular path",
        f"v̄_d ≥ {float(course.v_bar.min()):.3g}",
        robots,
        limit=f"> {STANDS_STILL:g}",
        basis="Assumption 2.4",
    )
    turn = np.abs(course.omega_bar)
    radius_m = float(np.min(course.v_bar / np.maximum(turn, 1e-12)))
    half_track_m = scenario.body_of(course.robot).half_track_m
    value = f"{radius_m:.3g} m" if radius_m < 1e6 else "straight"
    limit = f"≥ half track {half_track_m:g} m"
    fine = Finding("ok", "smallest turning radius", value, robots, limit=limit, basis="v̄_d / |ω̄_d|")
    if radius_m >= half_track_m:
        yield fine
    else:
        remedy = "the inner wheel turns backwards: an offset to the outside, or a wider path"
        key = f"robot.{course.robot.name}.offset"
        yield replace(fine, level="warning", key=key, remedy=remedy)


def _spacing(scenario: Scenario, courses: Sequence[Course], ahead: Forecast) -> Finding:
    """The closest two robots, at equal s and on the way; discs must not overlap."""
    bodies = [scenario.body_of(course.robot) for course in courses]
    radii = np.array([body.half_track_m + body.wheel_radius_m for body in bodies])
    equal_m, _ = closest(_places(scenario, ahead), radii)
    on_the_way_m, pair = closest(_together(courses), radii)
    one, other = (courses[n].robot.name for n in pair)
    value = f"{equal_m:.3g} m at equal s; {on_the_way_m:.3g} m on the way, {one} and {other}"
    limit = f"≥ {float(radii[pair[0]] + radii[pair[1]]):.3g} m, half tracks and wheels"
    fine = Finding("ok", "spacing of robots", value, limit=limit, basis="|Γ_i − Γ_j|")
    if min(equal_m, on_the_way_m) >= radii[pair[0]] + radii[pair[1]]:
        return fine
    remedy = "offsets farther apart"
    if equal_m >= radii[pair[0]] + radii[pair[1]]:
        remedy = "starts s_0 closer to each other, or coordination.v_hat_0 = leader.speed_m_s"
    return replace(fine, level="warning", key=f"robot.{other}", remedy=remedy)


def _together(courses: Sequence[Course]) -> Series:
    """(robots, instants, 2): where they are; far from all others while they aren't members."""
    instants = np.unique(np.concatenate([course.t_s for course in courses]))
    places_m = np.empty((len(courses), len(instants), 2))
    for n, course in enumerate(courses):
        places_m[n] = (n + 1) * AWAY_M
        places_m[n, np.searchsorted(instants, course.t_s)] = course.place_m
    return places_m


def closest(places_m: Series, radii_m: Series) -> tuple[float, tuple[int, int]]:
    """Distance of the two robots that come closest, for their sizes, and their numbers.

    Args:
        places_m: (robots, instants, 2), two robots at least.
        radii_m: of the robots.
    """
    best, least, pair = inf, inf, (0, 1)
    for n in range(len(places_m) - 1):
        apart = np.hypot(*np.moveaxis(places_m[n + 1 :] - places_m[n], 2, 0)).min(axis=1)
        gaps = apart - radii_m[n + 1 :] - radii_m[n]
        nearest = int(gaps.argmin())
        if gaps[nearest] < least:
            least, best = float(gaps[nearest]), float(apart[nearest])
            pair = n, n + 1 + nearest
    return best, pair


def _places(scenario: Scenario, ahead: Forecast) -> Series:
    """(robots, places, 2): all paths at the same places, from the first to the last of the run."""
    count = max(PLACES // len(scenario.robot), LEAST_PLACES)
    way = np.linspace(ahead.s.min(), ahead.s.max(), count).tolist()
    paths = [path_of(scenario, robot) for robot in scenario.robot]
    return np.array([[(at.x, at.y) for at in map(path, way)] for path in paths])
