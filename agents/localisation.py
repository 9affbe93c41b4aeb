"""The pose estimate: from the localisation system, from wheel odometry, or both.

    fused      the newest fix, carried on by odometry from its own instant
    external   the newest fix, held
    odometry   the first fix, carried on by odometry alone

Odometry over one period, from wheel angle increments δ_R, δ_L:

    d = r (δ_R + δ_L)/2,  φ = r (δ_R − δ_L)/(2 b)
    x += d cos(θ + φ/2),  y += d sin(θ + φ/2),  θ += φ

A fix F of an instant with odometry O gives, with odometry P now, F ⊕ (P ⊖ O): a fix may be late by
some periods without loss of the motion since. Speeds always come from the
wheels: v = r (ν_R + ν_L)/2, ω = r (ν_R − ν_L)/(2 b), the inverse of (3). The heading isn't wrapped:
a fix is taken as the nearest angle of its direction.
"""

from collections import deque
from math import cos, pi, sin

from agents.laws.interface import RobotMotion
from configs.brief import Wheels

Planar = tuple[float, float, float]
"""x, y [m], θ [rad]."""
Anchor = tuple[float, float, float, float, float, float, float, float]
"""A fix, the odometry at its instant, and the turn from odometry's axes to the world's."""


def along(right: float, left: float, half: float, half_over_b: float) -> tuple[float, float]:
    """Of the body from the wheels: d and φ from angles, v and ω from speeds; `half` is r/2."""
    return half * (right + left), half_over_b * (right - left)


def moved(odometry: Planar, distance: float, turn: float) -> Planar:
    """Odometry after one period, from d and φ."""
    x, y, theta = odometry
    middle = theta + 0.5 * turn
    return x + distance * cos(middle), y + distance * sin(middle), theta + turn


def nearest_turn(theta: float, near: float) -> float:
    """The angle of the direction θ that is nearest to another one."""
    return theta + 2.0 * pi * round((near - theta) / (2.0 * pi))


def heading_then(anchor: Anchor, odometry: Planar) -> float:
    """The heading at an instant of this odometry, by an anchor."""
    return anchor[2] + (odometry[2] - anchor[5])


def anchored(x: float, y: float, theta: float, odometry: Planar) -> Anchor:
    """The anchor of a fix at an instant of this odometry."""
    o_x, o_y, o_theta = odometry
    turned = theta - o_theta
    return x, y, theta, o_x, o_y, o_theta, cos(turned), sin(turned)


def carried(anchor: Anchor, odometry: Planar) -> Planar:
    """F ⊕ (P ⊖ O): the pose now by an anchor and the odometry now."""
    f_x, f_y, f_theta, o_x, o_y, o_theta, c, s = anchor
    x, y, theta = odometry
    dx, dy = x - o_x, y - o_y
    return f_x + (c * dx - s * dy), f_y + (s * dx + c * dy), f_theta + (theta - o_theta)


class Localiser:
    """The pose estimator of one robot. Per period: `wheels` first, then `fix`."""

    __slots__ = (
        "_anchor",
        "_fixed",
        "_half",
        "_half_over_b",
        "_held",
        "_left",
        "_mode",
        "_odometry",
        "_past",
        "_right",
        "_speeds",
    )

    def __init__(self, mode: str, wheels: Wheels, delay_ticks: int = 0) -> None:
        self._mode = mode
        self._half = 0.5 * wheels.radius_m
        self._half_over_b = 0.5 * wheels.radius_m / wheels.half_track_m
        self._right: float | None = None
        self._left = 0.0
        self._fixed = False
        self._speeds = (0.0, 0.0)
        self._odometry: Planar = (0.0, 0.0, 0.0)
        self._past = deque([self._odometry] * (delay_ticks + 1), maxlen=delay_ticks + 1)
        self._held = mode == "external"
        self._anchor: Anchor = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)

    def remember(self, delay_ticks: int) -> None:
        """Keep the odometry of so many periods from now on; what isn't kept already is unknown."""
        unknown = [(0.0, 0.0, 0.0)] * (delay_ticks + 1 - len(self._past))
        self._past = deque([*unknown, *self._past], maxlen=delay_ticks + 1)

    def wheels(
        self, right_wheel_rad: float, left_wheel_rad: float, right_speed: float, left_speed: float
    ) -> RobotMotion:
        """Update by wheel angles [rad] and speeds [rad/s]; return the motion now."""
        if self._right is not None:
            right, left = right_wheel_rad - self._right, left_wheel_rad - self._left
            distance, turn = along(right, left, self._half, self._half_over_b)
            self._odometry = moved(self._odometry, distance, turn)
        self._right, self._left = right_wheel_rad, left_wheel_rad
        self._past.append(self._odometry)
        self._speeds = along(right_speed, left_speed, self._half, self._half_over_b)
        return self._motion()

    def fix(self, x: float, y: float, theta: float, ticks_ago: int = 0) -> RobotMotion:
        """Update by a pose of now or of some periods ago; return the motion now."""
        if self._fixed and self._mode == "odometry":
            return self._motion()
        odometry = self._past[-1 - ticks_ago]
        if self._fixed:
            theta = nearest_turn(theta, heading_then(self._anchor, odometry))
        self._fixed = True
        self._anchor = anchored(x, y, theta, odometry)
        return self._motion()

    def _motion(self) -> RobotMotion:
        v, omega = self._speeds
        if self._held:
            x, y, theta = self._anchor[:3]
        else:
            x, y, theta = carried(self._anchor, self._odometry)
        return RobotMotion(x, y, theta, v, omega)
