"""Findings about graph and coordination: Theorem 3.1, (46), delay, sharing, time to agree.

    (46)   p²/q > max Im(ζ)² / Re(ζ) over the eigenvalues ζ ≠ 0 of L; exact for a fixed graph

p² ≥ 2 q d_max (d_max: largest in-degree Σ_j a_ij) is enough for any delay, p² ≥ 4 q d_max for any
switching between graphs whose union is rooted. Values shared now and then are held in between: what
that makes of it is `fleetloop.check.coordination`'s.
"""

from itertools import islice
from math import inf, isfinite, isnan

import numpy as np

from configs.graph import Graph
from configs.scenario import Scenario
from fleetloop.check.coordination import Forecast, Matrix, delay_margin_s, radii
from fleetloop.check.finding import Finding, Level
from fleetloop.check.law import lateral_gain_1_m, reverses
from fleetloop.settling import FINAL_S, LOST_M, SETTLE_BAND

SETTLED_PART = 0.1
"""Speed estimates have settled within this part of v_r as well, if that is less."""
FINAL_PART = 0.25
"""The end of a short run, as a part of it: there all should have settled."""
_MOST_INSTANTS = 1000
"""Graphs of a switching one that (46) is looked at for."""
_EFOLDS = 3.0
"""An error that grows for less than this many time constants stays small in a short run."""
LARGE_FLEET = 100
"""The map from share to share isn't computed for more robots."""
BACKWARDS_M = 0.05
"""A path variable that goes back by more than this is said."""


def graph_findings(scenario: Scenario, ahead: Forecast) -> list[Finding]:
    """All that follows from graph, coordination and leader."""
    graph, gains = scenario.topology, scenario.coordination
    return [
        *graph_conditions(graph),
        synchronisation(graph, gains.p, gains.q),
        delay_class(graph, gains.p, gains.q),
        _sharing(scenario, ahead),
        *_leader(scenario),
        _agreement(scenario, ahead),
        _speed_estimates(scenario, ahead),
        *_backwards(scenario, ahead),
    ]


def graph_conditions(graph: Graph) -> list[Finding]:
    """The two conditions of Theorem 3.1 on the directed graph, if it switches on the union."""
    roots = graph.roots()
    unreached = graph.unreached_from(graph.leader)
    union = "the union of all times: " if graph.switches else ""
    return [
        Finding(
            "error" if unreached else "ok",
            "leader reaches every robot",
            f"not {', '.join(unreached)}"
            if unreached
            else f"{union}through {', '.join(graph.leader)}: L + H is nonsingular, every v̂_r → v_r",
        ),
        Finding(
            "ok" if roots else "error",
            "robots' graph is rooted",
            f"{union}{', '.join(roots)} {'reaches' if len(roots) == 1 else 'reach'} all others"
            if roots
            else "no robot reaches all others: s_i − s_j would never vanish",
        ),
    ]


def synchronisation(graph: Graph, p: float, q: float) -> Finding:
    """Inequality (46), both sides; of a graph that switches, of each graph that exists in turn."""
    left, right = p * p / q, _right_side(graph)
    title = "(46) p²/q > max Im(ζ)²/Re(ζ)"
    if graph.switches:
        title += ", at each time"
    if left > right:
        return Finding("ok", title, f"{left:g} > {right:.4g}")
    least = np.sqrt(q * right)
    text = f"{left:g} is not above {right:.4g}: raise coordination.p above {least:.3g}"
    return Finding("error", title, text, key="coordination.p")


