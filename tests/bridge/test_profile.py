"""Where processor time goes."""

import time

from bridge.profile import PARTS, Sampler
from configs.brief import Body, Disturbance
from plant.body import RigidBody, State
from plant.integrate import rk4


def test_time_spent_in_the_plant_is_the_plants() -> None:
    body = Body(0.04, 0.1, 0.02, 2.3, 0.28, 0.01, 0.0056, 0.002, 0.02, 0.02, 1)
    robot = RigidBody(body, Disturbance(0.0, 0.0, 0.0))
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
