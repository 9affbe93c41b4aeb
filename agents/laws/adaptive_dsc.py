"""The paper's law: adaptive dynamic surface control, equations (8)-(36), sampled with output held.

    x_e, y_e, θ_e: the reference seen from the robot                                 (8)
    v̄ = −k_1 x_e + v̄_d ṡ cos θ_e                                                    (15)
    θ̄ = −atan(k_2 σ(ṡ) y_e)                                                         (17)
    γ_1 α_θ' + α_θ = θ̄,  α_θ(0) = θ̄(0)                                              (19)
    γ_2 α_v' + α_v = v̄,  α_v(0) = v̄(0)                                              (20)
    ω̄ = −k_3 (θ_e − θ̄) + ω̄_d ṡ + α_θ'                                               (25)
    γ_3 α_ω' + α_ω = ω̄,  α_ω(0) = ω̄(0)                                              (27)
    e = (v − α_v, ω − α_ω)                                                          (30)
    F_1 = (ω², −v, −ω, −α_v'),  F_2 = (−v ω, −v, −ω, −α_ω')      rows of Ω          (32)
    u_r = −k_4 e_r − F_r · Θ̂_r − κ̂ sgn(e_r),   τ = B u                        (3), (34)
    Θ̂_r' = K_5 proj(F_r e_r, Θ̂_r)                                                  (35)
    κ̂' = η (‖e‖ − ρ κ̂)                                                            (36)

    x_e, y_e [m]   θ_e, θ̄, α_θ [rad]   v̄, α_v [m/s]   ω̄, α_ω [rad/s]   ṡ [m/s]   γ [s]
    Θ = (c b, d̄_11, d̄_12, m̄_1, c/b, d̄_21, d̄_22, m̄_2): unknown, each |σ| ≤ σ_M
    B = (1/r) [[1, b], [1, −b]]: from body to (right, left) wheel
    sgn(e) is tanh(e / width), so that the torque is continuous

Filters and κ̂ are advanced exactly, Θ̂ by Euler's rule; the equations are functions of numbers, which
the batch kernel of sweeps compiles as they stand. `proj` is in `agents.laws.dsc_terms`, as is
σ(ṡ), 1 wherever ṡ ≥ 0: the paper has none, and needs ṡ > 0.
"""

from collections.abc import Sequence
from math import atan, cos, exp, inf, sqrt, tanh
from typing import Any, ClassVar

from mypy_extensions import mypyc_attr

from agents.laws.dsc_terms import (
    Projection,
    Row,
    adapt,
    sense,
    smoothing,
    wheel_torques,
)
from agents.laws.gains import AdaptiveDscGains, SurfaceGains
from agents.laws.interface import (
    PATH_ERRORS,
    AdaptationLimit,
    Fast,
    Law,
    LawOutput,
    LoopElement,
    PathVariable,
    Reference,
    RobotMotion,
    RobotPath,
    Signal,
    Theta,
    Wheels,
)
from agents.laws.path_errors import errors_of

Filters = tuple[float, float, float]
"""α_θ, α_v, α_ω."""
Constants = tuple[Row, Filters, Filters, Filters, tuple[float, float]]
"""k_1 … k_4; γ_1 … γ_3; what the filters move by in a period; of κ̂ what is kept, what ‖e‖ adds, and
the width of sgn; r, b."""
Surface = tuple[float, float, Filters, Row, Row, float, float]
"""τ right, τ left, the filters after the period, F_1, F_2, e_1, e_2."""


def law_constants(gains: AdaptiveDscGains, wheels: Wheels, period_s: float) -> Constants:
    """What (15)-(36) need of the gains and the robot, for one control period."""
    g, keep = gains, exp(-gains.eta * gains.rho * period_s)
    moves = (
        smoothing(period_s, g.gamma_1_s),
        smoothing(period_s, g.gamma_2_s),
        smoothing(period_s, g.gamma_3_s),
    )
    return (
        (g.k1, g.k2, g.k3, g.k4),
        (g.gamma_1_s, g.gamma_2_s, g.gamma_3_s),
        moves,
        (keep, (1.0 - keep) / g.rho, g.sgn_width),
        (wheels.radius_m, wheels.half_track_m),
    )


