"""Path following errors, which every robot records whatever its law.

x_e =  cos θ (x − x_d) + sin θ (y − y_d)          errors in the robot's axes      (8)
y_e = −sin θ (x − x_d) + cos θ (y − y_d)
θ_e = θ − θ_d, wrapped to (−π, π]
"""

from math import cos, pi, sin

from agents.laws.values import Reference, RobotMotion

PathErrors = tuple[float, float, float]
"""(8): where the robot is, seen from itself, against its reference: x_e, y_e [m], θ_e [rad]."""


def wrap(angle: float) -> float:
    """The same direction in (−π, π]."""
    if -pi < angle <= pi:
        return angle
    wrapped = angle % (2.0 * pi)
    return wrapped - 2.0 * pi if wrapped > pi else wrapped


def path_errors(
    x: float, y: float, theta: float, x_d: float, y_d: float, theta_d: float
) -> PathErrors:
    """Errors (8) of a robot at (x, y, θ) against its reference."""
    c, s = cos(theta), sin(theta)
    dx, dy = x - x_d, y - y_d
    return c * dx + s * dy, c * dy - s * dx, wrap(theta - theta_d)


def errors_of(motion: RobotMotion, reference: Reference) -> PathErrors:
    """Errors (8) of a robot against its reference."""
    x, y, theta = motion.x, motion.y, motion.theta
    return path_errors(x, y, theta, reference.x, reference.y, reference.theta)
