"""Kinematic half of the law: path following errors, virtual controls and filters, eqs (8)-(28).

    x_e =  cos θ (x − x_d) + sin θ (y − y_d)          errors in the robot's axes      (8)
    y_e = −sin θ (x − x_d) + cos θ (y − y_d)
    θ_e = θ − θ_d, wrapped to (−π, π]
    v̄ = −k_1 x_e + v̄_d ṡ cos θ_e                                                     (15)
    θ̄ = −atan(k_2 y_e)                                                               (17)
    ω̄ = −k_3 (θ_e − θ̄) + ω̄_d ṡ + α_θ'                                               (25)
    γ α' + α = bar,  α(0) = bar(0)        three first-order filters       (19), (20), (27)

    x_e, y_e [m]   θ_e [rad]   v̄ [m/s]   θ̄ [rad]   ω̄ [rad/s]   ṡ [m/s]   γ [s]

A filter's rate is α' = (bar − α)/γ; over one period h with its input held it moves by
(1 − e^(−h/γ)) (bar − α), exactly.
"""

from math import cos, exp, pi, sin

PathErrors = tuple[float, float, float]
"""(8): where the robot is, seen from itself, against its reference: x_e, y_e [m], θ_e [rad]."""


def wrap(angle: float) -> float:
    """The same direction in (−π, π]."""
    if -pi < angle <= pi:
        return angle
    wrapped = angle % (2.0 * pi)
    return wrapped - 2.0 * pi if wrapped > pi else wrapped


def path_errors(
    x: float, y: float, theta: float, x_d: float, y_d: float, theta_d: float
) -> PathErrors:
    """Errors (8) of a robot at (x, y, θ) against its reference."""
    c, s = cos(theta), sin(theta)
    dx, dy = x - x_d, y - y_d
    return c * dx + s * dy, c * dy - s * dx, wrap(theta - theta_d)


def smoothing(period_s: float, time_constant_s: float) -> float:
    """Share of the way that a filter goes in one period: 1 − e^(−h/γ)."""
    return 1.0 - exp(-period_s / time_constant_s)
