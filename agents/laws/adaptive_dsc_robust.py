"""The adaptive law for real rates, real drives and starts off the path.

Four changes to `agents.laws.adaptive_dsc`, all of them that law again to first order on the path:

    v̄ = −V tanh(k_1 x_e / V) + v̄_d ṡ cos θ_e           bounded approach speed    (15)
    θ̄ = −atan(k_2 σ(ṡ) y_e / (1 + k_2 |x_e|))            no spinning far off       (17)
    |τ| ≤ `torque_limit_wheel_N_m`; Θ̂ and κ̂ hold still while a wheel is at it           (34)
    Θ̂_r' divided by 1 + h |K_5 F_r²| / (k_4/4)           stable when sampled       (35)
"""

from collections.abc import Sequence
from dataclasses import replace
from math import atan, inf, tanh
from typing import Any

from mypy_extensions import mypyc_attr

from agents.laws.adaptive_dsc import AdaptiveDsc, DscState, loop_elements
from agents.laws.dsc_terms import Projection, Row, adapt, clip
from agents.laws.gains import AdaptiveDscRobustGains
from agents.laws.interface import (
    AdaptationLimit,
    LawOutput,
    LoopElement,
    PathVariable,
    Reference,
    RobotMotion,
    RobotPath,
    Theta,
    Wheels,
)


def bounded_approach(
    x_e: float, y_e: float, k1: float, k2: float, limit: float
) -> tuple[float, float]:
    """The part of (15) that closes x_e, with V = `limit`, and (17)."""
    return -limit * tanh(k1 * x_e / limit), -atan(k2 * y_e / (1.0 + k2 * abs(x_e)))


def adapt_normalised(
    row: Row, regressor: Row, error: float, rates: Row, bounds: Projection, k4: float
) -> Row:
    """One period of (35), normalised, for one row of Ω."""
    f1, f2, f3, f4 = regressor
    r1, r2, r3, r4 = rates
    size = r1 * f1 * f1 + r2 * f2 * f2 + r3 * f3 * f3 + r4 * f4 * f4
    normalised = error * (1.0 / (1.0 + size / (0.25 * k4)))
    return adapt(row, regressor, normalised, rates, bounds)


def at_limit(right: float, left: float, limit: float) -> bool:
    """Whether a wheel's torque is beyond its limit: Θ̂ and κ̂ hold still."""
    return abs(right) > limit or abs(left) > limit


@mypyc_attr(allow_interpreted_subclasses=True)
class AdaptiveDscRobust(AdaptiveDsc):
    """Equations (8)-(36) with the four changes above."""

    Gains = AdaptiveDscRobustGains

    def __init__(
        self,
        gains: AdaptiveDscRobustGains,
        wheels: Wheels,
        period_s: float,
        path: RobotPath,
    ) -> None:
        super().__init__(gains, wheels, period_s, path)
        self._v_limit = gains.v_bar_limit_m_s
        self._tau_limit = gains.torque_limit_wheel_N_m

    def step(
        self, state: DscState | None, motion: RobotMotion, reference: Reference, along: PathVariable
    ) -> LawOutput:
        """One period; at the torque limit the estimates hold still."""
        out = super().step(state, motion, reference, along)
        limit, right, left = self._tau_limit, out.tau_right, out.tau_left
        if at_limit(right, left, limit):
            right, left = clip(right, limit), clip(left, limit)
            return LawOutput(right, left, self.hold(state, out.state), out.signals)
        return out

    def _approach(self, x_e: float, y_e: float, k1: float, k2: float) -> tuple[float, float]:
        return bounded_approach(x_e, y_e, k1, k2, self._v_limit)

    def _learn(self, row: Row, regressor: Row, error: float, rates: Row, k4: float) -> Row:
        return adapt_normalised(row, regressor, error, rates, self._bounds, k4)

    # --- what follows from the equations, for `fleetloop check` ---------------------------------

    SATURATION = ""

    @classmethod
    def torque_limit_wheel_N_m(cls, gains: Any) -> float:
        """The law's limit."""
        return float(gains.torque_limit_wheel_N_m)

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
        """Those of the law without its torque limit: close to the path it doesn't act."""
        unlimited = replace(gains, torque_limit_wheel_N_m=inf)
        law = cls(unlimited, wheels, period_s, path)
        return loop_elements(law, unlimited, path, along, theta)

    @classmethod
    def adaptation_limit(cls, gains: Any, period_s: float) -> AdaptationLimit | None:  # noqa: ARG003
        """None: (35) is normalised, and is stable with any gains."""
        return None