def adaptation_rates(gains: AdaptiveDscGains, period_s: float) -> tuple[Row, Row]:
    """The gains h K_5 of both rows of Ω."""
    h, k = period_s, gains.k5
    return (h * k[0], h * k[1], h * k[2], h * k[3]), (h * k[4], h * k[5], h * k[6], h * k[7])


def approach(x_e: float, y_e: float, k1: float, k2: float) -> tuple[float, float]:
    """The part of (15) that closes x_e, and (17)."""
    return -k1 * x_e, -atan(k2 * y_e)


def virtual_controls(
    closing: float,
    bar_theta: float,
    theta_e: float,
    s_dot: float,
    v_bar_d: float,
    omega_bar_d: float,
    k3: float,
) -> tuple[float, float]:
    """v̄ of (15), and ω̄ of (25) without α_θ'; `closing` is the part of (15) that closes x_e."""
    bar_v = closing + v_bar_d * s_dot * cos(theta_e)
    turn = -k3 * (theta_e - bar_theta) + omega_bar_d * s_dot
    return bar_v, turn


def surface(
    constants: Constants,
    v: float,
    omega: float,
    bar_theta: float,
    bar_v: float,
    turn: float,
    filters: Filters,
    theta_1: Row,
    theta_2: Row,
    kappa: float,
) -> Surface:
    """(19)-(34): torques from the virtual controls, the filters and the estimates."""
    (_, _, _, k4), (g1, g2, g3), (a1, a2, a3), (_, _, width), (r, b) = constants
    alpha_theta, alpha_v, alpha_omega = filters
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
    tau_right, tau_left = wheel_torques(u_1, u_2, r, b)  # (3)
    after = (
        alpha_theta + a1 * (bar_theta - alpha_theta),
        alpha_v + a2 * (bar_v - alpha_v),
        alpha_omega + a3 * (bar_omega - alpha_omega),
    )
    return tau_right, tau_left, after, f_1, f_2, e_1, e_2


def bound_estimate(kappa: float, e_1: float, e_2: float, keep: float, gain: float) -> float:
    """κ̂ after one period of (36)."""
    return keep * kappa + gain * sqrt(e_1 * e_1 + e_2 * e_2)


class DscState:
    """Filters (19), (20), (27) and estimates (35), (36)."""

    __slots__ = ("alpha_omega", "alpha_theta", "alpha_v", "kappa", "theta_1", "theta_2")

    def __init__(self, filters: Filters, theta_1: Row, theta_2: Row, kappa: float) -> None:
        self.alpha_theta, self.alpha_v, self.alpha_omega = filters
        self.theta_1 = theta_1  # (c b, d̄_11, d̄_12, m̄_1)
        self.theta_2 = theta_2  # (c/b, d̄_21, d̄_22, m̄_2)
        self.kappa = kappa

    @property
    def filters(self) -> Filters:
        """α_θ, α_v, α_ω."""
        return self.alpha_theta, self.alpha_v, self.alpha_omega


