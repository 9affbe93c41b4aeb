"""Divergence of a body's motion: bounds, and the state before.

    |v| + b |ω| ≤ r ν_max                      no wheel turns faster than `FASTEST_WHEEL_RAD_S`  (1)
    |x| + |y| + |θ| + |φ_R| + |φ_L| ≤ `FARTHEST`                        [m] and [rad] together  (2)

The integration holds each of its steps against (1) and (2); what isn't a number is outside as well.
From then on the body stands still where it was last within them. Its drives have no estimate of
their encoders any more: they disarm with that error, which nothing clears, so the robot's
controller stops it. Robots beside it notice nothing.
"""

from typing import Final, NamedTuple

FASTEST_WHEEL_RAD_S: Final = 1e6
FARTHEST: Final = 1e9
"""A float still tells a tenth of a micrometre apart there, and an encoder its counts."""


class Divergence(NamedTuple):
    """Time at which the motion of a body left its bounds, and its state before."""

    t_s: float  # scenario time
    v: float  # [m/s]
    omega: float  # [rad/s]
    right_wheel_N_m: float  # torque
    left_wheel_N_m: float

    def __str__(self) -> str:
        """For people."""
        return (
            f"its motion diverged: v = {self.v:.3g} m/s, ω = {self.omega:.3g} rad/s under wheel"
            f" torques of {self.right_wheel_N_m:.3g} and {self.left_wheel_N_m:.3g} N·m"
        )
