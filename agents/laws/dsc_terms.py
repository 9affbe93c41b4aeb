"""Terms that dynamic surface laws share: filters, projection (35), wheel torques (3).

A filter γ α' + α = ᾱ moves by (1 − e^(−h/γ)) (ᾱ − α) over a period h with its input held, exactly.

The paper prints `proj` of (35) without the factor π in its conditions; with it, as in its reference
[26], both sides are projected: with Ξ(σ̂) = (σ̂² − σ_M²)/(k² + 2 k σ_M),

    proj(π, σ̂) = (1 − Ξ) π   if Ξ > 0 and σ̂ π > 0,   else π

which keeps |σ̂| ≤ σ_M + k; a clip to that bound guards against a long sampling period.

By (18), (22) and (55) y_e is damped with v̄_d ṡ sin(θ̄), θ̄ = −atan(k_2 y_e) of (17): only for ṡ > 0.
At ṡ = 0 the robot stands and y_e stays; at ṡ < 0 the paper's y_e grows. So (17) has σ(ṡ) y_e for
y_e, σ the sense in which the path is followed, and the product is damped in both:

    σ(ṡ) = 1 for ṡ ≥ 0 (the paper's law unchanged),  −1 for ṡ ≤ −`REVERSE_M_S`, linear in between
"""

from dataclasses import dataclass
from math import exp
from typing import NamedTuple

from configs.parameters import Finite, Parameters, Positive, Seconds, parameter

REVERSE_M_S = 0.05
"""Path variables that go back this fast are followed backwards."""
Row = tuple[float, float, float, float]
"""Four of the eight parameters: those of one row of Ω."""
Eight = tuple[Finite, Finite, Finite, Finite, Finite, Finite, Finite, Finite]
"""Θ's elements: c b, d̄_11, d̄_12, m̄_1, c/b, d̄_21, d̄_22, m̄_2 [kg·m², N·m·s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceGains(Parameters):
    """Gains of the virtual controls, the filters and the speed loop, (15)-(34)."""

    k1: Positive = parameter(2.0, "(15), of x_e [1/s]")
    k2: Positive = parameter(3.0, "(17), of y_e [1/m]")
    k3: Positive = parameter(1.5, "(25), of the heading [1/s]")
    k4: Positive = parameter(3.0, "(34), of the speeds [N·m·s/m, N·m·s/rad]")
    gamma_1_s: Positive = parameter(0.01, "filter (19)")
    gamma_2_s: Seconds = parameter(0.01, "filter (20)")
    gamma_3_s: Seconds = parameter(0.01, "filter (27)")


def sense(s_dot: float) -> float:
    """σ(ṡ): the sense in which the path is followed, 1 forwards, −1 backwards."""
    if s_dot >= 0.0:
        return 1.0
    return max(1.0 + s_dot * (2.0 / REVERSE_M_S), -1.0)


def smoothing(period_s: float, time_constant_s: float) -> float:
    """Share of the way that a filter goes in one period: 1 − e^(−h/γ)."""
    return 1.0 - exp(-period_s / time_constant_s)


class Projection(NamedTuple):
    """The bounds of one parameter estimate."""

    sigma: float  # σ_M
    square: float  # σ_M²
    span: float  # k² + 2 k σ_M
    limit: float  # σ_M + k

    @classmethod
    def of(cls, sigma_max: float, margin: float) -> "Projection":
        """Bounds from σ_M and k."""
        span = margin * margin + 2.0 * margin * sigma_max
        return cls(sigma_max, sigma_max * sigma_max, span, sigma_max + margin)


def project(drive: float, estimate: float, bounds: Projection) -> float:
    """proj(π, σ̂): `drive` unless the estimate is beyond σ_M and would go further out."""
    if estimate * drive > 0.0:
        excess = (estimate * estimate - bounds.square) / bounds.span
        if excess > 0.0:
            return (1.0 - excess) * drive
    return drive


def adapt(row: Row, regressor: Row, error: float, gains: Row, bounds: Projection) -> Row:
    """One period of (35) for one row: `gains` are h K_5, element by element."""
    t1, t2, t3, t4 = row
    f1, f2, f3, f4 = regressor
    g1, g2, g3, g4 = gains
    sigma = bounds[0]
    if (
        -sigma <= t1 <= sigma
        and -sigma <= t2 <= sigma
        and -sigma <= t3 <= sigma
        and -sigma <= t4 <= sigma
    ):
        t1 += g1 * (f1 * error)
        t2 += g2 * (f2 * error)
        t3 += g3 * (f3 * error)
        t4 += g4 * (f4 * error)
        if (
            -sigma <= t1 <= sigma
            and -sigma <= t2 <= sigma
            and -sigma <= t3 <= sigma
            and -sigma <= t4 <= sigma
        ):
            return t1, t2, t3, t4
    else:
        t1 += g1 * project(f1 * error, t1, bounds)
        t2 += g2 * project(f2 * error, t2, bounds)
        t3 += g3 * project(f3 * error, t3, bounds)
        t4 += g4 * project(f4 * error, t4, bounds)
    limit = bounds.limit
    return _clip(t1, limit), _clip(t2, limit), _clip(t3, limit), _clip(t4, limit)


def wheel_torques(u_1: float, u_2: float, radius: float, half_track: float) -> tuple[float, float]:
    """τ = B u: (right, left) wheel torques [N·m] for a body demand u."""
    turn = half_track * u_2
    return (u_1 + turn) / radius, (u_1 - turn) / radius


def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)
