"""Findings about graph and coordination: Theorem 3.1, (46), delay, sharing, time to agree.

    (46)   p²/q > max Im(ζ)² / Re(ζ) over the eigenvalues ζ ≠ 0 of L; exact for a fixed graph

p² ≥ 2 q d_max (d_max: largest in-degree Σ_j a_ij) is enough for any delay, p² ≥ 4 q d_max for any
switching between graphs whose union is rooted. Values shared now and then are held in between: what
that makes of it is `fleetloop.check.coordination`'s.
"""

import cmath
from dataclasses import replace
from itertools import islice
from math import inf

import numpy as np

from configs.edges import presence
from configs.graph import Graph
from configs.scenario import Scenario
from fleetloop.check.coordination import Forecast, Matrix, delay_margin_s, radii
from fleetloop.check.finding import Finding, Level, resting_on
from fleetloop.law_facts import lateral_gain_1_m, reverses
from fleetloop.settling import FINAL_S, LOST_M, SETTLE_BAND

SETTLED_PART = 0.1
"""Speed estimates have settled within this part of v_r as well, if that is less."""
FINAL_PART = 0.25
"""The end of a short run, as a part of it: there all should have settled."""
_MOST_INSTANTS = 1000
"""Graphs of a switching one that (46) is looked at for."""
_EFOLDS = 3.0
"""An error that grows for less than this many time constants stays small in a short run."""
POSITIVE, SMALL_GAIN = 4.0, 2.0
"""p²/(q d_max) from which (45) averages, and from which no delay is too long."""
_AMPLE_S = 1.0
"""A margin of delay that is worth no warning of its own."""
LARGE_FLEET = 100
"""The map from share to share isn't computed for more robots."""
BACKWARDS_M = 0.05
"""A path variable that goes back by more than this is said."""


def graph_findings(scenario: Scenario, ahead: Forecast) -> list[Finding]:
    """All that follows from graph, coordination and leader."""
    graph, gains = scenario.topology, scenario.coordination
    return [
        *graph_conditions(graph),
        *_switching(scenario),
        synchronisation(graph, gains.p, gains.q),
        gain_class(graph, gains.p, gains.q),
        *resting_on("(38), (40), (45) as shared", [_sharing(scenario, ahead)]),
        *resting_on("(18)", [*_leader(scenario), *_backwards(scenario, ahead)]),
        *resting_on(
            "(38), (40), (45) of this run",
            [_agreement(scenario, ahead), _speed_estimates(scenario, ahead)],
        ),
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
            key="graph.leader" if unreached else "",
            remedy="add leader links or edges to them" if unreached else "",
            basis="Theorem 3.1",
        ),
        Finding(
            "ok" if roots else "error",
            "robots' graph is rooted",
            f"{union}{', '.join(roots)} {'reaches' if len(roots) == 1 else 'reach'} all others"
            if roots
            else "no robot reaches all others: s_i − s_j would never vanish",
            key="" if roots else "graph",
            remedy="" if roots else "add edges from one robot on, until it reaches all",
            basis="Theorem 3.1, Assumption 2.1",
        ),
    ]


def _switching(scenario: Scenario) -> list[Finding]:
    """Of a graph that switches: what holds at the start, and how long an edge stays away."""
    graph = scenario.topology
    if not graph.switches:
        return []
    now = graph.at(0)
    unreached, roots = now.unreached_from(now.leader), now.roots()
    reached = f"the leader doesn't reach {', '.join(unreached)}" if unreached else "reaches all"
    period_s = scenario.clock.control_period_s
    ticks = round(scenario.ends_at_s / period_s)
    gone_s = max(presence(edge.windows, ticks)[1] for edge in graph.in_edges) * period_s
    value = f"at the start {reached}, roots {', '.join(roots) or 'none'}"
    value += f"; an edge is gone for up to {gone_s:.3g} s"
    return [Finding("ok", "switching", value, basis="jointly rooted over a window")]


def synchronisation(graph: Graph, p: float, q: float) -> Finding:
    """Inequality (46), both sides; of a graph that switches, of each graph that exists in turn."""
    left, right = p * p / q, right_side(graph)
    title, value, limit = "p²/q > max Im(ζ)²/Re(ζ)", f"{left:g}", f"> {right:.4g}"
    if graph.switches:
        title += ", at each time"
    if left > right:
        return Finding("ok", title, value, limit=limit, basis="(46)")
    remedy = f"raise coordination.p above {np.sqrt(q * right):.3g}"
    key = "coordination.p"
    return Finding("error", title, value, key=key, limit=limit, remedy=remedy, basis="(46)")


def gain_class(graph: Graph, p: float, q: float) -> Finding:
    """Classes of p² against q d_max, and what each promises.

    ≥ 4  positive     (45) averages: consensus under any switching with a jointly rooted union
    ≥ 2  small gain   any delay with the own value fresh; string stable, |q d G(jω)| ≤ 1
    < 2  spectral     this graph as it is, by (46)
    """
    degree = graph.max_in_degree
    ratio = p * p / (q * degree) if degree else inf
    fine = Finding(
        "ok",
        "p²/(q d_max), largest in-degree d_max",
        f"{ratio:.3g}",
        limit="≥ 4: any delay, any switching with a jointly rooted union; string stable",
        basis="gain and sign of (45)",
    )
    if ratio >= POSITIVE:
        return fine
    if graph.switches:
        return replace(
            fine,
            level="warning",
            key="coordination.p",
            limit="≥ 4: graphs that each pass (46) may diverge when they switch",
            remedy=f"raise coordination.p to {np.sqrt(POSITIVE * q * degree):.3g}",
        )
    if ratio >= SMALL_GAIN:
        return replace(fine, limit="≥ 2: any delay; string stable; switching graphs needs 4")
    fine = replace(fine, limit="< 2: this graph as it is, by (46); amplifies from robot to robot")
    if delay_margin_s(graph, p, q) >= _AMPLE_S:
        return fine
    least = np.sqrt(SMALL_GAIN * q * degree)
    remedy = f'raise coordination.p to {least:.3g}, or graph.weights = "normalised"'
    limit, key = "≥ 2 for any delay, ≥ 4 for switching", "coordination.p"
    return replace(fine, level="warning", limit=limit, key=key, remedy=remedy)


