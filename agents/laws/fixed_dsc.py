"""A baseline without adaptation: dynamic surface control with the parameters that the design has.

    u_r = −k_4 e_r − F_r · f Θ                    (34) with Θ̂ = f Θ for ever, κ̂ = 0

Θ is what the designer takes for the robot's, `factor` f how far that is off: f = 1 with the true Θ
is the best that adaptation could come to, f = 0 is the speed loop alone. All else is
`agents.laws.adaptive_dsc`. The default Θ is that of the paper's robot, d_11 = d_22 = 0.02 N·m·s.
"""

from collections.abc import Sequence
from typing import Any

from agents.laws.adaptive_dsc import AdaptiveDsc
from agents.laws.gains import AdaptiveDscGains, Eight, FixedDscGains
from agents.laws.interface import (
    AdaptationLimit,
    LoopElement,
    PathVariable,
    RobotPath,
    Theta,
    Wheels,
)


def scaled(theta: Eight, factor: float) -> Eight:
    """A multiple of Θ."""
    t1, t2, t3, t4, t5, t6, t7, t8 = (factor * element for element in theta)
    return t1, t2, t3, t4, t5, t6, t7, t8


class FixedDsc(AdaptiveDsc):
    """Equations (8)-(34) with fixed parameters."""

    Gains = FixedDscGains

    def __init__(
        self, gains: FixedDscGains, wheels: Wheels, period_s: float, path: RobotPath
    ) -> None:
        fixed = AdaptiveDscGains(
            k1=gains.k1,
            k2=gains.k2,
            k3=gains.k3,
            k4=gains.k4,
            gamma_1_s=gains.gamma_1_s,
            gamma_2_s=gains.gamma_2_s,
            gamma_3_s=gains.gamma_3_s,
            k5=(0.0,) * 8,
            sigma_max=max(1.0, gains.factor * max(map(abs, gains.theta))),
            eta=0.0,
            theta_hat_0=scaled(gains.theta, gains.factor),
        )
        super().__init__(fixed, wheels, period_s, path)

    # --- what follows from the equations, for `fleetloop check` ---------------------------------

    SATURATION = ""

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
        """The first one of the adaptive law: Θ̂ stays at f Θ."""
        elements = super().loop_elements(gains, wheels, period_s, path, along, theta)
        return None if elements is None else elements[:1]

    @classmethod
    def adaptation_limit(cls, gains: Any, period_s: float) -> AdaptationLimit | None:  # noqa: ARG003
        """None: nothing adapts."""
        return None
