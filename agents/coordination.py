"""Coordination: speed estimate and path variable from the neighbours' path states, eqs (38)-(48).

    v̂' = −Σ a_ij (v̂ − v̂_j) − h_i (v̂ − v_r)                                      (38)
    μ' = −p μ − q Σ a_ij (s − s_j)                                              (45)
    s' = μ + v̂                                                                  (40)

With n = Σ a_ij neighbours, S = Σ a_ij s_j and V = Σ a_ij v̂_j held over a period, this is a constant
linear system of three states; it is advanced by its matrix exponential, so the only sampling error
is the change of S and V within a period (see `agents.neighbours`). The coordination does not depend
on the robot's motion.

    v̂ [m/s]   μ [m/s]   s [m]   p [1/s]   q [1/s²]   h_i ∈ {0, 1}
"""

from math import isfinite, nan
from typing import NamedTuple

from configs.sections import Coordination

Matrix = list[list[float]]
_new = tuple.__new__  # of a named tuple, past its constructor: this is the hot path


class CoordinationState(NamedTuple):
    """A robot's estimate of the common motion: v̂ [m/s], μ [m/s], s [m]."""

    v_hat: float
    mu: float
    s: float


class Coordinator:
    """Advances (38), (40), (45) by one control period."""

    __slots__ = ("_coordination", "_hears_leader", "_maps", "_period_s")

    def __init__(self, coordination: Coordination, period_s: float, hears_leader: bool) -> None:
        self._coordination = coordination
        self._period_s = period_s
        self._hears_leader = hears_leader
        self._maps: dict[int, tuple[tuple[float, ...], ...]] = {}

    def advance(
        self, state: CoordinationState, n: int, sum_s: float, sum_v: float, v_r: float
    ) -> CoordinationState:
        """State after one period: n neighbours with Σ s_j and Σ v̂_j, leader speed v_r."""
        rows = self._maps.get(n)
        if rows is None:
            rows = self._maps[n] = self._map(n)
        v_hat, mu, s = state
        (v_v, v_in, v_r_in), (mu_v, mu_mu, mu_s, mu_V, mu_r, mu_S), last = rows
        s_v, s_mu, s_s, s_V, s_r, s_S = last
        after = (
            v_v * v_hat + v_in * sum_v + v_r_in * v_r,
            mu_v * v_hat + mu_mu * mu + mu_s * s + mu_V * sum_v + mu_r * v_r + mu_S * sum_s,
            s_v * v_hat + s_mu * mu + s_s * s + s_V * sum_v + s_r * v_r + s_S * sum_s,
        )
        return _new(CoordinationState, after)

    def _map(self, n: int) -> tuple[tuple[float, ...], ...]:
        """Rows of exp([A B; 0 0] h) for states (v̂, μ, s) and inputs (V, v_r, S)."""
        p, q, h = self._coordination.p, self._coordination.q, float(self._hears_leader)
        t = self._period_s
        generator = [
            [-(n + h) * t, 0.0, 0.0, 1.0 * t, h * t, 0.0],
            [0.0, -p * t, -q * n * t, 0.0, 0.0, q * t],
            [1.0 * t, 1.0 * t, 0.0, 0.0, 0.0, 0.0],
            [0.0] * 6,
            [0.0] * 6,
            [0.0] * 6,
        ]
        v, mu, s = matrix_exponential(generator)[:3]
        return (v[0], v[3], v[4]), tuple(mu), tuple(s)


def matrix_exponential(a: Matrix) -> Matrix:
    """exp(a) by scaling and squaring of its Taylor series; for small matrices.

    All entries are NaN if an entry of `a` isn't finite.
    """
    size = len(a)
    norm = max(sum(abs(x) for x in row) for row in a)
    if not isfinite(norm):
        return [[nan] * size] * size
    squarings = 0
    while norm > 0.125:
        norm /= 2.0
        squarings += 1
    scale = 0.5**squarings
    scaled = [[x * scale for x in row] for row in a]
    identity = [[float(i == j) for j in range(size)] for i in range(size)]
    result, term = identity, identity
    for order in range(1, 16):
        term = [[x / order for x in row] for row in _product(term, scaled)]
        result = [
            [x + y for x, y in zip(r, t, strict=True)] for r, t in zip(result, term, strict=True)
        ]
    for _ in range(squarings):
        result = _product(result, result)
    return result


def _product(a: Matrix, b: Matrix) -> Matrix:
    columns = list(zip(*b, strict=True))
    return [[sum(x * y for x, y in zip(row, col, strict=True)) for col in columns] for row in a]
