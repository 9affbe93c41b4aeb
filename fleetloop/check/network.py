"""Findings about the network: ages of path states, edges that carry nothing, delay margin, bias.

Mean age of what a robot knows of another, of messages shared every P, lost with probability l:

    T = E[delay] + P (1/2 + Σ_{n ≥ 1} P(the newest n are lost)) = E[delay] + P (1/2 + l/(1 − l)) (1)

of the Gilbert-Elliott chain Σ = π Q (I − Q)⁻¹ 1, Q its steps on which a message is lost. With
the own value fresh, (45) stands any delay if p² ≥ 2 q d_max, else up to the first crossing of
`fleetloop.check.coordination.delay_margin_s`. With the own value as old as the neighbour's up to

    T* = min_{ζ ≠ 0} (atan(p/w) − |arg ζ|) / w,   w² = (−p² + √(p⁴ + 4 q² |ζ|²)) / 2             (2)

and held values leave, m_i = Σ_j a_ij T_ij, β the left null vector of L with Σ β_i = 1,

    c = −q v_r βᵀm / (p + q βᵀm)  in speed,     L σ = −(p c/q) 1 − (v_r + c) m  in s             (3)
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import atan2, inf, isfinite, isnan, sqrt

import numpy as np

from bridge.netem.channel import MESSAGE_BYTES, QUEUE_MESSAGES
from configs.edges import LEADER, Edge
from configs.emulated_edges import EmulatedEdge, effects_of
from configs.graph import Graph
from configs.netem import (
    BernoulliLoss,
    ConstantDelay,
    Delay,
    Effects,
    GilbertElliottLoss,
    LognormalDelay,
    NormalDelay,
    TraceDelay,
    UniformDelay,
)
from configs.scenario import Scenario
from fleetloop.check.coordination import Forecast, Matrix, delay_margin_s
from fleetloop.check.emulated import EmulatedForecast
from fleetloop.check.finding import Finding, Level
from fleetloop.check.graph import POSITIVE, SMALL_GAIN, graph_conditions
from fleetloop.settling import LOST_M, SETTLE_BAND

CARRIES_PART = 0.9
"""Of a run's time in which a neighbour counts: below it the graph comes and goes."""


def network_findings(scenario: Scenario, ahead: Forecast) -> Iterator[Finding]:
    """All that follows from delays, losses and the compensation of ages."""
    if not scenario.topology.edges:
        return
    ages_s = mean_ages_s(scenario)
    yield _ages(scenario, ahead, ages_s)
    if isinstance(ahead, EmulatedForecast):
        yield from _carried(scenario, ahead)
    yield _margin(scenario, ahead, ages_s)
    if scenario.coordination.compensation == "hold":
        yield _bias(scenario, ages_s)


def mean_ages_s(scenario: Scenario) -> dict[Edge, float]:
    """(1) for each edge between robots."""
    period_s = scenario.clock.share_period_s
    return {
        edge: mean_age_s(effects_of(scenario.network, EmulatedEdge(*edge)), period_s)
        for edge in scenario.topology.edges
    }


def mean_age_s(effects: Effects, period_s: float) -> float:
    """(1), reordering left out: with it, newer messages overtake and ages are a little less."""
    delay_s, lost = mean_delay_s(effects.delay), _all_lost(effects)
    if effects.bandwidth_bit_s:
        sending_s = 8 * (effects.message_bytes or MESSAGE_BYTES) / effects.bandwidth_bit_s
        waiting = effects.queue_messages or QUEUE_MESSAGES if sending_s > period_s else 0
        delay_s += sending_s * (1 + waiting)
        period_s = max(period_s, sending_s)
    return inf if lost == inf else delay_s + period_s * (0.5 + lost)


def mean_delay_s(delay: Delay | None) -> float:
    """Mean of the messages that arrive; of a normal delay before negative draws become 0."""
    match delay:
        case None:
            return 0.0
        case ConstantDelay():
            return delay.delay_s
        case UniformDelay():
            return 0.5 * (delay.min_s + delay.max_s)
        case NormalDelay() | LognormalDelay():
            return delay.mean_s
        case TraceDelay():
            arrived = [one for one in delay.delays_s if one >= 0.0]
            return float(np.mean(arrived)) if arrived else inf


