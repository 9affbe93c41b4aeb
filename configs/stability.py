"""What can be said of a scenario before it runs: graph conditions, (46), sampling, torque.

    (46)   p²/q > max Im(ζ)² / Re(ζ) over the eigenvalues ζ ≠ 0 of L; exact for a fixed graph

p² ≥ 2 q d_max (d_max: largest in-degree) is enough for any delay, p² ≥ 4 q d_max for any switching
between graphs whose union is rooted. Sampled with a held output, the speed loop is stable iff
k_4 h < 2 min(m̄); half of that is a good margin.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from configs.briefing import leader_brief
from configs.scenario import Scenario
from configs.sections import Body, Robot
from configs.topology import Graph

Level = Literal["ok", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was checked."""

    level: Level
    title: str
    text: str


def findings(scenario: Scenario) -> list[Finding]:
    """All that can be checked before a run; the scenario itself is valid."""
    graph = scenario.topology
    return [
        *graph_conditions(graph),
        synchronisation(graph, scenario.coordination.p, scenario.coordination.q),
        delay_class(graph, scenario.coordination.p, scenario.coordination.q),
        *(_sampling(scenario, robot) for robot in scenario.robot),
        *(_torque(scenario, robot) for robot in scenario.robot),
        *_unused(scenario),
    ]


def graph_conditions(graph: Graph) -> list[Finding]:
    """The two conditions of Theorem 3.1 on the directed graph."""
    roots = graph.roots()
    unreached = graph.unreached_from(graph.leader)
    return [
        Finding(
            "error" if unreached else "ok",
            "leader reaches every robot",
            f"not {', '.join(unreached)}"
            if unreached
            else f"through {', '.join(graph.leader)}: L + H is nonsingular, every v̂_r → v_r",
        ),
        Finding(
            "ok" if roots else "error",
            "robots' graph is rooted",
            f"{', '.join(roots)} {'reaches' if len(roots) == 1 else 'reach'} all others"
            if roots
            else "no robot reaches all others: s_i − s_j would never vanish",
        ),
    ]


def synchronisation(graph: Graph, p: float, q: float) -> Finding:
    """Inequality (46), both sides."""
    left, right = p * p / q, _right_side(graph)
    holds = left > right
    return Finding(
        "ok" if holds else "error",
        "(46) p²/q > max Im(ζ)²/Re(ζ)",
        f"{left:g} > {right:.4g}" if holds else f"{left:g} is not above {right:.4g}: raise p",
    )


def delay_class(graph: Graph, p: float, q: float) -> Finding:
    """How much delay and switching the coordination stands."""
    degree = graph.max_in_degree
    ratio = p * p / (q * degree) if degree else np.inf
    title = "p²/(q d_max), largest in-degree d_max"
    if ratio >= 4:
        return Finding("ok", title, f"{ratio:g} ≥ 4: any delay, any switching with a rooted union")
    if ratio >= 2:
        return Finding("ok", title, f"{ratio:g} ≥ 2: any delay; switching graphs needs 4")
    return Finding("warning", title, f"{ratio:g} < 2: delay has a limit; switching needs 4")


def _right_side(graph: Graph) -> float:
    eigenvalues = np.linalg.eigvals(graph.laplacian())
    sides = [z.imag**2 / z.real for z in eigenvalues if z.real > 1e-9]
    return float(max(sides, default=0.0))


def _sampling(scenario: Scenario, robot: Robot) -> Finding:
    control, body = scenario.control_of(robot), scenario.body_of(robot)
    h = scenario.clock.control_period_s
    gain = control.k4 * h / min(_inertias(body))
    title = f"{robot.name}: sampled speed loop k4 h / min(m̄)"
    if gain >= 2:
        best = 0.25 * min(_inertias(body)) / h
        return Finding("error", title, f"{gain:.3g} ≥ 2: unstable; k4 = {best:.3g} suits this rate")
    level: Level = "ok" if gain <= 1 else "warning"
    return Finding(level, title, f"{gain:.3g}, stable below 2, good below 1")


def _torque(scenario: Scenario, robot: Robot) -> Finding:
    """Steady need d max(v)/r + |Δ|, and friction, against what drive and motor can do."""
    body, drive = scenario.body_of(robot), scenario.drive
    speed = max(abs(v) for _, v in leader_brief(scenario).speed_steps)
    disturbance = robot.disturbance or scenario.disturbance
    damping = max(body.damping_right_N_m_s, body.damping_left_N_m_s)
    need = damping * speed / body.wheel_radius_m + disturbance.amplitude_N_m
    title = f"{robot.name}: steady wheel torque"
    if drive.preset == "ideal":
        return Finding("ok", title, f"about {need:.3g} N·m at {speed:g} m/s; the drive is ideal")
    limit = drive.current_limit_A * drive.torque_constant_N_m_A
    if drive.preset == "realistic":
        motor = scenario.motor
        need += motor.coulomb_friction_N_m
        need += motor.viscous_friction_N_m_s * speed / body.wheel_radius_m
        current = min(drive.current_limit_A, motor.current_limit_A or drive.current_limit_A)
        limit = current * (motor.torque_constant_N_m_A or drive.torque_constant_N_m_A)
    level: Level = "error" if need >= limit else "warning" if 2 * need > limit else "ok"
    return Finding(level, title, f"about {need:.3g} of {limit:g} N·m; keep twice the need")


def _unused(scenario: Scenario) -> list[Finding]:
    """Sections that say something and aren't looked at."""
    preset = scenario.drive.preset
    if preset == "realistic":
        return []
    sections = {"motor": scenario.motor, "encoder": scenario.encoder, "supply": scenario.supply}
    return [
        Finding("warning", f"[{name}]", f'not used: drive.preset is "{preset}", not "realistic"')
        for name, section in sections.items()
        if section != type(section)()
    ]


def _inertias(body: Body) -> tuple[float, float]:
    r, b, a = body.wheel_radius_m, body.half_track_m, body.com_offset_m
    mass = body.body_mass_kg + body.wheels_in_mass * body.wheel_mass_kg
    inertia = (
        body.body_mass_kg * a * a
        + 2 * body.wheel_mass_kg * b * b
        + body.body_inertia_kg_m2
        + 2 * body.wheel_diameter_inertia_kg_m2
    )
    m11 = r * r / (4 * b * b) * (mass * b * b + inertia) + body.wheel_axle_inertia_kg_m2
    m12 = r * r / (4 * b * b) * (mass * b * b - inertia)
    return m11 + m12, m11 - m12
