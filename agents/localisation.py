"""Where the robot believes it is: from the localisation system, from wheel odometry, or both.

    fused      the newest fix, carried forward by odometry until the next one
    external   the newest fix, held
    odometry   the first fix, carried forward by odometry for ever

Odometry over one period, from wheel angle increments δ_R, δ_L:

    d = r (δ_R + δ_L)/2,  φ = r (δ_R − δ_L)/(2 b)
    x += d cos(θ + φ/2),  y += d sin(θ + φ/2),  θ += φ

Speeds always come from the wheels: v = r (ν_R + ν_L)/2, ω = r (ν_R − ν_L)/(2 b), the inverse of
(3). The heading isn't wrapped: a fix is taken as the nearest angle of its direction.
"""

from math import cos, pi, sin

from agents.laws import Sense
from configs.brief import Wheels


class Localiser:
    """Keeps the pose estimate of one robot. Wheels first, then a fix of the same instant."""

    __slots__ = ("_fixed", "_half", "_half_over_b", "_left", "_mode", "_right", "_sense")

    def __init__(self, mode: str, wheels: Wheels) -> None:
        self._mode = mode
        self._half = 0.5 * wheels.radius_m
        self._half_over_b = 0.5 * wheels.radius_m / wheels.half_track_m
        self._right: float | None = None
        self._left = 0.0
        self._fixed = False
        self._sense = Sense(0.0, 0.0, 0.0, 0.0, 0.0)

    def wheels(
        self, right_angle: float, left_angle: float, right_speed: float, left_speed: float
    ) -> Sense:
        """Take wheel angles [rad] and speeds [rad/s]; return the motion now."""
        x, y, theta, _, _ = self._sense
        if self._right is not None and self._mode != "external":
            right, left = right_angle - self._right, left_angle - self._left
            distance = self._half * (right + left)
            turn = self._half_over_b * (right - left)
            middle = theta + 0.5 * turn
            x += distance * cos(middle)
            y += distance * sin(middle)
            theta += turn
        self._right, self._left = right_angle, left_angle
        self._sense = Sense(
            x,
            y,
            theta,
            self._half * (right_speed + left_speed),
            self._half_over_b * (right_speed - left_speed),
        )
        return self._sense

    def fix(self, x: float, y: float, theta: float) -> Sense:
        """Take a pose of this instant from the localisation system; return the motion now."""
        if self._fixed and self._mode == "odometry":
            return self._sense
        if self._fixed:
            turns = round((self._sense.theta - theta) / (2.0 * pi))
            theta += 2.0 * pi * turns
        self._fixed = True
        self._sense = Sense(x, y, theta, self._sense.v, self._sense.omega)
        return self._sense
