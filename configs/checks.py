"""Relations between the sections of a scenario; all problems at once, none raised."""

import itertools
from collections.abc import Callable, Iterable, Iterator
from typing import Protocol

from pydantic import ValidationError

from configs.drive_checks import drive_problems
from configs.edge_checks import multiple_problem
from configs.edges import LEADER
from configs.emulated_edges import emulation_problems
from configs.errors import Problem
from configs.expect_checks import expect_problems
from configs.faults.plan import fault_problems
from configs.graph_checks import edge_problems, graph_problems
from configs.netem import LOCALISATION
from configs.paths import Spline, Varying
from configs.scenario import ETSRO, Scenario
from configs.wording import MISSING, remedy_of

_OTHERS = {LEADER: "the virtual leader", LOCALISATION: "the localisation system"}
"""Ends of edges that are no robots."""
Check = Callable[..., Iterable[Problem]]
"""Of a scenario: its problems."""


class Ask(Protocol):
    """Makes a check of a scenario."""

    def __call__(self, check: Check, scenario: Scenario, **how: bool) -> list[Problem]:
        """What it finds."""


def _found(check: Check, scenario: Scenario, **how: bool) -> list[Problem]:
    return list(check(scenario, **how))


def cross_problems(scenario: Scenario, ask: Ask = _found) -> list[Problem]:
    """All problems that no section can see alone.

    Args:
        scenario: whose sections are right, each by itself.
        ask: makes one check after the other; each depends on the scenario alone, and on whether
            those before found nothing.
    """
    problems = [
        problem
        for check in (_names, _leader, _members, _laws, _periods, drive_problems)
        for problem in ask(check, scenario)
    ]
    edges = ask(edge_problems, scenario)
    problems += ask(_host, scenario)
    problems += ask(expect_problems, scenario, sound_edges=not edges)
    problems += ask(fault_problems, scenario, sound_edges=not edges)
    if not edges:
        problems += ask(_emulation, scenario)
    if not problems and not edges:
        edges = ask(graph_problems, scenario)
    return problems + edges


def _emulation(scenario: Scenario) -> Iterable[Problem]:
    return emulation_problems(scenario.network, scenario.topology)


def _names(scenario: Scenario) -> Iterator[Problem]:
    seen: set[str] = set()
    for robot in scenario.robot:
        if robot.name in seen:
            yield Problem("robot.name", robot.name, "two robots have this name; make it unique")
        seen.add(robot.name)
        if robot.name in _OTHERS:
            remedy = f"edges have {_OTHERS[robot.name]} by this name; give the robot another"
            yield Problem("robot.name", robot.name, remedy)
        known = {ETSRO, *scenario.robot_types}
        if robot.type not in known:
            remedy = f"no such robot type; known: {', '.join(sorted(known))}"
            yield Problem(f"robot.{robot.name}.type", robot.type, remedy)
        if isinstance(robot.offset, Varying):
            places = [knot.s_m for knot in robot.offset.knots]
            if any(b <= a for a, b in itertools.pairwise(places)):
                yield Problem(f"robot.{robot.name}.offset.knots", places, "s_m must increase")
    if isinstance(scenario.path, Spline):
        points = scenario.path.points_m
        if any(a == b for a, b in itertools.pairwise(points)):
            yield Problem("path.points_m", points, "two neighbouring points are the same")
        if scenario.path.closed and points[0] == points[-1]:
            remedy = (
                "a closed spline goes back to its first point by itself: leave the last one out"
            )
            yield Problem("path.points_m", points, remedy)
        if scenario.path.closed and len(points) < 3:
            yield Problem("path.points_m", points, "a closed spline needs three points or more")


def _leader(scenario: Scenario) -> Iterator[Problem]:
    """Changes of v_r follow each other."""
    for n, (one, other) in enumerate(itertools.pairwise(scenario.leader.steps), 1):
        if other.t_s <= one.t_s:
            remedy = f"t_s must increase: above {one.t_s:g}, that of the step before"
            yield Problem(f"leader.steps.{n}.t_s", other.t_s, remedy)


