"""The robust law at real rates: random starts, a period of delay, a torque limit."""

import random
from math import cos, pi, sin

import pytest

from agents.laws.adaptive_dsc_robust import AdaptiveDscRobust
from agents.laws.interface import PathVariable, RobotMotion
from agents.paths import robot_path
from configs.connections import NetworkLink
from configs.curves import reference_path
from configs.loading import load
from configs.paths import AT_CENTRE
from configs.resolve import agent_brief, plant_brief
from plant.body import RigidBody, State
from plant.integrate import rk4

NOWHERE = NetworkLink("test", "", "", "")
STARTS = {"realtime_100hz": 200, "realtime_200hz": 80, "realtime_500hz": 40}
"""The slower the rate, the less forgiving."""
SECONDS = 14.0
NAMES = [signal.name for signal in AdaptiveDscRobust.SIGNALS]


def law_of(brief, path, period_s: float):
    made = AdaptiveDscRobust(brief.law.parameters, brief.wheels, period_s, path)
    return lambda state, motion, reference, s_dot: made.step(
        state, motion, reference, PathVariable(0.0, s_dot, 0.0)
    )


def final_errors(scenario, seed: int) -> tuple[float, float]:
    """Largest |x_e|, |y_e| of the last second, from a random start within 3 m, feedback late."""
    draw = random.Random(seed)
    brief = agent_brief(scenario, "r1", network=NOWHERE, bus=())
    plant = plant_brief(scenario, network=NOWHERE).robots[0]
    robot = RigidBody(plant.body, plant.disturbance)
    path = robot_path(reference_path(scenario.path), AT_CENTRE)
    h = scenario.clock.control_period_s
    law = law_of(brief, path, h)
    far, where = 3.0 * draw.random() ** 0.5, draw.uniform(-pi, pi)
    start = path(0.0)
    state = State(
        start.x + far * cos(where), start.y + far * sin(where), draw.uniform(-pi, pi), 0, 0, 0, 0
    )
    memory, seen = None, state
    worst_x = worst_y = 0.0
    ticks = round(SECONDS / h)
    for k in range(ticks):
        sense = RobotMotion(seen.x, seen.y, seen.theta, seen.v, seen.omega)
        out = law(memory, sense, path(0.6 * k * h), 0.6)
        memory, seen = out.state, state
        assert max(abs(out.tau_right), abs(out.tau_left)) <= 2.0
        state = rk4(robot, state, out.tau_right, out.tau_left, k * h, h)
        if k * h > SECONDS - 1.0:
            worst_x = max(worst_x, abs(out.signals[0]))
            worst_y = max(worst_y, abs(out.signals[1]))
    return worst_x, worst_y


@pytest.mark.parametrize("name", STARTS)
def test_it_tracks_from_any_start_within_three_metres(name: str) -> None:
    scenario = load(name)
    finals = [final_errors(scenario, seed) for seed in range(STARTS[name])]
    assert max(x for x, _ in finals) < 0.05
    assert max(y for _, y in finals) < 0.05


def test_far_off_the_path_the_approach_speed_is_bounded() -> None:
    brief = agent_brief(load("realtime_100hz"), "r1", network=NOWHERE, bus=())
    path = robot_path(reference_path(load("realtime_100hz").path), AT_CENTRE)
    law = law_of(brief, path, 0.01)
    out = law(None, RobotMotion(-500.0, 0.0, 0.0, 0.0, 0.0), path(0.0), 0.0)
    signals = dict(zip(NAMES, out.signals, strict=True))
    assert signals["alpha_v_m_s"] == pytest.approx(2.0)
    assert abs(out.tau_right) <= 2.0


def test_estimates_hold_still_while_a_wheel_is_at_its_limit() -> None:
    brief = agent_brief(load("realtime_100hz"), "r1", network=NOWHERE, bus=())
    path = robot_path(reference_path(load("realtime_100hz").path), AT_CENTRE)
    law = law_of(brief, path, 0.01)
    first = law(None, RobotMotion(-9.0, 3.0, 1.0, 5.0, -9.0), path(0.0), 0.6)
    again = law(first.state, RobotMotion(-9.0, 3.0, 1.0, 5.0, -9.0), path(0.0), 0.6)
    assert max(abs(again.tau_right), abs(again.tau_left)) == 2.0
    assert again.state.theta_1 == first.state.theta_1
    assert again.state.theta_2 == first.state.theta_2
