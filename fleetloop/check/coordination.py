"""The coordination alone, exactly as sampled: it doesn't depend on how the robots move.

Between two shares a robot's (38), (40), (45) are a linear system with held inputs V = Σ v̂_j and
S = Σ s_j + V τ, τ the age of what was heard up to `age_limit_s` (see `agents.neighbours`); its map
over any step is a matrix exponential, and the fleet's map from share to share is put together from
these by the graph:

    ρ(v̂)     spectral radius of the speed estimates' map: below 1, v̂ → v_r
    ρ(s, μ)   the same of the path variables', without the eigenvalue 1 of all s together

Delay of received values, the own value fresh: with D the in-degrees Σ a_ij, a root ±jω of
det(λ² + p λ + q D − q A e^(−λT)) = 0 gives the smallest T at which (45) oscillates.
"""

from dataclasses import dataclass
from math import ceil, inf, nan, pi

import numpy as np
from numpy.typing import NDArray

from agents.coordination import matrix_exponential
from configs.graph import Graph
from configs.scenario import Scenario
from fleetloop.results.summary import leader_speed

Matrix = NDArray[np.float64]
STEP_S = 0.02
HORIZON_S = 120.0
"""Longest forecast of path variables."""
_FREQUENCIES, _FLEET = 200_000, 40
"""Frequencies of a sweep, times robots squared; fleets larger than that aren't swept."""


def shared_map(
    graph: Graph, p: float, q: float, share_period_s: float, age_limit_s: float
) -> Matrix:
    """3 N × 3 N: all robots' v̂, then μ, then s, from one share to the next, with v_r = 0."""
    young = _one_step(graph, p, q, min(share_period_s, age_limit_s), ageing=True)
    if share_period_s <= age_limit_s:
        return _closed(graph, young)
    # Beyond the age limit S stays: two legs with the same V, the second from an older S.
    old = _one_step(graph, p, q, share_period_s - age_limit_s, ageing=False)
    joined = np.empty_like(young)
    for n, (first, second) in enumerate(zip(young, old, strict=True)):
        inputs = second[:, 3:].copy()
        inputs[:, 0] += age_limit_s * inputs[:, 1]  # S of the second leg is S + V age
        joined[n] = second[:, :3] @ first
        joined[n][:, 3:] += inputs
    return _closed(graph, joined)


def radii(
    graph: Graph, p: float, q: float, share_period_s: float, age_limit_s: float
) -> tuple[float, float]:
    """(ρ(v̂), ρ(s, μ)) of the map from share to share."""
    n = len(graph.robots)
    whole = shared_map(graph, p, q, share_period_s, age_limit_s)
    speeds = np.abs(np.linalg.eigvals(whole[:n, :n]))
    places = np.linalg.eigvals(whole[n:, n:])
    together = int(np.argmin(np.abs(places - 1.0)))
    others = np.delete(np.abs(places), together)
    return float(speeds.max()), float(others.max(initial=0.0))


