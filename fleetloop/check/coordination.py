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
from math import ceil, inf, log, log2, nan, pi

import numpy as np
from numpy.typing import NDArray

from configs.graph import Graph
from configs.scenario import Scenario
from fleetloop.results.derived import spread_of
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


def sampled_growth_1_s(
    graph: Graph, p: float, q: float, share_period_s: float, age_limit_s: float
) -> float:
    """Growth ln ρ(s, μ)/T [1/s], T the share period: above 0 the path variables drift apart."""
    _, places = radii(graph, p, q, share_period_s, age_limit_s)
    return log(places) / share_period_s if places > 0.0 else -inf


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
    there: NDArray[np.bool_]  # members of the formation

    @property
    def spread(self) -> Matrix:
        """max_i s_i − min_i s_i over the members at every instant."""
        return spread_of(self.s, self.there)

    @property
    def speed_error(self) -> Matrix:
        """max_i |v̂_i − v_r| over the members at every instant."""
        apart: Matrix = np.where(self.there, np.abs(self.v_hat - self.v_r[:, None]), 0.0)
        error: Matrix = apart.max(axis=1)
        return error


def forecast(scenario: Scenario) -> Forecast:
    """The path variables of a scenario, up to its end or `HORIZON_S`."""
    graph, gains, clock = scenario.topology, scenario.coordination, scenario.clock
    per_share = ceil(clock.share_period_s / STEP_S - 1e-9)
    step_s = clock.share_period_s / per_share
    steps = max(ceil(min(max(scenario.duration_s, scenario.ends_at_s), HORIZON_S) / step_s), 1) + 1
    coupling = _Coupling(graph, gains.p, gains.q, step_s)
    count = len(graph.robots)
    state = np.zeros((count, 3))
    state[:, 0], state[:, 1] = gains.v_hat_0, gains.mu_0
    state[:, 2] = [robot.s_0 for robot in scenario.robot]
    times: Matrix = np.arange(steps, dtype=np.float64) * step_s
    speeds = leader_speed(scenario)(np.round(times * 1e9))
    states = np.empty((steps, count, 3))
    ticks = np.rint(times / clock.control_period_s)
    joins, leaves = np.array([(m.joins_tick, m.leaves_tick) for m in scenario.members.values()]).T
    told = state
    for n in range(steps):
        states[n] = state
        shares = n % per_share == 0
        coupling.advance(int(ticks[n]), shares=shares)
        if shares:
            told, age_s = state, 0.0
        carried_on_s = min(age_s, gains.age_limit_s)
        said = np.column_stack([told[:, 0], told[:, 2] + told[:, 0] * carried_on_s])
        inputs = np.column_stack([state, coupling.heard @ said, np.full(count, speeds[n])])
        table = coupling.tables(ageing=age_s < gains.age_limit_s)
        state = np.einsum("nij,nj->ni", table, inputs)
        age_s += step_s
        if (waiting := ticks[n] < joins).any():
            told_s = told[:, 2] + told[:, 0] * min(age_s, gains.age_limit_s)
            mean = coupling.joining(told[:, 0], told_s, speeds[n])
            state = np.where((waiting & coupling.hears)[:, None], mean, state)
            state = np.where((waiting & ~coupling.hears)[:, None], states[0], state)
        state[ticks[n] >= leaves, :2] = 0.0
    v_hat, mu, s = (states[:, :, n] for n in range(3))
    return Forecast(times, s, v_hat + mu, v_hat, speeds, members_at(scenario, times))


def members_at(scenario: Scenario, t_s: Matrix) -> NDArray[np.bool_]:
    """(instants, robots): who is a member of the formation."""
    ticks = np.rint(t_s / scenario.clock.control_period_s)[:, None]
    joins, leaves = np.array([(m.joins_tick, m.leaves_tick) for m in scenario.members.values()]).T
    there: NDArray[np.bool_] = (ticks >= joins) & (ticks < leaves)
    return there


class _Coupling:
    """The coupling of the robots in the course of a forecast, as edges come and go."""

    def __init__(self, graph: Graph, p: float, q: float, step_s: float) -> None:
        self._phases = graph.phases()
        self._gains = p, q, step_s
        self._next: tuple[int, Graph] | None = next(self._phases)
        self._tables: dict[bool, Matrix] = {}
        self._maps: dict[tuple[float, float, bool], Matrix] = {}
        self._there, self._h = graph.adjacency(), np.zeros(len(graph.robots))
        self.heard: Matrix = np.zeros_like(self._there)
        """a_ij of the edges that exist and over which something was said since they do."""

    def advance(self, tick: int, *, shares: bool) -> None:
        """Go on to a tick; at a share, all that exists is heard."""
        before = self.heard
        while self._next is not None and self._next[0] <= tick:
            now = self._next[1]
            self._there, self._h = now.adjacency(), _links(now)
            self.heard = np.where(self._there > 0.0, self.heard, 0.0)
            self._next = next(self._phases, None)
            self._tables = {}
        if shares:
            self.heard = self._there
        if self.heard is not before:
            self._tables = {}

    @property
    def hears(self) -> NDArray[np.bool_]:
        """Robots that hear a neighbour."""
        hears: NDArray[np.bool_] = self.heard.sum(axis=1) > 0.0
        return hears

    def joining(self, v_hat: Matrix, s: Matrix, v_r: float) -> Matrix:
        """(N, 3): (v̂, μ, s) of robots that join, of those that hear (`agents.joining`)."""
        degree = np.where(self.hears, self.heard.sum(axis=1), 1.0)
        speed = (self.heard @ v_hat + self._h * v_r) / (degree + self._h)
        return np.column_stack([speed, np.zeros_like(speed), self.heard @ s / degree])

    def tables(self, *, ageing: bool) -> Matrix:
        """As `_one_step`, of what is heard."""
        if ageing not in self._tables:
            kinds = zip(self.heard.sum(axis=1).tolist(), self._h.tolist(), strict=True)
            self._tables[ageing] = np.array([self._map(d, h, ageing) for d, h in kinds])
        return self._tables[ageing]

    def _map(self, degree: float, h: float, ageing: bool) -> Matrix:
        kind = degree, h, ageing
        if kind not in self._maps:
            self._maps[kind] = _map(degree, h, *self._gains, ageing=ageing)
        return self._maps[kind]


def _links(graph: Graph) -> Matrix:
    """h_i of all robots."""
    return np.array([graph.links[r].weight if r in graph.links else 0.0 for r in graph.robots])


def _one_step(graph: Graph, p: float, q: float, step_s: float, *, ageing: bool) -> Matrix:
    """(N, 3, 6): each robot's (v̂, μ, s) after a step from (v̂, μ, s, V, S, v_r)."""
    tables = {}
    rows = []
    for kind in zip(map(graph.in_degree, graph.robots), _links(graph).tolist(), strict=True):
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
    return _exponential(generator * step_s)[:3]


def _exponential(a: Matrix) -> Matrix:
    """exp(a) as `agents.coordination.matrix_exponential`, in less than a tenth of its time."""
    norm = float(np.abs(a).sum(axis=1).max())
    squarings = max(ceil(log2(norm / 0.125)), 0) if norm > 0.0 else 0
    scaled = a * 0.5**squarings
    term = np.eye(len(a))
    result = term.copy()
    for order in range(1, 16):
        term = term @ scaled / order
        result += term
    for _ in range(squarings):
        result = result @ result
    return result


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
