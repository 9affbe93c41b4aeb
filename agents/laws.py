"""The laws that a scenario can name: from what is sensed and asked to two wheel torques.

A law is a function of its own state, the sensed motion, the reference and the path speed; it
returns the torques, the next state and what it used on the way. A new law is one function here (or
in a module of its own) and one line in `LAWS`.
"""

from collections.abc import Callable, Mapping
from math import atan, cos, exp, hypot, tanh
from typing import NamedTuple

from agents.path_following import path_errors, smoothing
from agents.paths import Reference
from agents.wheel_torque import Projection, Row, adapt, wheel_torques
from configs.brief import Gains, Wheels

_new = tuple.__new__  # of a named tuple, past its constructor: this is the hot path


class Sense(NamedTuple):
    """The motion that the controller believes in."""

    x: float  # [m], world
    y: float  # [m], world
    theta: float  # [rad], not wrapped
    v: float  # [m/s]
    omega: float  # [rad/s]


class LawState(NamedTuple):
    """What a law remembers: filters (19), (20), (27), estimates (35), (36)."""

    alpha_theta: float
    alpha_v: float
    alpha_omega: float
    theta_1: Row  # (c b, d̄_11, d̄_12, m̄_1)
    theta_2: Row  # (c/b, d̄_21, d̄_22, m̄_2)
    kappa: float


class LawOutput(NamedTuple):
    """One step of a law: torques, next state, and what is recorded of this tick."""

    tau_right: float  # [N·m]
    tau_left: float  # [N·m]
    state: LawState  # at the next tick
    signals: tuple[float, ...]  # those of `configs.signals.LAW_SIGNALS`, in that order


Law = Callable[[LawState | None, Sense, Reference, float], LawOutput]
"""(state, sense, reference, ṡ) ↦ output; the state is None at the first tick."""


def adaptive_dsc(gains: Gains, wheels: Wheels, period_s: float) -> Law:
    """The paper's law, eqs (8)-(36), sampled with a held output.

    Filters and κ̂ are advanced exactly, Θ̂ by Euler's rule. At the first tick the filters start at
    their inputs (19), (20), (27).
    """
    return _dsc(gains, wheels, period_s, robust=False)


def adaptive_dsc_robust(gains: Gains, wheels: Wheels, period_s: float) -> Law:
    """The law for real rates, real drives and starts off the path.

    Four changes, all of them the paper's law again to first order on the path:

        v̄ = −V tanh(k_1 x_e / V) + v̄_d ṡ cos θ_e           bounded approach speed    (15)
        θ̄ = −atan(k_2 y_e / (1 + k_2 |x_e|))                 no spinning far off       (17)
        |τ| ≤ `torque_limit_wheel_N_m`; Θ̂ and κ̂ hold still while a wheel is at it           (34)
        Θ̂_r' divided by 1 + h |K_5 F_r²| / (k_4/4)           stable when sampled       (35)
    """
    return _dsc(gains, wheels, period_s, robust=True)


