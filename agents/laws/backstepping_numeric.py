"""A baseline: backstepping whose derivatives are numerical, the textbook's that (19)-(27) replace.

    x_e, y_e, θ_e, v̄, θ̄, e, u, τ as in `agents.laws.backstepping_analytic`        (8)-(17), [3], [4]
    z'(t_k) = (z(t_k) − z(t_{k−1})) / h    for z = θ̄, v̄, ω̄                                  [5]
    ω̄ = −k_3 (θ_e − θ̄) + W + θ̄'                                                            [6]

It needs neither the path's third derivative nor a division by 1 − G x_e, and passes whatever is on
the measured pose on to the torque, times m̄ k_2 / h². Derivatives are 0 at the first tick. Θ is the
design's as in `agents.laws.fixed_dsc`; nothing adapts.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan, cos, inf
from typing import NamedTuple

from agents.laws.dsc_terms import Eight, sense, wheel_torques
from agents.laws.fixed_dsc import PAPER_THETA, scaled
from agents.laws.interface import (
    PATH_ERRORS,
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
from agents.laws.path_errors import path_errors
from configs.parameters import NotNegative, Parameters, Positive, parameter


class LastTick(NamedTuple):
    """The virtual controls of the tick before, for [5]."""

    theta_bar: float  # [rad]
    v_bar: float  # [m/s]
    omega_bar: float  # [rad/s]


class BacksteppingNumeric(Law):
    """Equations (15), (17), [3]-[6]."""

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Gains(Parameters):
        """Gains of (15), (17), [4], [6], and the parameters."""

        k1: Positive = parameter(2.0, "(15), of x_e [1/s]")
        k2: Positive = parameter(3.0, "(17), of y_e [1/m]")
        k3: Positive = parameter(1.5, "[6], of the heading [1/s]")
        k4: Positive = parameter(3.0, "[4], of the speeds [N·m·s/m, N·m·s/rad]")
        theta: Eight = parameter(PAPER_THETA, "Θ of the design [kg·m², N·m·s]")
        factor: NotNegative = parameter(1.0, "the law uses this multiple of theta")

    SIGNALS = (
        *PATH_ERRORS,
        Signal("v_bar_m_s", "m/s", "virtual control, (15)"),
        Signal("omega_bar_rad_s", "rad/s", "virtual control, [6]"),
        Signal("v_bar_rate_m_s2", "m/s²", "its difference, [5]"),
        Signal("omega_bar_rate_rad_s2", "rad/s²", "its difference, [5]"),
        Signal("xi_e1_m_s", "m/s", "speed error, [3]"),
        Signal("xi_e2_rad_s", "rad/s", "turn rate error, [3]"),
    )

    def __init__(
        self,
        gains: "BacksteppingNumeric.Gains",
        wheels: Wheels,
        period_s: float,
        path: RobotPath,  # noqa: ARG002 - the reference at the present s is enough
    ) -> None:
        self._gains, self._wheels, self._h = gains, wheels, period_s
        self._theta = scaled(gains.theta, gains.factor)

    def step(
        self,
        state: LastTick | None,
        motion: RobotMotion,
        reference: Reference,
        along: PathVariable,
    ) -> LawOutput:
        """One tick of (8)-[6]."""
        g, h, v, omega = self._gains, self._h, motion.v, motion.omega
        errors = path_errors(*motion[:3], *reference[:3])  # (8)
        x_e, y_e, theta_e = errors
        v_bar = -g.k1 * x_e + reference.v_bar * along.s_dot * cos(theta_e)  # (15)
        theta_bar = -atan(g.k2 * sense(along.s_dot) * y_e)  # (17)
        theta_bar_rate = 0.0 if state is None else (theta_bar - state.theta_bar) / h  # [5]
        turn = -g.k3 * (theta_e - theta_bar) + reference.omega_bar * along.s_dot
        omega_bar = turn + theta_bar_rate  # [6]
        v_rate = 0.0 if state is None else (v_bar - state.v_bar) / h  # [5]
        omega_rate = 0.0 if state is None else (omega_bar - state.omega_bar) / h
        e_1, e_2 = v - v_bar, omega - omega_bar  # [3]
        t1, t2, t3, t4, t5, t6, t7, t8 = self._theta
        known_1 = omega * omega * t1 - v * t2 - omega * t3 - v_rate * t4
        known_2 = -v * omega * t5 - v * t6 - omega * t7 - omega_rate * t8
        u_1, u_2 = -g.k4 * e_1 - known_1, -g.k4 * e_2 - known_2  # [4]
        right, left = wheel_torques(u_1, u_2, self._wheels.radius_m, self._wheels.half_track_m)
        after = LastTick(theta_bar, v_bar, omega_bar)
        said = (*errors, v_bar, omega_bar, v_rate, omega_rate, e_1, e_2)
        return LawOutput(right, left, after, said)

    # --- what follows from the equations, for `fleetloop check` ---------------------------------

    SPEED_GAIN = "k4"
    LOOP_GAINS = ("k1", "k3", "k2", "k4")
    REVERSES = True

    @classmethod
    def torque_limit_wheel_N_m(cls, gains: "BacksteppingNumeric.Gains") -> float:  # noqa: ARG003
        """None: [4] asks for whatever its terms are."""
        return inf

    @classmethod
    def approach_rate_1_s(cls, gains: "BacksteppingNumeric.Gains") -> float | None:
        """k_1 of (15)."""
        return gains.k1

    @classmethod
    def lateral_gain_1_m(cls, gains: "BacksteppingNumeric.Gains") -> float | None:
        """k_2 of (17)."""
        return gains.k2

    @classmethod
    def speed_gain_N_m_s(cls, gains: "BacksteppingNumeric.Gains") -> float | None:
        """k_4 of [4]."""
        return gains.k4

    @classmethod
    def loop_elements(
        cls,
        gains: "BacksteppingNumeric.Gains",
        wheels: Wheels,
        period_s: float,
        path: RobotPath,
        along: PathVariable,
        theta: Theta,  # noqa: ARG003 - the law has its own
    ) -> Sequence[LoopElement] | None:
        """The virtual controls of the tick before about steady motion."""
        law = cls(gains, wheels, period_s, path)
        here = path(along.s)
        steady = 0.0, here.v_bar * along.s_dot, here.omega_bar * along.s_dot

        def step(
            last: Fast, motion: RobotMotion, reference: Reference, along: PathVariable
        ) -> tuple[float, float, Fast]:
            out = law.step(LastTick(*last), motion, reference, along)
            return out.tau_right, out.tau_left, tuple(out.state)

        return (LoopElement(steady, step, "differences"),)
