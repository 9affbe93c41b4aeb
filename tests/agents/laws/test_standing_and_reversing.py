"""Shipped laws where the path variable stands or goes back: (18), (22), (55) need ṡ > 0 for y_e."""

import pytest

from agents.laws.adaptive_dsc import AdaptiveDsc
from agents.laws.adaptive_dsc_robust import AdaptiveDscRobust
from agents.laws.backstepping_analytic import BacksteppingAnalytic
from agents.laws.backstepping_numeric import BacksteppingNumeric
from agents.laws.fixed_dsc import FixedDsc
from agents.laws.interface import PathVariable, RobotMotion, Wheels
from agents.paths import robot_path
from configs.connections import NetworkLink
from configs.curves import reference_path
from configs.loading import load
from configs.paths import World
from configs.resolve import plant_brief
from plant.body import RigidBody, State
from plant.integrate import rk4

PAPER = load("paper")
PLANT = plant_brief(PAPER, network=NetworkLink("test", "", "", "")).robots[0]
BODY = RigidBody(PLANT.body, PLANT.disturbance)
PATH = robot_path(reference_path(PAPER.path), World(kind="world", y_m=2.0))
H = 0.001
SHIPPED = pytest.mark.parametrize(
    "law", [AdaptiveDsc, AdaptiveDscRobust, FixedDsc, BacksteppingAnalytic, BacksteppingNumeric]
)


def errors_after(law: type, s_dot: float, seconds: float) -> tuple[float, float, float]:
    """(x_e, y_e, θ_e) of a robot that begins at rest, 5 cm to the left of its path."""
    made = law(law.Gains(), Wheels(0.04, 0.1), H, PATH)
    x, y, theta, *_ = PATH(0.0)
    state = State(x, y + 0.05, theta, 0.0, 0.0, 0.0, 0.0)
    memory = out = None
    for k in range(round(seconds / H)):
        s = s_dot * k * H
        motion = RobotMotion(state.x, state.y, state.theta, state.v, state.omega)
        out = made.step(memory, motion, PATH(s), PathVariable(s, s_dot, 0.0))
        memory = out.state
        state = rk4(BODY, state, out.tau_right, out.tau_left, k * H, H)
    return out.signals[:3]


@SHIPPED
def test_a_path_that_is_followed_backwards_is_closed_in_on_as_well(law: type) -> None:
    x_e, y_e, theta_e = errors_after(law, -0.6, 8.0)
    assert max(abs(x_e), abs(y_e), abs(theta_e)) < 0.005


@SHIPPED
def test_while_the_path_variable_stands_the_error_across_the_path_stays(law: type) -> None:
    x_e, y_e, theta_e = errors_after(law, 0.0, 8.0)
    assert abs(x_e) < 1e-3
    assert y_e == pytest.approx(0.05, abs=0.01)
    assert abs(theta_e) < 0.2  # that of (17)