def delay_class(graph: Graph, p: float, q: float) -> Finding:
    """Margins of the coordination for delay and switching."""
    degree = graph.max_in_degree
    ratio = p * p / (q * degree) if degree else inf
    title = "p²/(q d_max), largest in-degree d_max"
    if ratio >= 4:
        return Finding("ok", title, f"{ratio:g} ≥ 4: any delay, any switching with a rooted union")
    if graph.switches:
        text = (
            f"{ratio:.3g} < 4: graphs that each pass (46) may diverge when they switch; raise"
            f" coordination.p to {2.0 * np.sqrt(q * degree):.3g}"
        )
        return Finding("warning", title, text, key="coordination.p")
    if ratio >= 2:
        return Finding("ok", title, f"{ratio:g} ≥ 2: any delay; switching graphs needs 4")
    margin_s = delay_margin_s(graph, p, q)
    stands = f"up to {margin_s:.3g} s of delay" if isfinite(margin_s) else "any constant delay"
    if isnan(margin_s):
        stands = "delay has a limit"
    text = f"{ratio:.3g} < 2: {stands} on this graph; 2 for any delay, 4 for switching"
    level: Level = "ok" if margin_s >= 1.0 else "warning"
    return Finding(level, title, text, key="coordination.p" if level != "ok" else "")


def _positive(graph: Graph, p: float, q: float) -> bool:
    return p * p >= 4.0 * q * graph.max_in_degree


def _right_side(graph: Graph) -> float:
    if graph.switches:
        instants = {one.edges: one for _, one in islice(graph.phases(), _MOST_INSTANTS)}
        return max(map(_right_side, instants.values()))
    eigenvalues = np.linalg.eigvals(graph.laplacian())
    largest = np.abs(eigenvalues).max()
    sides = [z.imag**2 / z.real for z in eigenvalues if z.real > 1e-9 * largest]
    return float(max(sides, default=0.0))


def _sharing(scenario: Scenario, ahead: Forecast) -> Finding:
    """The exact map from share to share, and values that are carried on too far or not enough."""
    gains, period_s = scenario.coordination, scenario.clock.share_period_s
    title = f"shared every {period_s:g} s"
    graph, key = scenario.topology, "clock.share_period_s"
    if not graph.edges:
        return Finding("ok", title, "the graph has no edges")
    if period_s <= gains.age_limit_s and _positive(graph, gains.p, gains.q):
        return Finding("ok", title, "p² ≥ 4 q d_max: averages, which converge at any period")
    if graph.switches:
        return Finding("ok", title, "no map from share to share: the graph switches")
    if len(graph.robots) > LARGE_FLEET:
        return Finding("ok", title, f"not looked at for more than {LARGE_FLEET} robots")
    speeds, places = radii(graph, gains.p, gains.q, period_s, gains.age_limit_s)
    said = f"spectral radius from share to share {speeds:.4g} of v̂, {places:.4g} of s and μ"
    if max(speeds, places) >= 1.0 - 1e-9:
        text = f"{said}, not below 1: the path variables don't agree; share more often, or raise p"
        # From equal starts nothing may grow for a while: numbers are all that swings there.
        lost = ahead.spread[-1] > LOST_M and ahead.spread[-1] > ahead.spread[0]
        return Finding("error" if lost else "warning", title, text, key=key)
    if period_s > gains.age_limit_s:
        text = (
            f"{said}; s_j is carried on for coordination.age_limit_s = {gains.age_limit_s:g} s only"
        )
        return Finding("warning", title, f"{text}: followers fall behind", key=key)
    return Finding("ok", title, said)


def _leader(scenario: Scenario) -> list[Finding]:
    """By (18) y_e is damped with k_2 v̄_d ṡ: it stays at ṡ = 0, and grows at ṡ < 0.

    Not with a law that follows its path backwards as well.
    """
    title = "ṡ > 0: the leader's speed"
    leader = scenario.leader
    speeds = {"leader.speed_m_s": leader.speed_m_s} | {
        f"leader.steps.{n}.speed_m_s": step.speed_m_s for n, step in enumerate(leader.steps)
    }
    key, slowest = min(speeds.items(), key=lambda item: item[1])
    if slowest < 0.0:
        controls = [scenario.control_of(robot) for robot in scenario.robot]
        controls = [one for one in controls if not reverses(one)]
        if not controls:
            return [Finding("ok", title, f"v_r ≥ {slowest:g} m/s: robots drive backwards as well")]
        k2 = max(
            (gain for one in controls if (gain := lateral_gain_1_m(one)) is not None), default=0
        )
        if not k2:
            return [Finding("ok", title, f"v_r ≥ {slowest:g} m/s; not known whether the law minds")]
        growth_s = -1.0 / (k2 * slowest)
        text = (
            f"v_r = {slowest:g} m/s: must be positive for the law, or y_e grows instead of"
            f" vanishing (18), e-fold within {growth_s:.2g} s; turn the path round to go the other"
            " way"
        )
        brief = max(scenario.duration_s, scenario.ends_at_s) < _EFOLDS * growth_s
        return [Finding("warning" if brief else "error", title, text, key=key)]
    if slowest == 0.0:
        text = (
            "v_r = 0: while they stand, robots don't come any closer to their paths sideways (18)"
        )
        if key == "leader.speed_m_s":
            return [Finding("warning", title, text, key=key)]
        return [Finding("ok", title, text)]
    return [Finding("ok", title, f"v_r ≥ {slowest:g} m/s")]


