"""Findings about the first second, by integrating law and body alone from the start.

    first torque    k_4 k_1 |x_e(0)| / r and the turning part of (34): what no drive has, is cut
    (35) sampled    Euler's rule with the loop is stable while h Σ k_5 F² < k_4 in both rows of Ω

The regressor F has ω² and the filters' rates in it, so it is large where a robot starts far off its
path or facing away. The robust law divides by 1 + h Σ k_5 F² / (k_4/4) and has no such limit.
Poses are exact, drives give what the limits of `fleetloop.check.torque` let through at rest.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot, inf, isfinite

import numpy as np

from agents.laws.adaptive_dsc import AdaptiveDsc, DscState
from agents.laws.build import build
from agents.laws.dsc_terms import path_errors, smoothing
from agents.laws.failure import failure
from agents.laws.interface import PathVariable, RobotMotion
from configs.brief import Wheels
from configs.scenario import Scenario
from configs.sections import Robot
from fleetloop.check.body import robot_body
from fleetloop.check.coordination import Forecast
from fleetloop.check.course import path_of
from fleetloop.check.finding import Finding
from fleetloop.check.law import is_adaptive_dsc, normalises
from fleetloop.check.torque import limits
from plant.body import State
from plant.integrate import rk4

START_S = 1.0
TICKS = 30_000
"""Control periods integrated for a scenario, all robots together, at most."""
_STEP_S = 0.005


@dataclass(slots=True)
class _Start:
    """Observations of one robot's first second."""

    asked_wheel_N_m: float = 0.0
    asked_at_s: float = 0.0
    ratio: float = 0.0  # h Σ k_5 F² / k_4
    ratio_at_s: float = 0.0
    diverged_at_s: float | None = None
    failed: str = ""  # how and why a law or path raised


def start_findings(scenario: Scenario, ahead: Forecast) -> Iterator[Finding]:
    """First torque of every robot, and the sampled adaptation of the paper's law."""
    h = scenario.clock.control_period_s
    ticks = round(min(START_S, scenario.duration_s) / h)
    ticks = min(ticks, max(TICKS // len(scenario.robot), 1))
    for n, robot in enumerate(scenario.robot):
        seen = _start(scenario, robot, ahead, n, ticks)
        yield _first_torque(scenario, robot, seen)
        control = scenario.control_of(robot)
        if is_adaptive_dsc(control) and not normalises(control):
            yield _adaptation(robot, seen)


def _start(scenario: Scenario, robot: Robot, ahead: Forecast, number: int, ticks: int) -> _Start:
    """Integrate law and body over the first ticks."""
    control, section = scenario.control_of(robot), scenario.body_of(robot)
    body, h = robot_body(section), scenario.clock.control_period_s
    path = path_of(scenario, robot)
    law = build(control, Wheels(section.wheel_radius_m, section.half_track_m), h, path)
    gains = control.parameters
    most = min((limit.torque_wheel_N_m for limit in limits(scenario, robot)), default=inf)
    instants = h * np.arange(ticks)
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
            out = law.step(memory, motion, path(along[0]), PathVariable(*along))
        except (Exception, SystemExit) as error:
            how, why = failure(error)
            seen.diverged_at_s, seen.failed = tick * h, f"{how}: {why}"
            return seen
        asked = max(abs(out.tau_right), abs(out.tau_left))
        if asked > seen.asked_wheel_N_m:
            seen.asked_wheel_N_m, seen.asked_at_s = asked, tick * h
        if isinstance(gains, AdaptiveDsc.Gains):
            ratio = _ratio(gains, h, memory, out.state, motion)
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


def _ratio(
    gains: AdaptiveDsc.Gains,
    h: float,
    before: DscState | None,
    after: DscState,
    motion: RobotMotion,
) -> float:
    """How large h Σ k_5 F² / k_4 is in the worse row of (32); α' from how far a filter moved."""
    if before is None:
        return 0.0
    rate_v, rate_omega = (
        (new - old) / (smoothing(h, gamma) * gamma)
        for new, old, gamma in (
            (after.alpha_v, before.alpha_v, gains.gamma_2_s),
            (after.alpha_omega, before.alpha_omega, gains.gamma_3_s),
        )
    )
    v, omega = motion.v, motion.omega
    rows = (omega * omega, v, omega, rate_v), (v * omega, v, omega, rate_omega)
    k5 = gains.k5[:4], gains.k5[4:]
    sizes = [
        sum(k * f * f for k, f in zip(*pair, strict=True)) for pair in zip(k5, rows, strict=True)
    ]
    return h * max(sizes) / gains.k4


def _first_torque(scenario: Scenario, robot: Robot, seen: _Start) -> Finding:
    title = "first torques"
    x_e, y_e, _ = _errors(scenario, robot)
    off = f"{hypot(x_e, y_e):.3g} m off the path"
    said = f"{off}: asks for {seen.asked_wheel_N_m:.3g} N·m {seen.asked_at_s:.3g} s after the start"
    bounds = [
        limit for limit in limits(scenario, robot) if limit.key != "control.torque_limit_wheel_N_m"
    ]
    if seen.failed:
        text = f"{off}: {seen.failed}, {seen.diverged_at_s:.3g} s after the start"
        return Finding("error", title, text, (robot.name,), "control.law")
    control = scenario.control_of(robot)
    if bounds and is_adaptive_dsc(control) and not normalises(control):
        limit = min(bounds, key=lambda one: one.torque_wheel_N_m)
        if seen.asked_wheel_N_m > limit.torque_wheel_N_m:
            text = (
                f"{said}, gets {limit.torque_wheel_N_m:.3g} N·m, {limit.words}: the paper's law"
                ' learns the limit; control.law = "adaptive_dsc_robust" doesn\'t, or start closer'
            )
            return Finding("warning", title, text, (robot.name,), "control.law")
    return Finding("ok", title, said, (robot.name,))


def _adaptation(robot: Robot, seen: _Start) -> Finding:
    title = "(35) sampled: h Σ k5 F² < k4 at the start"
    remedy = 'control.law = "adaptive_dsc_robust" normalises it; or lower k5, or start closer'
    if seen.diverged_at_s is not None:
        text = f"diverges {seen.diverged_at_s:.3g} s after the start: {remedy}"
        return Finding("warning", title, text, (robot.name,), "control.law")
    said = f"{seen.ratio:.3g} k4 at most, {seen.ratio_at_s:.3g} s after the start"
    if seen.ratio >= 1.0:
        text = f"{said}: not stable there; {remedy}"
        return Finding("warning", title, text, (robot.name,), "control.law")
    return Finding("ok", title, said, (robot.name,))


def _errors(scenario: Scenario, robot: Robot) -> tuple[float, float, float]:
    """(8) at the start."""
    reference, pose = path_of(scenario, robot)(robot.s_0), robot.pose
    return path_errors(
        pose.x_m, pose.y_m, pose.theta_rad, reference.x, reference.y, reference.theta
    )
