"""Gains of the shipped laws: names, units, bounds, defaults."""

from dataclasses import dataclass

from configs.parameters import Finite, NotNegative, Parameters, Positive, Seconds, parameter

Eight = tuple[Finite, Finite, Finite, Finite, Finite, Finite, Finite, Finite]
"""Θ's elements: c b, d̄_11, d̄_12, m̄_1, c/b, d̄_21, d̄_22, m̄_2 [kg·m², N·m·s]."""
PAPER_THETA: Eight = (3.68e-5, 0.02, 0.0, 0.007664, 3.68e-3, 0.0, 0.02, 0.0072416)
"""Of the paper's robot, with d_11 = d_22 = 0.02 N·m·s."""


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


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveDscGains(SurfaceGains):
    """Gains of (15)-(36)."""

    k5: Eight = parameter((0.1,) * 8, "(35), diagonal of K_5")
    sigma_max: Positive = parameter(1.0, "bound of every element of Θ")
    sigma_margin: Positive = parameter(0.1, "the projection's k")
    eta: NotNegative = parameter(0.001, "(36) [1/s]")
    rho: Positive = parameter(1.0, "(36)")
    sgn_width: Positive = parameter(0.001, "sgn(e) is tanh(e / sgn_width)")
    theta_hat_0: Eight = parameter((0.0,) * 8, "Θ̂ at the start")
    kappa_hat_0: NotNegative = parameter(0.0, "κ̂ at the start")


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveDscRobustGains(AdaptiveDscGains):
    """Gains of (15)-(36), and the two bounds."""

    v_bar_limit_m_s: Positive = parameter(2.0, "largest approach speed V")
    torque_limit_wheel_N_m: Positive = parameter(2.0, "per wheel, at the wheel")


@dataclass(frozen=True, slots=True, kw_only=True)
class FixedDscGains(SurfaceGains):
    """Gains of (15)-(34), and the parameters."""

    theta: Eight = parameter(PAPER_THETA, "Θ of the design [kg·m², N·m·s]")
    factor: NotNegative = parameter(1.0, "the law uses this multiple of theta")


@dataclass(frozen=True, slots=True, kw_only=True)
class BacksteppingGains(Parameters):
    """Gains of (15), (17), [4] and of the heading, and the parameters."""

    k1: Positive = parameter(2.0, "(15), of x_e [1/s]")
    k2: Positive = parameter(3.0, "(17), of y_e [1/m]")
    k3: Positive = parameter(1.5, "of the heading [1/s]")
    k4: Positive = parameter(3.0, "[4], of the speeds [N·m·s/m, N·m·s/rad]")
    theta: Eight = parameter(PAPER_THETA, "Θ of the design [kg·m², N·m·s]")
    factor: NotNegative = parameter(1.0, "the law uses this multiple of theta")


@dataclass(frozen=True, slots=True, kw_only=True)
class BacksteppingAnalyticGains(BacksteppingGains):
    """Those of backstepping, and the least divisor of [2]."""

    margin: Positive = parameter(0.1, "least 1 − G x_e")