def _dsc(gains: Gains, wheels: Wheels, period_s: float, *, robust: bool) -> Law:
    k1, k2, k3, k4 = gains.k1, gains.k2, gains.k3, gains.k4
    g1, g2, g3 = gains.gamma_1_s, gains.gamma_2_s, gains.gamma_3_s
    a1, a2, a3 = (smoothing(period_s, g) for g in (g1, g2, g3))
    p = tuple(period_s * k for k in gains.k5)
    rates_1: Row = (p[0], p[1], p[2], p[3])
    rates_2: Row = (p[4], p[5], p[6], p[7])
    bounds = Projection.of(gains.sigma_max, gains.sigma_margin)
    keep = exp(-gains.eta * gains.rho * period_s)
    gain = (1.0 - keep) / gains.rho
    width = gains.sgn_width
    v_limit, tau_limit = gains.v_bar_limit_m_s, gains.torque_limit_wheel_N_m
    radius, half_track = wheels.radius_m, wheels.half_track_m
    t = gains.theta_hat_0

    def first(bar_theta: float, bar_v: float, bar_omega: float) -> LawState:
        return LawState(bar_theta, bar_v, bar_omega, t[:4], t[4:], gains.kappa_hat_0)

    def step(state: LawState | None, sense: Sense, ref: Reference, s_dot: float) -> LawOutput:
        x, y, theta, v, omega = sense
        x_d, y_d, theta_d, v_bar_d, omega_bar_d = ref
        x_e, y_e, theta_e = path_errors(x, y, theta, x_d, y_d, theta_d)  # (8)
        ahead = v_bar_d * s_dot * cos(theta_e)
        if robust:
            bar_v = ahead - v_limit * tanh(k1 * x_e / v_limit)
            bar_theta = -atan(k2 * y_e / (1.0 + k2 * abs(x_e)))
        else:
            bar_v = -k1 * x_e + ahead  # (15)
            bar_theta = -atan(k2 * y_e)  # (17)
        turn = -k3 * (theta_e - bar_theta) + omega_bar_d * s_dot
        if state is None:
            state = first(bar_theta, bar_v, turn)
        alpha_theta, alpha_v, alpha_omega, theta_1, theta_2, kappa = state
        rate_theta = (bar_theta - alpha_theta) / g1  # (19)
        rate_v = (bar_v - alpha_v) / g2  # (20)
        bar_omega = turn + rate_theta  # (25)
        rate_omega = (bar_omega - alpha_omega) / g3  # (27)
        e_1, e_2 = v - alpha_v, omega - alpha_omega  # (30)
        f_1 = (omega * omega, -v, -omega, -rate_v)  # (32)
        f_2 = (-v * omega, -v, -omega, -rate_omega)
        t1, t2, t3, t4 = theta_1
        t5, t6, t7, t8 = theta_2
        known_1 = f_1[0] * t1 - v * t2 - omega * t3 - rate_v * t4
        known_2 = f_2[0] * t5 - v * t6 - omega * t7 - rate_omega * t8
        u_1 = -k4 * e_1 - known_1 - kappa * tanh(e_1 / width)  # (34)
        u_2 = -k4 * e_2 - known_2 - kappa * tanh(e_2 / width)
        tau_right, tau_left = wheel_torques(u_1, u_2, radius, half_track)
        next_1, next_2, next_kappa = theta_1, theta_2, kappa
        if not robust:
            next_1 = adapt(theta_1, f_1, e_1, rates_1, bounds)  # (35)
            next_2 = adapt(theta_2, f_2, e_2, rates_2, bounds)
            next_kappa = keep * kappa + gain * hypot(e_1, e_2)  # (36)
        elif abs(tau_right) > tau_limit or abs(tau_left) > tau_limit:
            tau_right = min(max(tau_right, -tau_limit), tau_limit)
            tau_left = min(max(tau_left, -tau_limit), tau_limit)
        else:
            next_1 = adapt(theta_1, f_1, e_1 * _calm(f_1, rates_1, k4), rates_1, bounds)
            next_2 = adapt(theta_2, f_2, e_2 * _calm(f_2, rates_2, k4), rates_2, bounds)
            next_kappa = keep * kappa + gain * hypot(e_1, e_2)
        after = (
            alpha_theta + a1 * (bar_theta - alpha_theta),
            alpha_v + a2 * (bar_v - alpha_v),
            alpha_omega + a3 * (bar_omega - alpha_omega),
            next_1,
            next_2,
            next_kappa,
        )
        signals = (x_e, y_e, theta_e, alpha_theta, alpha_v, alpha_omega, e_1, e_2)
        said = (*signals, *theta_1, *theta_2, kappa)
        return _new(LawOutput, (tau_right, tau_left, _new(LawState, after), said))

    return step


def _calm(regressor: Row, rates: Row, k4: float) -> float:
    """The normalisation of (35): 1 / (1 + h Σ k_5 F² / (k_4/4))."""
    f1, f2, f3, f4 = regressor
    r1, r2, r3, r4 = rates
    size = r1 * f1 * f1 + r2 * f2 * f2 + r3 * f3 * f3 + r4 * f4 * f4
    return 1.0 / (1.0 + size / (0.25 * k4))


LAWS: Mapping[str, Callable[[Gains, Wheels, float], Law]] = {
    "adaptive_dsc": adaptive_dsc,
    "adaptive_dsc_robust": adaptive_dsc_robust,
}