def _all_lost(effects: Effects) -> float:
    """Σ_{n ≥ 1} P(the newest n messages are lost): mean number of losses since the last arrival."""
    of_trace, loss = 0.0, effects.loss
    if isinstance(effects.delay, TraceDelay):
        lost_ones = [one < 0.0 for one in effects.delay.delays_s]
        of_trace = float(np.mean(lost_ones))
        if loss is None:
            return _since_arrival(lost_ones)
    match loss:
        case GilbertElliottLoss():
            change = np.array(
                [
                    [1.0 - loss.good_to_bad, loss.good_to_bad],
                    [loss.bad_to_good, 1.0 - loss.bad_to_good],
                ]
            )
            lost = np.array([loss.loss_in_good, loss.loss_in_bad])
            bad = loss.good_to_bad / (loss.good_to_bad + loss.bad_to_good)
        case BernoulliLoss():
            change, lost, bad = np.eye(2), np.full(2, loss.probability), 0.0
        case _:
            change, lost, bad = np.eye(2), np.zeros(2), 0.0
    lost = 1.0 - (1.0 - lost) * (1.0 - of_trace)
    step = lost[:, None] * change
    if np.abs(np.linalg.eigvals(step)).max() >= 1.0 - 1e-12:
        return inf
    return float(np.array([1.0 - bad, bad]) @ step @ np.linalg.solve(np.eye(2) - step, np.ones(2)))


def _since_arrival(lost: Sequence[bool]) -> float:
    """Mean number of losses since the last arrival, in a row that repeats without end."""
    if all(lost):
        return inf
    since, waiting = 0, []
    for one in (*lost, *lost):
        since = since + 1 if one else 0
        waiting.append(since)
    return float(np.mean(waiting[len(lost) :]))


def data_delay_margin_s(graph: Graph, p: float, q: float) -> float:
    """(2): the margin with own and neighbour's value of the same age."""
    margins = [inf]
    for zeta in np.linalg.eigvals(graph.laplacian()).tolist():
        size = abs(zeta)
        if size > 1e-9:
            w = sqrt(0.5 * (sqrt(p**4 + 4.0 * (q * size) ** 2) - p * p))
            margins.append((atan2(p, w) - abs(atan2(zeta.imag, zeta.real))) / w)
    return min(margins)


def age_margin_s(scenario: Scenario) -> float:
    """The mean age at which (45) oscillates, by its compensation; NaN: the fleet is too large."""
    gains, graph = scenario.coordination, scenario.topology
    margin = data_delay_margin_s if gains.compensation == "both" else delay_margin_s
    return margin(graph, gains.p, gains.q)


@dataclass(frozen=True, slots=True)
class Bias:
    """(3): what held values leave in the end."""

    speed_m_s: float
    spread_m: float


def hold_bias(
    graph: Graph, ages_s: dict[Edge, float], p: float, q: float, v_r: float
) -> Bias | None:
    """(3); None if the graph isn't rooted."""
    laplacian, robots = graph.laplacian(), graph.robots
    late = np.array(
        [sum(edge.weight * ages_s[edge.speaker, i] for edge in graph.hears[i]) for i in robots]
    )
    if not graph.roots() or not np.isfinite(late).all():
        return None
    beta: Matrix = np.linalg.svd(laplacian.T)[2][-1]
    mean = float(beta @ late / beta.sum())
    slower = -q * v_r * mean / (p + q * mean)
    apart = np.linalg.lstsq(laplacian, -p * slower / q - (v_r + slower) * late, rcond=None)[0]
    return Bias(slower, float(apart.max() - apart.min()))


def _ages(scenario: Scenario, ahead: Forecast, ages_s: dict[Edge, float]) -> Finding:
    """Mean ages by (1), and the largest one of this run."""
    gains = scenario.coordination
    edge = max(ages_s, key=lambda one: ages_s[one])
    title, basis = "age of path states", "delay + half a share period + losses"
    value = f"mean {ages_s[edge]:.3g} s, {edge[0]} -> {edge[1]}"
    compensated = gains.compensation != "hold"
    bound_s = gains.age_limit_s if compensated else gains.silence_limit_s
    key = f"coordination.{'age' if compensated else 'silence'}_limit_s"
    limit, remedy = f"≤ {bound_s:g} s, {key}", ""
    level: Level = "ok"
    most_s = ages_s[edge]
    if isinstance(ahead, EmulatedForecast):
        ages = ahead.age_s[:, : len(ages_s)]
        most_s = max(ages[ages >= 0.0].tolist(), default=most_s)
        value += f"; up to {most_s:.3g} s in this run"
    if most_s > bound_s:
        level = "warning"
        remedy = "raise it, share more often, or lose less: older values aren't carried on"
    return Finding(
        level, title, value, key=key if remedy else "", limit=limit, remedy=remedy, basis=basis
    )


