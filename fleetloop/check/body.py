"""The inertias of a robot as its wheels feel them, as `plant.body` has them."""

from dataclasses import asdict

from configs.brief import Body as BodyModel
from configs.brief import Disturbance
from configs.sections import Body
from plant.body import RigidBody


def robot_body(body: Body) -> RigidBody:
    """The rigid body of (2)-(4), undisturbed."""
    return RigidBody(BodyModel(**asdict(body)), Disturbance(0.0, 0.0, 0.0))


def inertias(body: Body) -> tuple[float, float]:
    """(m̄_1, m̄_2) of (4) [kg·m²]."""
    robot = robot_body(body)
    return robot.mbar_1, robot.mbar_2