def _members(scenario: Scenario) -> Iterator[Problem]:
    """Times at which robots join and leave."""
    period_s = scenario.clock.control_period_s
    end_s = max(scenario.duration_s, scenario.ends_at_s)
    for robot in scenario.robot:
        where, joins_s, leaves_s = f"robot.{robot.name}", robot.joins_at_s, robot.leaves_at_s
        yield from multiple_problem(f"{where}.joins_at_s", joins_s, period_s, least=0)
        if leaves_s is not None:
            yield from multiple_problem(f"{where}.leaves_at_s", leaves_s, period_s)
            if leaves_s <= joins_s:
                remedy = f"must be above joins_at_s = {joins_s:g}"
                yield Problem(f"{where}.leaves_at_s", leaves_s, remedy)
        if joins_s >= end_s:
            remedy = f"the run ends before: must be below duration_s = {end_s:g}"
            yield Problem(f"{where}.joins_at_s", joins_s, remedy)
        if joins_s > 0.0 and (robot.v_m_s or robot.omega_rad_s):
            remedy = "stands until it joins: must be 0, as omega_rad_s"
            yield Problem(f"{where}.v_m_s", robot.v_m_s, remedy)


def _laws(scenario: Scenario) -> Iterator[Problem]:
    """The robots' own keys of [control], each checked against its own law."""
    for robot in scenario.robot:
        try:
            scenario.control_of(robot)
        except ValidationError as error:
            for item in error.errors(include_url=False):
                key = ".".join(str(part) for part in ("robot", robot.name, "control", *item["loc"]))
                value = MISSING if item["type"] == "missing" else item["input"]
                yield Problem(key, value, remedy_of(item))


def _periods(scenario: Scenario) -> Iterator[Problem]:
    clock = scenario.clock
    period_ns = clock.control_period_s * 1e9
    if abs(period_ns - round(period_ns)) > 1e-3 or round(period_ns) < 1000:
        yield Problem(
            "clock.control_period_s",
            clock.control_period_s,
            "must be a whole number of nanoseconds, 1 µs or more",
        )
        return
    multiples = {
        "clock.share_period_s": clock.share_period_s,
        "clock.localisation_period_s": clock.localisation_period_s,
        "clock.countdown_s": clock.countdown_s,
        "duration_s": scenario.duration_s,
    }
    if scenario.until_s is not None:
        multiples["until_s"] = scenario.until_s
    if scenario.localisation.delay_s is not None:
        multiples["localisation.delay_s"] = scenario.localisation.delay_s
    for key, value in multiples.items():
        least = 0 if key in ("clock.countdown_s", "localisation.delay_s") else 1
        yield from multiple_problem(key, value, clock.control_period_s, least=least)
    silence_s = scenario.coordination.silence_limit_s
    if clock.share_period_s > silence_s:
        yield Problem(
            "clock.share_period_s",
            clock.share_period_s,
            f"must not be above coordination.silence_limit_s = {silence_s:g}, or every neighbour"
            " counts as silent between two shares",
        )


def _host(scenario: Scenario) -> Iterator[Problem]:
    host, clock = scenario.host, scenario.clock
    delay_s = scenario.localisation.delay_s or clock.control_period_s
    least = {
        "encoder_age_limit_s": (2 * clock.control_period_s, "two of clock.control_period_s"),
        "pose_age_limit_s": (
            delay_s + 2 * clock.localisation_period_s,
            "the delay and two of clock.localisation_period_s",
        ),
    }
    if host.rearm and scenario.localisation.source == "odometry":
        remedy = "odometry alone doesn't know where a robot is after a fault: false, or fixes"
        yield Problem("host.rearm", True, remedy)
    if host.restarts and clock.mode == "lockstep":
        remedy = "the tick at which it ended is lost, and all wait for it: 0, or real time"
        yield Problem("host.restarts", host.restarts, remedy)
    elif host.restarts and scenario.localisation.source == "odometry":
        remedy = "odometry alone doesn't know where a robot is after that: 0, or fixes"
        yield Problem("host.restarts", host.restarts, remedy)
    for key, (limit, what) in least.items():
        value = getattr(host, key)
        if value is not None and value < limit:
            remedy = f"{what}, {limit:g} s, or more, or a healthy robot stops or never arms"
            yield Problem(f"host.{key}", value, remedy)