def _carried(scenario: Scenario, ahead: EmulatedForecast) -> Iterator[Finding]:
    """The graph of the edges that carry something: a neighbour silent for long doesn't count."""
    graph, silence_s = scenario.topology, scenario.coordination.silence_limit_s
    after = ahead.t_s > silence_s
    if not after.any():
        return
    counts = (ahead.age_s[after] <= silence_s).mean(axis=0)
    parts = dict(zip(ahead.edges, counts.tolist(), strict=True))
    alive = [edge for edge in graph.edges if parts[edge] > 0.0]
    links = [robot for robot in graph.leader if parts.get((LEADER, robot), 1.0) > 0.0]
    arriving = Graph.of(graph.robots, alive, links)
    dead = [f"{a} -> {b}" for (a, b), part in parts.items() if part == 0.0]
    for finding in graph_conditions(arriving) if dead else ():
        value = f"{', '.join(dead)} carry nothing younger than {silence_s:g} s: {finding.value}"
        level: Level = "warning" if finding.level == "ok" else "error"
        yield Finding(
            level,
            f"{finding.title}, by what arrives",
            value,
            key="network",
            remedy="shorter delays, or a larger coordination.silence_limit_s",
            basis=finding.basis,
        )
    yield from _come_and_go(scenario, parts)


def _come_and_go(scenario: Scenario, parts: dict[Edge, float]) -> Iterator[Finding]:
    """Edges that count in a part of the time only: the graph switches at random."""
    graph, gains = scenario.topology, scenario.coordination
    some = [edge for edge, part in parts.items() if 0.0 < part < CARRIES_PART]
    if some and gains.p**2 < POSITIVE * gains.q * graph.max_in_degree:
        edge = min(some, key=lambda one: parts[one])
        yield Finding(
            "warning",
            "edges come and go",
            f"{edge[0]} -> {edge[1]} counts in {parts[edge]:.0%} of the time",
            key="coordination.p",
            limit=f"≥ {CARRIES_PART:.0%}",
            remedy="raise it until p² ≥ 4 q d_max, which covers switching, or lose less",
            basis="(45) switched",
        )


def _margin(scenario: Scenario, ahead: Forecast, ages_s: dict[Edge, float]) -> Finding:
    """The delay at which (45) oscillates, against the ages; exact for equal constant delays."""
    gains, graph = scenario.coordination, scenario.topology
    both, margin_s = gains.compensation == "both", age_margin_s(scenario)
    title = f"delay margin with {gains.compensation}"
    basis = "T* of the spectrum" if both else "p² ≥ 2 q d_max, or frequency sweep of (45)"
    most_s = max(ages_s.values())
    value = f"{margin_s:.3g} s" if isfinite(margin_s) else "any constant delay"
    if isnan(margin_s):
        value = "not looked for: the fleet is large"
        return Finding("ok", title, value, basis=basis)
    limit = f"> {most_s:.3g} s, the mean age" if isfinite(margin_s) else ""
    if margin_s == inf or margin_s > 1.25 * most_s:
        return Finding("ok", title, value, limit=limit, basis=basis)
    lost = ahead.spread[-1] > LOST_M and ahead.spread[-1] > ahead.spread[0]
    level: Level = "error" if margin_s <= most_s and lost else "warning"
    remedy = 'compensation = "extrapolate", or ' if both else ""
    remedy += f"p ≥ {sqrt(SMALL_GAIN * gains.q * graph.max_in_degree):.3g}, shorter delays"
    return Finding(level, title, value, key="coordination", limit=limit, remedy=remedy, basis=basis)


def _bias(scenario: Scenario, ages_s: dict[Edge, float]) -> Finding:
    """What `hold` leaves at the leader's final speed."""
    gains = scenario.coordination
    v_r = (scenario.leader.steps or (scenario.leader,))[-1].speed_m_s
    found = hold_bias(scenario.topology, ages_s, gains.p, gains.q, v_r)
    title, basis = 'bias of compensation = "hold"', "(45) with ages, steady"
    if found is None:
        return Finding("warning", title, "without end", basis=basis)
    value = f"spread {found.spread_m:.3g} m, speed {found.speed_m_s + 0.0:+.3g} m/s"
    limit = f"≤ {SETTLE_BAND:g} m and m/s"
    if max(found.spread_m, abs(found.speed_m_s)) <= SETTLE_BAND:
        return Finding("ok", title, value, limit=limit, basis=basis)
    key, remedy = "coordination.compensation", '"extrapolate" leaves none'
    return Finding("warning", title, value, key=key, limit=limit, remedy=remedy, basis=basis)