def delay_margin_s(graph: Graph, p: float, q: float) -> float:
    """The delay of all that is heard at which the path variables no longer agree.

    Infinite: none; NaN: there may be one, the fleet is too large to look for it.
    """
    degree, count = graph.max_in_degree, len(graph.robots)
    if p * p >= 2.0 * q * degree:
        return inf
    if count > _FLEET:
        return nan
    sweep = min(max(_FREQUENCIES // count**2, 200), 4000)
    adjacency = graph.adjacency()
    degrees = adjacency.sum(axis=1)
    fastest = 1.05 * np.sqrt(2.0 * q * degree - p * p)  # above the root no loop is large enough
    frequencies = fastest * (np.arange(sweep) + 0.5) / sweep
    own = -(frequencies**2)[:, None] + 1j * p * frequencies[:, None] + q * degrees
    loops = np.linalg.eigvals(q * adjacency / own[:, :, None])
    # By size, so that each column is continuous: a root at jω is where one of them crosses 1.
    order = np.argsort(np.abs(loops), axis=1)
    loops = np.take_along_axis(loops, order, axis=1)
    crosses = np.diff(np.abs(loops) > 1.0, axis=0)
    delays = np.angle(loops[1:]) % (2.0 * pi) / frequencies[1:, None]
    return float(delays[crosses].min(initial=inf))


@dataclass(frozen=True, slots=True)
class Forecast:
    """Forecast of the path variables: rows are instants, columns robots."""

    t_s: Matrix
    s: Matrix
    s_dot: Matrix
    v_hat: Matrix
    v_r: Matrix

    @property
    def spread(self) -> Matrix:
        """max_i s_i − min_i s_i at every instant."""
        difference: Matrix = self.s.max(axis=1) - self.s.min(axis=1)
        return difference

    @property
    def speed_error(self) -> Matrix:
        """max_i |v̂_i − v_r| at every instant."""
        error: Matrix = np.abs(self.v_hat - self.v_r[:, None]).max(axis=1)
        return error


def forecast(scenario: Scenario) -> Forecast:
    """The path variables of a scenario, up to its end or `HORIZON_S`."""
    graph, gains, clock = scenario.topology, scenario.coordination, scenario.clock
    per_share = ceil(clock.share_period_s / STEP_S - 1e-9)
    step_s = clock.share_period_s / per_share
    steps = max(ceil(min(max(scenario.duration_s, scenario.ends_at_s), HORIZON_S) / step_s), 1) + 1
    young = _one_step(graph, gains.p, gains.q, step_s, ageing=True)
    old = _one_step(graph, gains.p, gains.q, step_s, ageing=False)
    adjacency = graph.adjacency()
    count = len(graph.robots)
    state = np.zeros((count, 3))
    state[:, 0], state[:, 1] = gains.v_hat_0, gains.mu_0
    state[:, 2] = [robot.s_0 for robot in scenario.robot]
    times: Matrix = np.arange(steps, dtype=np.float64) * step_s
    speeds = leader_speed(scenario)(np.round(times * 1e9))
    states = np.empty((steps, count, 3))
    heard = np.zeros((count, 2))
    for n in range(steps):
        states[n] = state
        if n % per_share == 0:
            heard = adjacency @ state[:, [0, 2]]
            age_s = 0.0
        ageing = age_s < gains.age_limit_s
        table = young if ageing else old
        inputs = np.column_stack([state, heard, np.full(count, speeds[n])])
        state = np.einsum("nij,nj->ni", table, inputs)
        age_s += step_s
        if ageing:
            heard = heard + heard[:, :1] * np.array([0.0, step_s])
    v_hat, mu, s = (states[:, :, n] for n in range(3))
    return Forecast(times, s, v_hat + mu, v_hat, speeds)


def _one_step(graph: Graph, p: float, q: float, step_s: float, *, ageing: bool) -> Matrix:
    """(N, 3, 6): each robot's (v̂, μ, s) after a step from (v̂, μ, s, V, S, v_r)."""
    tables = {}
    rows = []
    for robot in graph.robots:
        link = graph.links.get(robot)
        kind = graph.in_degree(robot), link.weight if link else 0.0
        if kind not in tables:
            tables[kind] = _map(*kind, p, q, step_s, ageing=ageing)
        rows.append(tables[kind])
    return np.array(rows)


def _map(degree: float, h: float, p: float, q: float, step_s: float, *, ageing: bool) -> Matrix:
    generator = np.zeros((6, 6))
    generator[0, [0, 3, 5]] = -(degree + h), 1.0, h
    generator[1, [1, 2, 4]] = -p, -q * degree, q
    generator[2, :2] = 1.0
    generator[4, 3] = float(ageing)
    return np.array(matrix_exponential((generator * step_s).tolist()))[:3]


def _closed(graph: Graph, tables: Matrix) -> Matrix:
    """The fleet's map from the robots' own, their inputs taken from the graph."""
    n = len(graph.robots)
    adjacency, own = graph.adjacency(), np.arange(n)
    whole = np.zeros((3, n, 3, n))
    for to in range(3):
        for of in range(3):
            whole[to, own, of, own] = tables[:, to, of]
        whole[to, :, 0] += tables[:, to, 3, None] * adjacency
        whole[to, :, 2] += tables[:, to, 4, None] * adjacency
    return whole.reshape(3 * n, 3 * n)
