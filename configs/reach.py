"""Bounds of path variables and speed estimates in a scenario; values beyond are not believed.

Neighbours' v̂ are held as received, so (38) only ever averages v̂(0) and v_r:

    v̂(t) ∈ [v_min, v_max] = hull {0, v̂(0), v_r(·)}

(40) and (45) make s follow: s' = v̂ + μ, with μ from what sets the path variables apart, their
starts, μ(0), and the time τ that they need to agree on a speed:

    s(t) ∈ [min s(0) − m + v_min t,  max s(0) + m + v_max t]
    m = 1 + 2 A (max s(0) − min s(0) + |μ(0)|/p + τ (v_max − v_min))    [m]
    τ = max(1/p, 1/√(q a), p/(q a)) + T

with a ≤ 1 the least weight of an edge, of one that comes and goes times the part of the run in
which it exists, and T the longest absence of an edge. A ≥ 1 is how much an underdamped chain
(ζ < 1, ζ = p / (2 √(q d)) with in-degree d ≥ 1) amplifies from robot to robot:
coth(π ζ / (2 √(1 − ζ²))) each, `MOST_AMPLIFIED` in all. 0 is in the hull because a path variable
may stand still; v̂ is allowed as much again beyond it. The margins are generous: of 1,100 random
scenarios whose coordination settles none used more than four tenths of m, and v̂ never left the
hull.
"""

from collections.abc import Sequence
from math import exp, log, pi, sqrt, tanh
from typing import Final, NamedTuple

MOST_AMPLIFIED: Final = 250.0
LONGEST_S: Final = 1e6
POSITION_LIMIT_M: Final = 1e7
"""No pose is farther from the world's origin: a quarter of the Earth's circumference."""
HEADING_LIMIT_RAD: Final = 1e6
"""No heading, which need not be wrapped, is beyond this."""
_LEAST_DAMPING: Final = 1e-3
_LEAST_PULL_1_S2: Final = 1e-300  # what can be divided by
_LEAST_SPEED_MARGIN_M_S: Final = 0.1


def within_world(x_m: float, y_m: float, theta_rad: float) -> bool:
    """Whether a robot can be there. Nothing that isn't finite is."""
    here = abs(x_m) <= POSITION_LIMIT_M and abs(y_m) <= POSITION_LIMIT_M
    return here and abs(theta_rad) <= HEADING_LIMIT_RAD


def reached(
    t_s: float, s_min_m: float, s_max_m: float, v_min_m_s: float, v_max_m_s: float
) -> tuple[float, float]:
    """The bounds of s at a scenario time [m]."""
    since_s = max(t_s, 0.0)
    return s_min_m + v_min_m_s * since_s, s_max_m + v_max_m_s * since_s


class Reach(NamedTuple):
    """The bounds of one scenario; `beyond` and `too_fast` hold something against them."""

    s_min_m: float  # at t = 0, with its margin
    s_max_m: float
    v_min_m_s: float  # how fast the bounds of s move: hull of all speeds
    v_max_m_s: float
    v_margin_m_s: float  # of v̂, beyond the hull


def beyond(reach: Reach, t_s: float, s: float, v_hat: float) -> str | None:
    """Why no robot can say this of a time, None if one can. What isn't finite is beyond."""
    s_min_m, s_max_m, v_min_m_s, v_max_m_s, _ = reach
    low, high = reached(t_s, s_min_m, s_max_m, v_min_m_s, v_max_m_s)
    if not low <= s <= high:
        return f"s = {s:.6g} m at {t_s:.6g} s, where this scenario has {low:.6g} to {high:.6g}"
    return too_fast(reach, v_hat, "v̂")


def too_fast(reach: Reach, speed_m_s: float, what: str) -> str | None:
    """Why no speed of this scenario is this one, None if one can be."""
    _, _, v_min_m_s, v_max_m_s, margin_m_s = reach
    low, high = v_min_m_s - margin_m_s, v_max_m_s + margin_m_s
    if low <= speed_m_s <= high:
        return None
    return f"{what} = {speed_m_s:.6g} m/s, where this scenario has {low:.6g} to {high:.6g}"


def reach_of(
    starts_m: Sequence[float],
    speeds_m_s: Sequence[float],
    *,
    mu_0: float,
    p: float,
    q: float,
    max_in_degree: float,
    least_weight: float = 1.0,
    longest_absence_s: float = 0.0,
) -> Reach:
    """The bounds of a scenario.

    Args:
        starts_m: s(0) of all robots.
        speeds_m_s: v̂(0) and every v_r.
        mu_0: μ(0), of all robots [m/s].
        p: of (45) [1/s].
        q: of (45) [1/s²].
        max_in_degree: the largest Σ_j a_ij.
        least_weight: of all edges and leader links, times the part of the run that has it.
        longest_absence_s: of all edges and leader links.
    """
    v_min, v_max = min(0.0, *speeds_m_s), max(0.0, *speeds_m_s)
    pull = max(q * min(least_weight, 1.0), _LEAST_PULL_1_S2)
    agreed_s = min(max(1.0 / p, 1.0 / sqrt(pull), p / pull) + longest_absence_s, LONGEST_S)
    apart_m = max(starts_m) - min(starts_m)
    apart_m += min(abs(mu_0) / p, abs(mu_0) * LONGEST_S) + agreed_s * (v_max - v_min)
    margin_m = 1.0 + 2.0 * _amplified(p, q, max_in_degree, len(starts_m) - 1) * apart_m
    return Reach(
        s_min_m=min(starts_m) - margin_m,
        s_max_m=max(starts_m) + margin_m,
        v_min_m_s=v_min,
        v_max_m_s=v_max,
        v_margin_m_s=max(_LEAST_SPEED_MARGIN_M_S, v_max, -v_min),
    )


def _amplified(p: float, q: float, degree: float, hops: int) -> float:
    """A of `hops` robots in a row."""
    damping = max(p / (2.0 * sqrt(q) * sqrt(max(degree, 1.0))), _LEAST_DAMPING)
    if damping >= 1.0:
        return 1.0
    gain = 1.0 / tanh(pi * damping / (2.0 * sqrt(1.0 - damping * damping)))
    return exp(min(hops * log(gain), log(MOST_AMPLIFIED)))
