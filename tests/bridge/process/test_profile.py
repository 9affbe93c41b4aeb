"""Where processor time goes."""

import time
from collections.abc import Callable
from pathlib import Path

from bridge.frame import Frame
from bridge.process import profile
from bridge.process.profile import PARTS, Sampler
from bridge.wire.bits import stuffed_bits
from configs.brief import WheelDisturbance
from configs.sections import Body
from plant.body import RigidBody, State
from plant.integrate import rk4


def spent_on(work: Callable[[], object]) -> dict[str, int]:
    """Processor time by part while something is done for 0.3 s of it."""
    sampler = Sampler()
    with sampler:
        began = time.thread_time()
        while time.thread_time() - began < 0.3:
            for _ in range(100):
                work()
    spent = sampler.nanoseconds()
    assert set(spent) == set(PARTS)
    assert sum(spent.values()) >= 0.25e9
    return spent


def test_time_spent_in_the_plant_is_the_plants() -> None:
    robot = RigidBody(Body(), WheelDisturbance(phase_rad=0.0))
    state = State(0.0, 0.0, 0.0, 0.5, 0.1, 0.0, 0.0)

    def integrate() -> None:
        nonlocal state
        state = rk4(robot, state, 0.1, 0.1, 0.0, 0.001)

    spent = spent_on(integrate)
    assert spent["plant"] > 0.6 * sum(spent.values())


def test_time_spent_on_the_emulated_wire_is_the_buses() -> None:
    spent = spent_on(lambda: stuffed_bits(Frame(0x123, b"\0" * 8)))
    assert spent["bus"] > 0.6 * sum(spent.values())


def test_every_place_of_ours_is_there() -> None:
    root = Path(profile.__file__).parents[2]
    ours = [
        place for place, _ in profile._PLACES if place[1:].startswith(("agents", "bridge", "plant"))
    ]
    assert len(ours) > 5
    assert all((root / place[1:]).exists() for place in ours)


def test_nothing_was_spent_before_it_is_entered() -> None:
    assert not any(Sampler().nanoseconds().values())