def _agreement(scenario: Scenario, ahead: Forecast) -> Finding:
    """When the path variables will have agreed, by the coordination alone."""
    return _settling(scenario, ahead, ahead.spread, "max s_i − min s_i", "m", SETTLE_BAND)


def _speed_estimates(scenario: Scenario, ahead: Forecast) -> Finding:
    """When all have the leader's speed: on dense graphs they agree long before."""
    settled = min(SETTLE_BAND, SETTLED_PART * float(np.abs(ahead.v_r).max()))
    return _settling(scenario, ahead, ahead.speed_error, "max |v̂_i − v_r|", "m/s", settled)


def _settling(
    scenario: Scenario, ahead: Forecast, error: Matrix, title: str, unit: str, settled: float
) -> Finding:
    """Whether an error of the coordination is small throughout the end of the run."""
    end_s = scenario.ends_at_s
    apart = np.flatnonzero(error > settled)
    peak = f"at most {float(error.max()):.3g} {unit}"
    if not len(apart):
        return Finding("ok", title, peak)
    last = min(int(apart[-1]) + 1, len(error) - 1)
    after = f"within {settled:.2g} {unit} after {ahead.t_s[last]:.3g} s"
    final_s = end_s - min(FINAL_S, FINAL_PART * end_s)
    if ahead.t_s[last] <= final_s and error[-1] <= settled:
        return Finding("ok", title, f"{peak}, {after}")
    if error[-1] > settled:
        after = f"still {float(error[-1]):.3g} {unit} after {ahead.t_s[-1]:.3g} s"
    text = f"{peak}, {after}: late in a run of {end_s:g} s; "
    if np.any(ahead.v_hat[0] != scenario.leader.speed_m_s):
        text += (
            f"coordination.v_hat_0 = {scenario.leader.speed_m_s:g},"
            f"{' equal s_0,' if unit == 'm' else ''} or more leader links make it quicker"
        )
        return Finding("warning", title, text, key="coordination.v_hat_0")
    return Finding("warning", title, f"{text}a longer duration_s shows it", key="duration_s")


def _backwards(scenario: Scenario, ahead: Forecast) -> list[Finding]:
    """Robots whose path variable goes back for a while, though the leader doesn't."""
    if len(ahead.t_s) < 2 or ahead.v_r.min() < 0.0:
        return []
    step_s = float(ahead.t_s[1] - ahead.t_s[0])
    back = -np.minimum(ahead.s_dot, 0.0).sum(axis=0) * step_s
    found = []
    for robot, distance in zip(scenario.robot, back.tolist(), strict=True):
        if distance <= BACKWARDS_M:
            continue
        text = f"goes back by {distance:.2g} m to meet the others"
        if reverses(scenario.control_of(robot)):
            found.append(Finding("ok", "ṡ > 0: path variables", text, (robot.name,)))
            continue
        text += ": start s_0 closer together, or let the leader stop along a longer ramp"
        key = f"robot.{robot.name}.s_0"
        found.append(Finding("warning", "ṡ > 0: path variables", text, (robot.name,), key))
    return found
