"""Torques that a robot's wheels need along its course, against the limits of law, host and drives.

Everything is at the wheel; shaft quantities come there through the gear.

    B̄ τ = M̄ ξ' + C̄ ξ + D̄ ξ + Δ̄                                       inverse of (4), ξ = (v, ω)  (1)
    + friction at the wheel: gear × Coulomb + gear² × viscous × ν      realistic motors          (2)

On a steady curve (1) is d (v̄_d + b |ω̄_d|) v_r / r at the outer wheel. Let through is the least of
`fleetloop.torque_limits`.

Where need exceeds it, only a part f < 1 of the speed is kept up; the robot falls behind by
∫ (1 − f) v dt, and catches up at most as fast as k_1 wants or as it has speed to spare.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf, log1p, sqrt

import numpy as np

from configs.scenario import Scenario
from fleetloop.check.body import inertias, robot_body
from fleetloop.check.course import Course, Series
from fleetloop.check.finding import Finding, Level
from fleetloop.law_facts import approach_rate_1_s, speed_gain, speed_gain_key
from fleetloop.torque_limits import Limit, limits
from plant.body import RigidBody

START_S = 0.5
"""Accelerations from rest aren't looked at: how fast a robot gets going is its law's business."""
BEHIND_M = 0.3
"""Falling behind by more than this is an error if it lasts to the end, else a warning."""
MARGIN = 2.0


@dataclass(frozen=True, slots=True)
class Need:
    """Both wheels of one robot along its course; columns right, left; all at the wheel."""

    torque_wheel_N_m: Series  # all of (1) and (2), disturbance at its largest
    motion_wheel_N_m: Series  # the part that goes with the speed
    rest_wheel_N_m: Series  # friction and disturbance
    nu_wheel_rad_s: Series


def torque_findings(scenario: Scenario, courses: list[Course]) -> Iterator[Finding]:
    """Steady torque of every robot, and heat where motors have any."""
    for course in courses:
        need = needed(scenario, course)
        yield _torque(scenario, course, need, limits(scenario, course.robot))
        yield from _heat(scenario, course, need)
        yield from _slew(scenario, course, need)


def needed(scenario: Scenario, course: Course) -> Need:
    """(1) and (2) along a course."""
    body = robot_body(scenario.body_of(course.robot))
    nu = _wheel_speeds(body, course)
    viscous = np.array(body.damping_wheel_N_m_s)
    rest = np.zeros_like(nu)
    if scenario.drive.preset == "realistic":
        gear, motor = scenario.mounting_of(course.robot).gear_ratio, scenario.motor
        viscous = viscous + gear**2 * motor.viscous_friction_shaft_N_m_s
        rest = gear * motor.coulomb_friction_shaft_N_m * np.sign(nu)
    motion = nu * viscous
    push = (course.robot.disturbance or scenario.disturbance).amplitude_wheel_N_m
    whole = motion + rest + _inertial(body, course, nu)
    return Need(np.abs(whole) + push, motion, rest, nu)


def _inertial(body: RigidBody, course: Course, nu: Series) -> Series:
    """M̄ ξ' + C̄ ξ of (4) at both wheels."""
    if len(course.t_s) < 3:
        return np.zeros((len(course.t_s), 2))
    v, omega = course.v, course.omega
    rate_v, rate_omega = (np.gradient(x, course.t_s) for x in (v, omega))
    starting = course.t_s - course.t_s[0] < START_S
    rate_v[starting] = rate_omega[starting] = 0.0
    moments = zip(v, omega, rate_v, rate_omega, strict=True)
    torques = np.array([body.wheel_torques(*moment) for moment in moments])
    friction = nu * np.array(body.damping_wheel_N_m_s)
    inertial: Series = torques - friction
    return inertial


def _wheel_speeds(body: RigidBody, course: Course) -> Series:
    moments = zip(course.v, course.omega, strict=True)
    return np.array([body.wheel_speeds(v, omega) for v, omega in moments])


def _torque(scenario: Scenario, course: Course, need: Need, bounds: list[Limit]) -> Finding:
    robot = course.robot
    title = "wheel torque along the path"
    most = np.abs(need.torque_wheel_N_m)
    place = np.unravel_index(int(most.argmax()), most.shape)
    peak, speed = float(most[place]), float(course.v[place[0]])
    basis = "(4) inverse, friction through the gear"
    if not bounds:
        said = f"up to {peak:.3g} N·m at {speed:.3g} m/s; nothing limits it"
        return Finding("ok", title, said, (robot.name,), basis=basis)
    left = np.array(
        [b.torque_wheel_N_m - b.slope_wheel_N_m_s * np.abs(need.nu_wheel_rad_s) for b in bounds]
    )
    ratios = left / np.maximum(most, 1e-12)
    tightest = np.unravel_index(int(ratios.argmin()), ratios.shape)
    limit, (_, instant, wheel) = bounds[tightest[0]], tightest
    asked, given = float(most[instant, wheel]), max(float(left[tightest]), 0.0)
    asked_m_s = float(course.v[instant])
    said = f"{asked:.3g} N·m at {asked_m_s:.3g} m/s"
    behind = _behind(scenario, course, need, bounds)
    level: Level = "ok"
    remedy = ""
    if ratios[tightest] < MARGIN:
        level, remedy = "warning", f"keep twice the need: change {limit.key}"
    if ratios[tightest] < 1.0:
        remedy = f"change {limit.key}, or go slower"
        if limit.speed_m_s < asked_m_s:
            remedy += f" (it allows {limit.speed_m_s:.3g} m/s of {asked_m_s:.3g})"
        if behind[-1] > BEHIND_M:
            level = "error"
            said += f", falls {float(behind[-1]):.2g} m behind"
    return Finding(
        level,
        title,
        said,
        (robot.name,),
        limit.key if level != "ok" else "",
        limit=f"≤ {given:.3g} N·m, {limit.words}",
        remedy=remedy,
        basis=basis,
    )


