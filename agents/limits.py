"""Torque limits, and a plausibility check of the encoders.

    |τ| ≤ τ_max,   |τ_k − τ_{k−1}| ≤ τ'_max h                    at each wheel           (1)
    ε ← ε exp(−h/T) + (φ_k − φ_{k−1}) − h (ν_k + ν_{k−1})/2      encoder mismatch [rad]  (2)

φ, ν angle [rad] and speed [rad/s] of a wheel   h control period [s]   T = `FORGET_S`

(2) is near 0 for a sound encoder: a jump of the angle or a flipped sign shows in it at once, a
frozen angle or a wrong speed within T. Where (1) acts, `Law.hold` is called, so that adaptation
does not learn the limit.
"""

from math import exp, inf
from typing import Final

FORGET_S: Final = 0.2


def limited(torque: float, before: float, limit: float, step: float) -> float:
    """Equation (1) at one wheel: `step` is τ'_max h."""
    torque = min(max(torque, before - step), before + step)
    return min(max(torque, -limit), limit)


class TorqueLimiter:
    """Equation (1) for both wheels. Infinite limits change nothing."""

    __slots__ = ("_last", "_limit", "_step", "active")

    def __init__(self, limit_wheel_N_m: float, slew_wheel_N_m_s: float, period_s: float) -> None:
        self._limit = limit_wheel_N_m
        self._step = slew_wheel_N_m_s * period_s
        self._last = (0.0, 0.0)
        self.active = limit_wheel_N_m < inf or slew_wheel_N_m_s < inf
        """Whether any limit is finite."""

    def __call__(self, right: float, left: float) -> tuple[float, float]:
        """The limited torques [N·m], at the wheels."""
        before_right, before_left = self._last
        most, step = self._limit, self._step
        self._last = (
            limited(right, before_right, most, step),
            limited(left, before_left, most, step),
        )
        return self._last

    def reset(self) -> None:
        """Start from torque 0."""
        self._last = (0.0, 0.0)


class EncoderCheck:
    """Equation (2) for both wheels."""

    __slots__ = ("_keep", "_last", "_left", "_limit", "_period_s", "_right", "active")

    def __init__(self, limit_wheel_rad: float, period_s: float) -> None:
        self._limit = limit_wheel_rad
        self._period_s = period_s
        self._keep = exp(-period_s / FORGET_S)
        self._last: tuple[float, float, float, float] | None = None
        self._right = self._left = 0.0
        self.active = limit_wheel_rad < inf
        """Whether the limit is finite."""

    def __call__(self, motion: tuple[float, float, float, float]) -> str | None:
        """The fault of an encoder, None if there is none; call once per period."""
        last, self._last = self._last, motion
        if last is None:
            return None
        half = 0.5 * self._period_s
        self._right = self._keep * self._right + motion[0] - last[0] - half * (motion[2] + last[2])
        self._left = self._keep * self._left + motion[1] - last[1] - half * (motion[3] + last[3])
        for name, mismatch in (("right", self._right), ("left", self._left)):
            if abs(mismatch) > self._limit:
                return f"{name} encoder: angle and speed disagree by {abs(mismatch):.2g} rad"
        return None
