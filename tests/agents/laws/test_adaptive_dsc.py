"""The law as a whole: closed loop on its own robot model."""

from math import cos, sin

import pytest

from agents.laws.adaptive_dsc import AdaptiveDsc, DscState
from agents.laws.interface import PathVariable, Reference, RobotMotion
from agents.paths import robot_path
from configs.connections import NetworkLink
from configs.curves import reference_path
from configs.loading import load
from configs.paths import World
from configs.resolve import agent_brief, plant_brief
from plant.body import RigidBody, State
from plant.integrate import rk4

NOWHERE = NetworkLink("test", "", "", "")
PAPER = load("paper")
BRIEF = agent_brief(PAPER, "r1", network=NOWHERE, bus=())
H = 0.001
NO_PATH = robot_path(reference_path(PAPER.path), World(kind="world", y_m=2.0))
NAMES = [signal.name for signal in AdaptiveDsc.SIGNALS]


def drive(law, state: State, seconds: float, speed: float = 0.6):
    """Follow the paper's path at a constant ṡ; the last output."""
    robot = RigidBody(plant_brief(PAPER, network=NOWHERE).robots[0].body, NO_DISTURBANCE)
    path = robot_path(reference_path(PAPER.path), World(kind="world", y_m=2.0))
    memory = output = None
    for k in range(int(seconds / H)):
        sense = RobotMotion(state.x, state.y, state.theta, state.v, state.omega)
        output = law(memory, sense, path(speed * k * H), speed)
        memory = output.state
        state = rk4(robot, state, output.tau_right, output.tau_left, k * H, H)
    return output


NO_DISTURBANCE = plant_brief(PAPER, network=NOWHERE).robots[0].disturbance


def law():
    made = AdaptiveDsc(BRIEF.law.parameters, BRIEF.wheels, H, NO_PATH)
    return lambda state, motion, reference, s_dot: made.step(
        state, motion, reference, PathVariable(0.0, s_dot, 0.0)
    )


def test_errors_end_within_millimetres_from_the_papers_start() -> None:
    last = drive(law(), State(-8.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0), 12.0)
    x_e, y_e, theta_e, *_ = last.signals
    assert max(abs(x_e), abs(y_e), abs(theta_e)) < 0.003


def test_at_rest_on_its_reference_a_robot_is_told_to_stay() -> None:
    here = Reference(1.0, 2.0, 0.3, 1.0, 0.0)
    out = law()(None, RobotMotion(1.0, 2.0, 0.3, 0.0, 0.0), here, 0.0)
    assert (out.tau_right, out.tau_left) == (0.0, 0.0)


def test_the_first_tick_starts_the_filters_at_their_inputs() -> None:
    here = Reference(0.0, 0.0, 0.0, 1.0, 0.0)
    out = law()(None, RobotMotion(-0.5, 0.0, 0.0, 0.0, 0.0), here, 0.6)
    signals = dict(zip(NAMES, out.signals, strict=True))
    assert signals["alpha_v_m_s"] == pytest.approx(2.0 * 0.5 + 0.6)  # (15) with k_1 = 2
    assert signals["xi_e1_m_s"] == pytest.approx(-1.6)


def test_mirrored_situations_give_mirrored_torques() -> None:
    straight = Reference(0.0, 0.0, 0.0, 1.0, 0.0)
    left = law()(None, RobotMotion(0.1, 0.4, 0.2, 0.5, 0.1), straight, 0.6)
    right = law()(None, RobotMotion(0.1, -0.4, -0.2, 0.5, -0.1), straight, 0.6)
    assert left.tau_right == pytest.approx(right.tau_left)
    assert left.tau_left == pytest.approx(right.tau_right)


def test_turning_the_whole_world_changes_no_torque() -> None:
    angle = 0.8
    c, s = cos(angle), sin(angle)
    plain = law()(
        None, RobotMotion(0.1, 0.4, 0.2, 0.5, 0.1), Reference(0.0, 0.1, 0.1, 1.0, 0.3), 0.6
    )
    turned = law()(
        None,
        RobotMotion(c * 0.1 - s * 0.4, s * 0.1 + c * 0.4, 0.2 + angle, 0.5, 0.1),
        Reference(-s * 0.1, c * 0.1, 0.1 + angle, 1.0, 0.3),
        0.6,
    )
    assert (turned.tau_right, turned.tau_left) == pytest.approx((plain.tau_right, plain.tau_left))


def test_a_limited_law_keeps_its_estimates_and_moves_its_filters() -> None:
    made = AdaptiveDsc(BRIEF.law.parameters, BRIEF.wheels, H, NO_PATH)
    before = DscState((0.0, 0.0, 0.0), (1.0,) * 4, (2.0,) * 4, 3.0)
    after = DscState((4.0, 5.0, 6.0), (7.0,) * 4, (8.0,) * 4, 9.0)
    held = made.hold(before, after)
    assert held.filters == (4.0, 5.0, 6.0)
    assert (held.theta_1, held.theta_2, held.kappa) == ((1.0,) * 4, (2.0,) * 4, 3.0)
    first = made.hold(None, after)
    assert first.filters == (4.0, 5.0, 6.0)
    assert (first.theta_1, first.theta_2, first.kappa) == ((0.0,) * 4, (0.0,) * 4, 0.0)