def _positive(graph: Graph, p: float, q: float) -> bool:
    return p * p >= POSITIVE * q * graph.max_in_degree


def right_side(graph: Graph) -> float:
    """Max Im(ζ)²/Re(ζ) of (46); of a graph that switches the largest of its graphs."""
    if graph.switches:
        instants = {one.edges: one for _, one in islice(graph.phases(), _MOST_INSTANTS)}
        return max(map(right_side, instants.values()))
    return max((z.imag**2 / z.real for z in _other_eigenvalues(graph)), default=0.0)


def continuous_growth_1_s(graph: Graph, p: float, q: float) -> float:
    """Max Re λ of λ² + p λ + q ζ over the eigenvalues ζ ≠ 0 of L [1/s]: negative iff (46) holds."""
    return max(
        (0.5 * (cmath.sqrt(p * p - 4.0 * q * z).real - p) for z in _other_eigenvalues(graph)),
        default=-inf,
    )


def _other_eigenvalues(graph: Graph) -> list[complex]:
    """The eigenvalues ζ ≠ 0 of L."""
    eigenvalues: list[complex] = np.linalg.eigvals(graph.laplacian()).tolist()
    largest = max(map(abs, eigenvalues))
    return [z for z in map(complex, eigenvalues) if z.real > 1e-9 * largest]


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
    limit = "< 1"
    if max(speeds, places) >= 1.0 - 1e-9:
        remedy = "share more often, or raise p"
        # From equal starts nothing may grow for a while: numbers are all that swings there.
        lost = ahead.spread[-1] > LOST_M and ahead.spread[-1] > ahead.spread[0]
        level: Level = "error" if lost else "warning"
        return Finding(level, title, said, key=key, limit=limit, remedy=remedy)
    if period_s > gains.age_limit_s:
        remedy = (
            f"s_j is carried on for coordination.age_limit_s = {gains.age_limit_s:g} s only,"
            " so followers fall behind: share more often"
        )
        return Finding("warning", title, said, key=key, limit=limit, remedy=remedy)
    return Finding("ok", title, said, limit=limit)


def _leader(scenario: Scenario) -> list[Finding]:
    """By (18) y_e is damped with k_2 v̄_d ṡ: it stays at ṡ = 0, and grows at ṡ < 0.

    Not with a law that says that it follows its path backwards as well. The shipped ones don't say
    it: their σ(ṡ) (`agents.laws.dsc_terms.sense`) is for a while, and no part of Theorem 3.1.
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
        return [Finding("warning", title, text, key=key)]
    return [Finding("ok", title, f"v_r ≥ {slowest:g} m/s")]


def _agreement(scenario: Scenario, ahead: Forecast) -> Finding:
    """When the path variables will have agreed, by the coordination alone."""
    title = f"max s_i − min s_i of {len(scenario.robot)} robots"
    return _settling(scenario, ahead, ahead.spread, title, "m", SETTLE_BAND)


def _speed_estimates(scenario: Scenario, ahead: Forecast) -> Finding:
    """When all have the leader's speed: on dense graphs they agree long before."""
    settled = min(SETTLE_BAND, SETTLED_PART * float(np.abs(ahead.v_r).max()))
    return _settling(scenario, ahead, ahead.speed_error, "max |v̂_i − v_r|", "m/s", settled)


def _settling(
    scenario: Scenario, ahead: Forecast, error: Matrix, title: str, unit: str, settled: float
) -> Finding:
    """Whether an error of the coordination is small throughout the end of the run."""
    end_s = scenario.ends_at_s
    limit = f"≤ {settled:.2g} {unit} in the last {min(FINAL_S, FINAL_PART * end_s):.3g} s"
    apart = np.flatnonzero(error > settled)
    peak = f"at most {float(error.max()):.3g} {unit}"
    if not len(apart):
        return Finding("ok", title, peak, limit=limit)
    last = min(int(apart[-1]) + 1, len(error) - 1)
    after = f"within {settled:.2g} {unit} after {ahead.t_s[last]:.3g} s"
    final_s = end_s - min(FINAL_S, FINAL_PART * end_s)
    if ahead.t_s[last] <= final_s and error[-1] <= settled:
        return Finding("ok", title, f"{peak}, {after}", limit=limit)
    if error[-1] > settled:
        after = f"still {float(error[-1]):.3g} {unit} after {ahead.t_s[-1]:.3g} s"
        if ahead.t_s[-1] < final_s:
            after += ", where this forecast ends"
    value = f"{peak}, {after}"
    if np.any(ahead.v_hat[0] != scenario.leader.speed_m_s):
        remedy = (
            f"coordination.v_hat_0 = {scenario.leader.speed_m_s:g},"
            f"{' equal s_0,' if unit == 'm' else ''} or more leader links make it quicker"
        )
        key = "coordination.v_hat_0"
        return Finding("warning", title, value, key=key, limit=limit, remedy=remedy)
    remedy = "a longer duration_s shows it"
    return Finding("warning", title, value, key="duration_s", limit=limit, remedy=remedy)


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
