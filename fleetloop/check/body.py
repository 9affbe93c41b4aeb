"""The rigid body of a robot from its section, for closed forms: `plant.body` undisturbed."""

from configs.brief import WheelDisturbance
from configs.sections import Body
from plant.body import RigidBody


def robot_body(body: Body) -> RigidBody:
    """The rigid body of (2)-(4), undisturbed."""
    return RigidBody(body, WheelDisturbance(phase_rad=0.0))


def inertias(body: Body) -> tuple[float, float]:
    """(m̄_1, m̄_2) of (4) [kg·m²]."""
    robot = robot_body(body)
    return robot.mbar_1, robot.mbar_2
