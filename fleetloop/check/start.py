"""Findings about the first second, by integrating law and body alone from the start, or joining.

    first torque    of the law at the start, k_4 k_1 |x_e(0)| / r of (34): what no drive has, is cut
    adaptation      the largest ratio of the law's own `AdaptationLimit`: not stable from 1 on

Poses are exact, drives give what the limits of `fleetloop.check.torque` let through at rest.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot, inf, isfinite

import numpy as np

from agents.laws.build import build
from agents.laws.failure import failure, raised
from agents.laws.interface import AdaptationLimit, PathVariable, RobotMotion
from configs.brief import Wheels
from configs.errors import ScenarioError
from configs.scenario import Scenario
from configs.sections import Robot
from fleetloop.check.body import robot_body
from fleetloop.check.coordination import Forecast
from fleetloop.check.course import path_of
from fleetloop.check.finding import Finding
from fleetloop.law_facts import adaptation_limit, saturation
from fleetloop.torque_limits import limits
from plant.body import State
from plant.integrate import rk4

START_S = 1.0
TICKS = 30_000
"""Control periods integrated for a scenario, all robots together, at most."""
_STEP_S = 0.005


@dataclass(slots=True)
class _Start:
    """Observations of one robot's first second."""

    off_m: float = 0.0
    asked_wheel_N_m: float = 0.0
    asked_at_s: float = 0.0
    ratio: float = 0.0  # of the adaptation limit
    ratio_at_s: float = 0.0
    diverged_at_s: float | None = None
    failed: str = ""  # how and why a law or path raised


def start_findings(scenario: Scenario, ahead: Forecast) -> Iterator[Finding]:
    """First torque of every robot, and its sampled adaptation."""
    h = scenario.clock.control_period_s
    ticks = round(min(START_S, scenario.duration_s) / h)
    ticks = min(ticks, max(TICKS // len(scenario.robot), 1))
    for n, robot in enumerate(scenario.robot):
        limit = adaptation_limit(scenario.control_of(robot), h)
        seen = _start(scenario, robot, ahead, n, ticks, limit)
        yield _first_torque(scenario, robot, seen, adapts=limit is not None)
        if limit is not None:
            yield _adaptation(robot, seen, limit)


def _start(
    scenario: Scenario,
    robot: Robot,
    ahead: Forecast,
    number: int,
    ticks: int,
    limit: AdaptationLimit | None,
) -> _Start:
    """Integrate law and body over the first ticks."""
    control, section = scenario.control_of(robot), scenario.body_of(robot)
    body, h = robot_body(section), scenario.clock.control_period_s
    path = path_of(scenario, robot)
    law = build(control, Wheels(section.wheel_radius_m, section.half_track_m), h, path)
    most = min((bound.torque_wheel_N_m for bound in limits(scenario, robot)), default=inf)
    instants = robot.joins_at_s + h * np.arange(ticks)
    places = np.interp(instants, ahead.t_s, ahead.s[:, number]).tolist()
    speeds = np.interp(instants, ahead.t_s, ahead.s_dot[:, number]).tolist()
    pose = robot.pose
    state = State(pose.x_m, pose.y_m, pose.theta_rad, robot.v_m_s, robot.omega_rad_s, 0.0, 0.0)
    steps = max(1, round(h / _STEP_S))
    seen, memory = _Start(), None
    rates = np.gradient(np.array(speeds), h).tolist() if ticks > 1 else [0.0]
    for tick, along in enumerate(zip(places, speeds, rates, strict=True)):
        motion = RobotMotion(state.x, state.y, state.theta, state.v, state.omega)
        try:
            reference = path(along[0])
            if tick == 0:
                seen.off_m = hypot(pose.x_m - reference.x, pose.y_m - reference.y)
            out = law.step(memory, motion, reference, PathVariable(*along))
        except (Exception, SystemExit) as error:
            how, why = failure(error, control.name)
            seen.diverged_at_s, seen.failed = tick * h, f"{how}: {why}"
            return seen
        asked = max(abs(out.tau_right), abs(out.tau_left))
        if asked > seen.asked_wheel_N_m:
            seen.asked_wheel_N_m, seen.asked_at_s = asked, tick * h
        if limit is not None:
            try:
                ratio = limit.ratio(memory, out.state, motion)
            except Exception as error:
                why = f"control.law = {control.name}: ratio of adaptation_limit: {raised(error)}"
                raise ScenarioError(why) from error
            if ratio > seen.ratio:
                seen.ratio, seen.ratio_at_s = ratio, tick * h
        right, left = (min(max(t, -most), most) for t in (out.tau_right, out.tau_left))
        memory = out.state
        for _ in range(steps):
            after = rk4(body, state, right, left, tick * h, h / steps)
            if after is None or not isfinite(asked):
                seen.diverged_at_s = tick * h
                return seen
            state = after
    return seen


def _first_torque(scenario: Scenario, robot: Robot, seen: _Start, *, adapts: bool) -> Finding:
    title, basis = "first torques", "(34) at t = 0, k_4 k_1 |x_e(0)| / r"
    off = f"{seen.off_m:.3g} m off the path"
    said = f"{off}: asks for {seen.asked_wheel_N_m:.3g} N·m {seen.asked_at_s:.3g} s after the start"
    # Of its own limit the law knows, and of the host's it is told (`Law.hold`).
    bounds = [
        limit
        for limit in limits(scenario, robot)
        if not limit.key.startswith(("control.", "host."))
    ]
    if seen.failed:
        text = f"{off}: {seen.failed}, {seen.diverged_at_s:.3g} s after the start"
        return Finding("error", title, text, (robot.name,), "control.law", basis=basis)
    if seen.diverged_at_s is not None and not adapts:  # or it is said of the adaptation
        text = f"{off}: the motion diverges {seen.diverged_at_s:.3g} s after the start"
        return Finding("warning", title, text, (robot.name,), "control.law", basis=basis)
    harm = saturation(scenario.control_of(robot))
    if not bounds:
        return Finding("ok", title, f"{said}; no drive's limit", (robot.name,), basis=basis)
    least = min(bounds, key=lambda one: one.torque_wheel_N_m)
    limit = f"≤ {least.torque_wheel_N_m:.3g} N·m at the wheel, {least.words}"
    if seen.asked_wheel_N_m > least.torque_wheel_N_m:
        if harm:
            return Finding(
                "warning",
                title,
                said,
                (robot.name,),
                "control.law",
                limit=limit,
                remedy=harm,
                basis=basis,
            )
        said, limit = f"{said}; the drive cuts it to {least.torque_wheel_N_m:.3g} N·m", ""
    return Finding("ok", title, said, (robot.name,), limit=limit, basis=basis)


def _adaptation(robot: Robot, seen: _Start, limit: AdaptationLimit) -> Finding:
    title = f"{limit.condition} at the start"
    said = f"{seen.ratio:.3g} {limit.unit} at most, {seen.ratio_at_s:.3g} s after the start"
    if seen.diverged_at_s is not None:
        said = f"diverges {seen.diverged_at_s:.3g} s after the start"
    fine = seen.diverged_at_s is None and seen.ratio < 1.0
    return Finding(
        "ok" if fine else "warning",
        title,
        said,
        (robot.name,),
        "" if fine else "control.law",
        limit=f"< 1 {limit.unit}",
        remedy="" if fine else limit.remedy,
        basis="(35) as sampled",
    )
