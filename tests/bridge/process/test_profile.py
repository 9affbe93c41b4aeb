"""Where processor time goes."""

import time

from bridge.process.profile import PARTS, Sampler
from configs.brief import WheelDisturbance
from configs.sections import Body
from plant.body import RigidBody, State
from plant.integrate import rk4


def test_time_spent_in_the_plant_is_the_plants() -> None:
    body = Body()
    robot = RigidBody(body, WheelDisturbance(phase_rad=0.0))
    state = State(0.0, 0.0, 0.0, 0.5, 0.1, 0.0, 0.0)
    sampler = Sampler()
    with sampler:
        began = time.thread_time()
        while time.thread_time() - began < 0.3:
            for _ in range(100):
                state = rk4(robot, state, 0.1, 0.1, 0.0, 0.001)
    spent = sampler.nanoseconds()
    assert set(spent) == set(PARTS)
    assert sum(spent.values()) >= 0.25e9
    assert spent["plant"] > 0.6 * sum(spent.values())


def test_nothing_was_spent_before_it_is_entered() -> None:
    assert not any(Sampler().nanoseconds().values())
