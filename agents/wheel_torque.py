"""Dynamic half of the law: adaptive torque from speed errors, eqs (29)-(36).

    e = (v − α_v, ω − α_ω)                                                          (30)
    F_1 = (ω², −v, −ω, −α_v'),  F_2 = (−v ω, −v, −ω, −α_ω')      rows of Ω          (32)
    u_r = −k_4 e_r − F_r · Θ̂_r − κ̂ sgn(e_r),   τ = B u                        (3), (34)
    Θ̂_r' = K_5 proj(F_r e_r, Θ̂_r)                                                  (35)
    κ̂' = η (‖e‖ − ρ κ̂)                                                            (36)

    Θ = (c b, d̄_11, d̄_12, m̄_1, c/b, d̄_21, d̄_22, m̄_2): unknown, each |σ| ≤ σ_M
    B = (1/r) [[1, b], [1, −b]]: from body to (right, left) wheel
    sgn(e) is tanh(e / width), so that the torque is continuous

The paper prints `proj` without the factor π in its conditions; with it, as in its reference [26],
both sides are projected: with Ξ(σ̂) = (σ̂² − σ_M²)/(k² + 2 k σ_M),

    proj(π, σ̂) = (1 − Ξ) π   if Ξ > 0 and σ̂ π > 0,   else π

which keeps |σ̂| ≤ σ_M + k; a clip to that bound guards against a long sampling period.
"""

from typing import NamedTuple

Row = tuple[float, float, float, float]
"""Four of the eight parameters: those of one row of Ω."""


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