@mypyc_attr(allow_interpreted_subclasses=True)
class AdaptiveDsc(Law):
    """Equations (8)-(36)."""

    Gains: ClassVar[type[SurfaceGains]] = AdaptiveDscGains
    SIGNALS = (
        *PATH_ERRORS,
        Signal("alpha_theta_rad", "rad", "filtered virtual control, (19)"),
        Signal("alpha_v_m_s", "m/s", "filtered virtual control, (20)"),
        Signal("alpha_omega_rad_s", "rad/s", "filtered virtual control, (27)"),
        Signal("xi_e1_m_s", "m/s", "speed error, (30)"),
        Signal("xi_e2_rad_s", "rad/s", "turn rate error, (30)"),
        Signal("theta_hat_1", "kg·m²", "estimate of c b"),
        Signal("theta_hat_2", "N·m·s", "estimate of d̄_11"),
        Signal("theta_hat_3", "N·m·s", "estimate of d̄_12"),
        Signal("theta_hat_4", "kg·m²", "estimate of m̄_1"),
        Signal("theta_hat_5", "kg·m²", "estimate of c / b"),
        Signal("theta_hat_6", "N·m·s", "estimate of d̄_21"),
        Signal("theta_hat_7", "N·m·s", "estimate of d̄_22"),
        Signal("theta_hat_8", "kg·m²", "estimate of m̄_2"),
        Signal("kappa_hat", "N·m", "estimate of the disturbance bound, (36)"),
    )

    def __init__(
        self,
        gains: AdaptiveDscGains,
        wheels: Wheels,
        period_s: float,
        path: RobotPath,  # noqa: ARG002 - the reference at the present s is enough
    ) -> None:
        self._rates_1, self._rates_2 = adaptation_rates(gains, period_s)
        self._bounds = Projection.of(gains.sigma_max, gains.sigma_margin)
        self.estimates: tuple[Row, Row, float] = (
            gains.theta_hat_0[:4],
            gains.theta_hat_0[4:],
            gains.kappa_hat_0,
        )
        """At the start: the rows of Θ̂, and κ̂."""
        self._constants = law_constants(gains, wheels, period_s)

    def step(
        self, state: DscState | None, motion: RobotMotion, reference: Reference, along: PathVariable
    ) -> LawOutput:
        """One period of (8)-(36)."""
        constants = self._constants
        (k1, k2, k3, k4), _, _, (keep, gain, _), _ = constants
        v, omega, s_dot = motion.v, motion.omega, along.s_dot
        x_e, y_e, theta_e = errors_of(motion, reference)  # (8)
        closing, bar_theta = self._approach(x_e, sense(s_dot) * y_e, k1, k2)  # (17)
        bar_v, turn = virtual_controls(  # (15), (25)
            closing, bar_theta, theta_e, s_dot, reference.v_bar, reference.omega_bar, k3
        )
        if state is None:
            theta_1, theta_2, kappa = self.estimates
            filters = (bar_theta, bar_v, turn)
        else:
            theta_1, theta_2, kappa = state.theta_1, state.theta_2, state.kappa
            filters = (state.alpha_theta, state.alpha_v, state.alpha_omega)
        alpha_theta, alpha_v, alpha_omega = filters
        tau_right, tau_left, moved, f_1, f_2, e_1, e_2 = surface(  # (19)-(34)
            constants, v, omega, bar_theta, bar_v, turn, filters, theta_1, theta_2, kappa
        )
        after = DscState(
            moved,
            self._learn(theta_1, f_1, e_1, self._rates_1, k4),  # (35)
            self._learn(theta_2, f_2, e_2, self._rates_2, k4),
            bound_estimate(kappa, e_1, e_2, keep, gain),  # (36)
        )
        t1, t2, t3, t4 = theta_1
        t5, t6, t7, t8 = theta_2
        said = (
            x_e,
            y_e,
            theta_e,
            alpha_theta,
            alpha_v,
            alpha_omega,
            e_1,
            e_2,
            t1,
            t2,
            t3,
            t4,
            t5,
            t6,
            t7,
            t8,
            kappa,
        )
        return LawOutput(tau_right, tau_left, after, said)

    def _approach(self, x_e: float, y_e: float, k1: float, k2: float) -> tuple[float, float]:
        """The part of (15) that closes x_e, and (17)."""
        return approach(x_e, y_e, k1, k2)

    def _learn(self, row: Row, regressor: Row, error: float, rates: Row, _k4: float) -> Row:
        """One period of (35) for one row of Ω."""
        return adapt(row, regressor, error, rates, self._bounds)

    def hold(self, before: DscState | None, after: DscState) -> DscState:
        """Filters go on; Θ̂ and κ̂ hold still, or would learn the limit."""
        if before is None:
            return DscState(after.filters, *self.estimates)
        return DscState(after.filters, before.theta_1, before.theta_2, before.kappa)

    # --- what follows from the equations, for `fleetloop check` ---------------------------------

    SPEED_GAIN = "k4"
    LOOP_GAINS = ("k1", "k3", "k2", "k4")
    SATURATION = (
        "the paper's law learns the limit;"
        ' control.law = "adaptive_dsc_robust" doesn\'t, or start closer'
    )

    @classmethod
    def torque_limit_wheel_N_m(cls, gains: SurfaceGains) -> float:  # noqa: ARG003
        """None: (34) asks for whatever its terms are."""
        return inf

    @classmethod
    def approach_rate_1_s(cls, gains: SurfaceGains) -> float | None:
        """k_1 of (15)."""
        return gains.k1

    @classmethod
    def lateral_gain_1_m(cls, gains: SurfaceGains) -> float | None:
        """k_2 of (17)."""
        return gains.k2

    @classmethod
    def speed_gain_N_m_s(cls, gains: SurfaceGains) -> float | None:
        """k_4 of (34)."""
        return gains.k4

    @classmethod
    def loop_elements(
        cls,
        gains: Any,
        wheels: Wheels,
        period_s: float,
        path: RobotPath,
        along: PathVariable,
        theta: Theta,
    ) -> Sequence[LoopElement] | None:
        """Filters (19), (20), (27) about steady motion; Θ̂ at its start values, and at Θ; κ̂ is 0."""
        return loop_elements(cls(gains, wheels, period_s, path), gains, path, along, theta)

    @classmethod
    def adaptation_limit(cls, gains: Any, period_s: float) -> AdaptationLimit | None:
        """(35) by Euler's rule in the speed loop is stable for h Σ k_5 F² < k_4 in both rows of Ω.

        F has ω² and the filters' rates in it: it is large where a robot starts far off its path or
        facing away.
        """
        k5_1, k5_2 = gains.k5[:4], gains.k5[4:]
        moved_v = gains.gamma_2_s * smoothing(period_s, gains.gamma_2_s)
        moved_omega = gains.gamma_3_s * smoothing(period_s, gains.gamma_3_s)

        def ratio(before: DscState | None, after: DscState, motion: RobotMotion) -> float:
            if before is None:
                return 0.0
            rate_v = (after.alpha_v - before.alpha_v) / moved_v
            rate_omega = (after.alpha_omega - before.alpha_omega) / moved_omega
            v, omega = motion.v, motion.omega
            rows = (
                (k5_1, (omega * omega, v, omega, rate_v)),
                (k5_2, (v * omega, v, omega, rate_omega)),
            )
            sizes = [sum(k * f * f for k, f in zip(*row, strict=True)) for row in rows]
            return float(period_s * max(sizes) / gains.k4)

        return AdaptationLimit(
            "(35) sampled: h Σ k5 F² < k4",
            "k4",
            'control.law = "adaptive_dsc_robust" normalises it; or lower k5, or start closer',
            ratio,
        )


def loop_elements(
    law: AdaptiveDsc, gains: SurfaceGains, path: RobotPath, along: PathVariable, theta: Theta
) -> Sequence[LoopElement]:
    """The loop elements of this law, or of one that derives from it."""
    start_1, start_2, _ = law.estimates
    here = path(along.s)
    steady = 0.0, here.v_bar * along.s_dot, here.omega_bar * along.s_dot
    lags_s = gains.gamma_1_s, gains.gamma_2_s, gains.gamma_3_s

    def element(theta_1: Row, theta_2: Row) -> LoopElement:
        def step(
            filters: Fast, motion: RobotMotion, reference: Reference, along: PathVariable
        ) -> tuple[float, float, Fast]:
            alpha_theta, alpha_v, alpha_omega = filters
            state = DscState((alpha_theta, alpha_v, alpha_omega), theta_1, theta_2, 0.0)
            right, left, after, _ = law.step(state, motion, reference, along)
            return right, left, after.filters

        return LoopElement(steady, step, "filters", lags_s)

    return element(start_1, start_2), element(theta[:4], theta[4:])