def _behind(scenario: Scenario, course: Course, need: Need, bounds: list[Limit]) -> Series:
    """Distance of the robot behind its reference at each instant [m]."""
    motion, rest, nu = (
        np.abs(x) for x in (need.motion_wheel_N_m, need.rest_wheel_N_m, need.nu_wheel_rad_s)
    )
    parts = [
        ((b.torque_wheel_N_m - rest) / np.maximum(motion + b.slope_wheel_N_m_s * nu, 1e-12)).min(
            axis=1
        )
        for b in bounds
    ]
    part = np.clip(np.min(parts, axis=0), 0.0, 10.0)
    rate = approach_rate_1_s(scenario.control_of(course.robot))
    k1 = inf if rate is None else rate
    steps = np.diff(course.t_s, append=2 * course.t_s[-1] - course.t_s[-2] if len(part) > 1 else 0)
    lag, lags = 0.0, []
    for f, v, dt in zip(part.tolist(), np.abs(course.v).tolist(), steps.tolist(), strict=True):
        gained = (1.0 - f) * v if f < 1.0 else -min(k1 * lag if lag else 0.0, (f - 1.0) * v)
        lag = max(lag + gained * dt, 0.0)
        lags.append(lag)
    return np.array(lags)


def _heat(scenario: Scenario, course: Course, need: Need) -> Iterator[Finding]:
    """When windings or FETs, R i² R_th above ambient, are where drives begin to derate.

    Derating then holds them where (5) meets the heat that is left of the current.

        i = i_max (T_to − T) / (T_to − T_from),  T = T_ambient + R R_th i²              (5)
    """
    drive, motor = scenario.drive, scenario.motor
    derating = drive.derating()
    if drive.preset != "realistic" or derating is None:
        return
    gear = scenario.mounting_of(course.robot).gear_ratio
    constant = motor.torque_constant_N_m_A or drive.torque_constant_N_m_A
    # What limits don't let through makes no heat.
    most_A = (
        min(limit.torque_wheel_N_m for limit in limits(scenario, course.robot)) / gear / constant
    )
    amps = np.minimum(np.abs(need.torque_wheel_N_m) / gear / constant, most_A)
    square = float((amps**2).mean(axis=0).max())
    allowed_K = derating.from_C - motor.ambient_C
    parts = [
        (*_warm_up_s(per_A2 * square, allowed_K, time_s), per_A2, part)
        for part, per_A2, time_s in (
            (
                "windings",
                motor.motor_thermal_resistance_K_W * motor.winding_resistance_ohm,
                motor.motor_thermal_time_s,
            ),
            (
                "FETs",
                motor.fet_thermal_resistance_K_W * motor.fet_resistance_ohm,
                motor.fet_thermal_time_s,
            ),
        )
    ]
    after_s, rise_K, per_A2, part = min(parts)
    if after_s == inf:
        return
    span_K = derating.to_C - derating.from_C
    slope = span_K / drive.current_limit_A
    above_K = derating.to_C - motor.ambient_C
    left_A = (sqrt(slope**2 + 4.0 * per_A2 * max(above_K, 0.0)) - slope) / (2.0 * per_A2)
    text = (
        f"{sqrt(square):.3g} A rms take the {part} to {derating.from_C:g} °C, where derating"
        f" begins, after {after_s:.2g} s, and would to {motor.ambient_C + rise_K:.0f} °C; it leaves"
        f" {gear * constant * left_A:.3g} N·m in the long run"
    )
    fine = Finding(
        "ok",
        "motor temperature",
        text,
        (course.robot.name,),
        limit=f"not within {scenario.ends_at_s:g} s",
        basis="R i² R_th, first order",
    )
    if after_s > scenario.ends_at_s:
        yield fine
    else:
        remedy = "a larger mounting.gear_ratio or cooler motors, or a shorter run"
        yield replace(fine, level="warning", key="mounting.gear_ratio", remedy=remedy)


def _warm_up_s(rise_K: float, allowed_K: float, time_s: float) -> tuple[float, float]:
    """(time to `allowed_K` on the way to `rise_K`, infinite if never; `rise_K`)."""
    if rise_K <= allowed_K:
        return inf, rise_K
    return -time_s * log1p(-max(allowed_K, 0.0) / rise_K), rise_K


def _slew(scenario: Scenario, course: Course, need: Need) -> Iterator[Finding]:
    """The host's slew limit against the time in which the law wants to reach the steady torque."""
    slew = scenario.host.torque_slew_limit_wheel_N_m_s
    if slew is None:
        return
    control, body = scenario.control_of(course.robot), scenario.body_of(course.robot)
    gain = speed_gain(control)
    if gain is None or gain <= 0.0:
        return
    name = speed_gain_key(control) or "k"
    lag_s = min(inertias(body)) / gain
    takes_s = float(np.abs(need.torque_wheel_N_m).max()) / slew
    if takes_s > lag_s:
        yield Finding(
            "warning",
            "host.torque_slew_limit_wheel_N_m_s",
            f"{slew:g} N·m/s take {takes_s:.2g} s to the needed torque: felt as lag, may swing",
            (course.robot.name,),
            "host.torque_slew_limit_wheel_N_m_s",
            limit=f"≤ {lag_s:.2g} s, the speed loop's m̄/{name}",
            remedy="raise it",
            basis="(34)",
        )
