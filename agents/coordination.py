"""Coordination: speed estimate and path variable from the neighbours' path states, eqs (38)-(48).

    v̂' = −Σ a_ij (v̂ − v̂_j) − h_i (v̂ − v_r)                                      (38)
    μ' = −p μ − q Σ a_ij (s − s_j)                                              (45)
    s' = μ + v̂                                                                  (40)

With d = Σ a_ij, S = Σ a_ij s_j and V = Σ a_ij v̂_j held over a period, this is a constant linear
system of three states; it is advanced by its matrix exponential, so the only sampling error is the
change of S and V within a period (see `agents.neighbours`). The coordination does not depend on the
robot's motion. The equations are functions of numbers, which the batch kernel of sweeps compiles as
they stand.

    v̂ [m/s]   μ [m/s]   s [m]   p [1/s]   q [1/s²]   a_ij, h_i [1/s], 0: not heard
"""

from math import isfinite, nan
from typing import Final

from agents.laws.values import Values
from agents.neighbours import Sums
from configs.sections import Coordination

Matrix = list[list[float]]
Three = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
Map = tuple[Three, Six, Six]
"""The coordination over one period, linear in its state and in what is heard: v̂ from v̂, V and v_r,
μ and s from v̂, μ, s, V, v_r and S."""
MOST_MAPS: Final = 256
"""Maps kept, one for each d and h_i: many neighbours that come and go make more."""


def advanced(
    rows: Map, v_hat: float, mu: float, s: float, sum_s: float, sum_v: float, v_r: float
) -> tuple[float, float, float]:
    """v̂, μ and s after the period of the map, with S, V and v_r held."""
    (v_v, v_in, v_r_in), (mu_v, mu_mu, mu_s, mu_V, mu_r, mu_S), last = rows
    s_v, s_mu, s_s, s_V, s_r, s_S = last
    return (
        v_v * v_hat + v_in * sum_v + v_r_in * v_r,
        mu_v * v_hat + mu_mu * mu + mu_s * s + mu_V * sum_v + mu_r * v_r + mu_S * sum_s,
        s_v * v_hat + s_mu * mu + s_s * s + s_V * sum_v + s_r * v_r + s_S * sum_s,
    )


class CoordinationState(Values):
    """A robot's estimate of the common motion: v̂ [m/s], μ [m/s], s [m]."""

    __slots__ = ("mu", "s", "v_hat")

    def __init__(self, v_hat: float, mu: float, s: float) -> None:
        self.v_hat: Final = v_hat
        self.mu: Final = mu
        self.s: Final = s

    def in_order(self) -> Three:
        """All values, in the order of the constructor's arguments."""
        return self.v_hat, self.mu, self.s


class Coordinator:
    """Advances (38), (40), (45) by one control period."""

    __slots__ = ("_coordination", "_degree", "_h", "_map", "_maps", "_period_s")

    def __init__(self, coordination: Coordination, period_s: float) -> None:
        self._coordination = coordination
        self._period_s = period_s
        self._maps: dict[tuple[float, float], Map] = {}
        self._degree = self._h = 0.0
        self._map = self._map_of(0.0, 0.0)

    def advance(
        self, state: CoordinationState, sums: Sums, h: float, v_r: float
    ) -> CoordinationState:
        """State after one period, heard: the sums over neighbours, and v_r with weight h."""
        degree = sums.degree
        if degree != self._degree or h != self._h:
            self._degree, self._h, self._map = degree, h, self._map_of(degree, h)
        v_hat, mu, s = advanced(self._map, state.v_hat, state.mu, state.s, sums.s, sums.v, v_r)
        return CoordinationState(v_hat, mu, s)

    def _map_of(self, degree: float, h: float) -> Map:
        rows = self._maps.get((degree, h))
        if rows is None:
            if len(self._maps) >= MOST_MAPS:
                self._maps.clear()
            p, q = self._coordination.p, self._coordination.q
            rows = self._maps[degree, h] = period_map(p, q, degree, h, self._period_s)
        return rows


def period_map(p: float, q: float, degree: float, h: float, period_s: float) -> Map:
    """The map of one period: exp([A B; 0 0] h) for states (v̂, μ, s) and inputs (V, v_r, S)."""
    t = period_s
    generator = [
        [-(degree + h) * t, 0.0, 0.0, 1.0 * t, h * t, 0.0],
        [0.0, -p * t, -q * degree * t, 0.0, 0.0, q * t],
        [1.0 * t, 1.0 * t, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    ]
    rows = matrix_exponential(generator)
    v, mu, s = rows[0], rows[1], rows[2]
    return (
        (v[0], v[3], v[4]),
        (mu[0], mu[1], mu[2], mu[3], mu[4], mu[5]),
        (s[0], s[1], s[2], s[3], s[4], s[5]),
    )


def matrix_exponential(a: Matrix) -> Matrix:
    """exp(a) by scaling and squaring of its Taylor series; for small matrices.

    All entries are NaN if an entry of `a` isn't finite.
    """
    size = len(a)
    norm = 0.0
    for row in a:
        total = 0.0
        for x in row:
            total += abs(x)
        if total > norm or not isfinite(total):
            norm = total
    if not isfinite(norm):
        return [[nan for _ in range(size)] for _ in range(size)]
    squarings = 0
    while norm > 0.125:
        norm /= 2.0
        squarings += 1
    scale = 0.5**squarings
    scaled = [[x * scale for x in row] for row in a]
    result = [[1.0 if i == j else 0.0 for j in range(size)] for i in range(size)]
    term = [[1.0 if i == j else 0.0 for j in range(size)] for i in range(size)]
    for order in range(1, 16):
        term = [[x / order for x in row] for row in _product(term, scaled)]
        result = [[result[i][j] + term[i][j] for j in range(size)] for i in range(size)]
    for _ in range(squarings):
        result = _product(result, result)
    return result


def _product(a: Matrix, b: Matrix) -> Matrix:
    size = len(a)
    product = [[0.0] * size for _ in range(size)]
    for i in range(size):
        row, of = product[i], a[i]
        for k in range(size):
            factor, by = of[k], b[k]
            for j in range(size):
                row[j] += factor * by[j]
    return product
