"""A baseline: backstepping whose derivatives are numerical, the textbook's that (19)-(27) replace.

    x_e, y_e, θ_e, v̄, θ̄, e, u, τ as in `agents.laws.backstepping_analytic`        (8)-(17), [3], [4]
    z'(t_k) = (z(t_k) − z(t_{k−1})) / h    for z = θ̄, v̄, ω̄                                  [5]
    ω̄ = −k_3 (θ_e − θ̄) + W + θ̄'                                                            [6]

It needs neither the path's third derivative nor a division by 1 − G x_e, and passes whatever is on
the measured pose on to the torque, times m̄ k_2 / h². Derivatives are 0 at the first tick. Θ is the
design's as in `agents.laws.fixed_dsc`; nothing adapts.
"""

from collections.abc import Sequence
from math import atan, cos
from typing import NamedTuple

from agents.laws.backstepping import Backstepping
from agents.laws.dsc_terms import sense
from agents.laws.gains import BacksteppingGains
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


class LastTick(NamedTuple):
    """The virtual controls of the tick before, for [5]."""

    theta_bar: float  # [rad]
    v_bar: float  # [m/s]
    omega_bar: float  # [rad/s]


class BacksteppingNumeric(Backstepping):
    """Equations (15), (17), [3]-[6]."""

    Gains = BacksteppingGains

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
        gains: BacksteppingGains,
        wheels: Wheels,
        period_s: float,
        path: RobotPath,  # noqa: ARG002 - the reference at the present s is enough
    ) -> None:
        super().__init__(gains, wheels)
        self._gains, self._h = gains, period_s

    def step(
        self,
        state: LastTick | None,
        motion: RobotMotion,
        reference: Reference,
        along: PathVariable,
    ) -> LawOutput:
        """One tick of (8)-[6]."""
        g, h = self._gains, self._h
        errors = errors_of(motion, reference)  # (8)
        x_e, y_e, theta_e = errors
        v_bar = -g.k1 * x_e + reference.v_bar * along.s_dot * cos(theta_e)  # (15)
        theta_bar = -atan(g.k2 * sense(along.s_dot) * y_e)  # (17)
        theta_bar_rate = 0.0 if state is None else (theta_bar - state.theta_bar) / h  # [5]
        turn = -g.k3 * (theta_e - theta_bar) + reference.omega_bar * along.s_dot
        omega_bar = turn + theta_bar_rate  # [6]
        v_rate = 0.0 if state is None else (v_bar - state.v_bar) / h  # [5]
        omega_rate = 0.0 if state is None else (omega_bar - state.omega_bar) / h
        right, left, e_1, e_2 = self.torques(motion, v_bar, omega_bar, v_rate, omega_rate)
        after = LastTick(theta_bar, v_bar, omega_bar)
        said = (*errors, v_bar, omega_bar, v_rate, omega_rate, e_1, e_2)
        return LawOutput(right, left, after, said)

    # --- what follows from the equations, for `fleetloop check` ---------------------------------

    @classmethod
    def loop_elements(
        cls,
        gains: BacksteppingGains,
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
