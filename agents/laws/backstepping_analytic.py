"""A baseline: backstepping with analytic derivatives of its virtual controls, without filters.

    x_e' = v − A cos θ_e + ω y_e,  y_e' = A sin θ_e − ω x_e,  θ_e' = ω − W           (9)
    v̄ = −k_1 x_e + A cos θ_e                                                        (15)
    θ̄ = −atan(K y_e),  K = k_2 σ(ṡ)                                                (17)

with A = v̄_d ṡ, W = ω̄_d ṡ, and σ of `agents.laws.dsc_terms`, 1 for ṡ ≥ 0, its derivative neglected
where it isn't 0. For G = K / (1 + K² y_e²) the derivative of θ̄ has ω itself in it,

    θ̄' = −G y_e' = −G A sin θ_e + G x_e ω                                           [1]

so θ_e' = −k_3 (θ_e − θ̄) + θ̄' is solved for it:

    ω̄ = (−k_3 (θ_e − θ̄) + W − G A sin θ_e) / (1 − G x_e)                            [2]
    e = (v − v̄, ω − ω̄)                                                              [3]
    u_r = −k_4 e_r − F_r · f Θ,  F as in (32) with v̄', ω̄' for the filters' rates    [4]
    τ = B u                                                                          (3)

v̄' and ω̄' are the derivatives of (15) and [2] along (9) by the chain rule. They take what the
paper's law does without: v̄_d' and ω̄_d' by s, the path's third derivative, here by central
differences of the path; s̈, and with it what the neighbours say, inside the torque; and 1 − G x_e
away from 0, where the robot would have to spin: it is held at `margin` and above. Θ is the design's
as in `agents.laws.fixed_dsc`; nothing adapts, and there is no state.
"""

from collections.abc import Sequence
from math import atan, cos, sin

from agents.laws.backstepping import Backstepping
from agents.laws.dsc_terms import sense
from agents.laws.gains import BacksteppingAnalyticGains
from agents.laws.interface import (
    PATH_ERRORS,
    Fast,
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

_STEP_M = 1e-4
"""Of the central differences along the path."""


class BacksteppingAnalytic(Backstepping):
    """Equations (15), (17), [1]-[4]."""

    Gains = BacksteppingAnalyticGains
    SIGNALS = (
        *PATH_ERRORS,
        Signal("v_bar_m_s", "m/s", "virtual control, (15)"),
        Signal("omega_bar_rad_s", "rad/s", "virtual control, [2]"),
        Signal("v_bar_rate_m_s2", "m/s²", "its derivative"),
        Signal("omega_bar_rate_rad_s2", "rad/s²", "its derivative"),
        Signal("xi_e1_m_s", "m/s", "speed error, [3]"),
        Signal("xi_e2_rad_s", "rad/s", "turn rate error, [3]"),
        Signal("one_minus_G_x_e", "1", "the divisor of [2], before it is held"),
    )

    def __init__(
        self,
        gains: BacksteppingAnalyticGains,
        wheels: Wheels,
        period_s: float,  # noqa: ARG002 - nothing is integrated
        path: RobotPath,
    ) -> None:
        super().__init__(gains, wheels)
        self._gains, self._path = gains, path

    def step(
        self,
        state: None,  # noqa: ARG002 - there is none
        motion: RobotMotion,
        reference: Reference,
        along: PathVariable,
    ) -> LawOutput:
        """One tick of (9)-[4]."""
        errors = errors_of(motion, reference)  # (8)
        v_bar, v_rate, omega_bar, omega_rate, divisor = self.virtual(
            errors, motion.v, motion.omega, reference, along
        )
        right, left, e_1, e_2 = self.torques(motion, v_bar, omega_bar, v_rate, omega_rate)
        said = (*errors, v_bar, omega_bar, v_rate, omega_rate, e_1, e_2, divisor)
        return LawOutput(right, left, None, said)

    def virtual(
        self,
        errors: tuple[float, float, float],
        v: float,
        omega: float,
        reference: Reference,
        along: PathVariable,
    ) -> tuple[float, float, float, float, float]:
        """v̄, v̄', ω̄, ω̄', and the divisor of [2]."""
        g, (x_e, y_e, theta_e) = self._gains, errors
        s_dot, s_ddot = along.s_dot, along.s_ddot
        v_bar_d, omega_bar_d = reference.v_bar, reference.omega_bar
        v_bar_d_s, omega_bar_d_s = self._slopes(along.s)
        a, w = v_bar_d * s_dot, omega_bar_d * s_dot
        a_rate = v_bar_d_s * s_dot * s_dot + v_bar_d * s_ddot
        w_rate = omega_bar_d_s * s_dot * s_dot + omega_bar_d * s_ddot
        c, n = cos(theta_e), sin(theta_e)
        x_rate, y_rate, theta_rate = v - a * c + omega * y_e, a * n - omega * x_e, omega - w  # (9)

        v_bar = -g.k1 * x_e + a * c  # (15)
        v_bar_rate = -g.k1 * x_rate + a_rate * c - a * n * theta_rate

        k2 = g.k2 * sense(s_dot)  # K
        square = 1.0 + k2 * k2 * y_e * y_e
        slope = k2 / square  # G
        slope_rate = -2.0 * k2**3 * y_e * y_rate / (square * square)
        bar_theta, bar_theta_rate = -atan(k2 * y_e), -slope * y_rate  # (17), [1]
        above = -g.k3 * (theta_e - bar_theta) + w - slope * a * n
        above_rate = -g.k3 * (theta_rate - bar_theta_rate) + w_rate
        above_rate -= slope_rate * a * n + slope * (a_rate * n + a * c * theta_rate)
        divisor = 1.0 - slope * x_e
        held = max(divisor, g.margin)
        held_rate = -slope_rate * x_e - slope * x_rate if held == divisor else 0.0
        omega_bar = above / held  # [2]
        return v_bar, v_bar_rate, omega_bar, (above_rate - omega_bar * held_rate) / held, divisor

    def _slopes(self, s: float) -> tuple[float, float]:
        """v̄_d' and ω̄_d' by s."""
        after, before = self._path(s + _STEP_M), self._path(s - _STEP_M)
        span = 2.0 * _STEP_M
        return (after.v_bar - before.v_bar) / span, (after.omega_bar - before.omega_bar) / span

    # --- what follows from the equations, for `fleetloop check` ---------------------------------

    @classmethod
    def loop_elements(
        cls,
        gains: BacksteppingAnalyticGains,
        wheels: Wheels,
        period_s: float,
        path: RobotPath,
        along: PathVariable,  # noqa: ARG003 - there is no state that has to fit it
        theta: Theta,  # noqa: ARG003 - the law has its own
    ) -> Sequence[LoopElement] | None:
        """The law itself: it has no state."""
        law = cls(gains, wheels, period_s, path)

        def step(
            fast: Fast, motion: RobotMotion, reference: Reference, along: PathVariable
        ) -> tuple[float, float, Fast]:
            out = law.step(None, motion, reference, along)
            return out.tau_right, out.tau_left, fast

        return (LoopElement((), step),)
