"""The baselines: fixed parameters, and backstepping with analytic and numerical derivatives."""

from itertools import pairwise
from math import cos, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.laws.adaptive_dsc import AdaptiveDsc
from agents.laws.backstepping_analytic import BacksteppingAnalytic
from agents.laws.backstepping_numeric import BacksteppingNumeric
from agents.laws.fixed_dsc import FixedDsc
from agents.laws.gains import PAPER_THETA
from agents.laws.interface import PathVariable, RobotMotion, Wheels
from agents.laws.path_errors import errors_of, path_errors
from agents.paths import robot_path
from configs.connections import NetworkLink
from configs.curves import reference_path
from configs.loading import load
from configs.paths import World
from configs.resolve import plant_brief
from fleetloop.check.loop import true_theta
from plant.body import RigidBody, State
from plant.integrate import rk4

PAPER = load("paper")
PLANT = plant_brief(PAPER, network=NetworkLink("test", "", "", "")).robots[0]
BODY = RigidBody(PLANT.body, PLANT.disturbance)
WHEELS = Wheels(0.04, 0.1)
H = 0.001
PATH = robot_path(reference_path(PAPER.path), World(kind="world", y_m=2.0))
START = State(-8.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def run(law, seconds: float) -> tuple[list, float]:
    """(outputs, largest |x_e| or |y_e| of the last second) along the paper's path at 0.6 m/s."""
    state, memory, outputs = START, None, []
    for k in range(round(seconds / H)):
        s = 0.6 * k * H
        motion = RobotMotion(state.x, state.y, state.theta, state.v, state.omega)
        out = law.step(memory, motion, PATH(s), PathVariable(s, 0.6, 0.0))
        outputs.append(out)
        memory = out.state
        state = rk4(BODY, state, out.tau_right, out.tau_left, k * H, H)
    last = outputs[-round(1.0 / H) :]
    return outputs, max(abs(value) for out in last for value in out.signals[:2])


def fixed(factor: float) -> FixedDsc:
    return FixedDsc(FixedDsc.Gains(factor=factor), WHEELS, H, PATH)


def test_the_default_parameters_are_those_of_the_papers_robot() -> None:
    assert true_theta(BODY) == pytest.approx(PAPER_THETA, rel=1e-6, abs=1e-12)


def test_it_is_the_adaptive_law_that_has_stopped_learning() -> None:
    gains = AdaptiveDsc.Gains(k5=(0.0,) * 8, eta=0.0, theta_hat_0=PAPER_THETA)
    ours, _ = run(fixed(1.0), 0.5)
    theirs, _ = run(AdaptiveDsc(gains, WHEELS, H, PATH), 0.5)
    torques = [[(out.tau_right, out.tau_left) for out in run] for run in (ours, theirs)]
    assert torques[0] == torques[1]


def test_parameters_never_move_and_true_ones_leave_less_error_than_wrong_ones() -> None:
    outputs, true = run(fixed(1.0), 15.0)
    assert {out.signals[8:16] for out in outputs} == {PAPER_THETA}
    assert {out.signals[16] for out in outputs} == {0.0}
    _, none = run(fixed(0.0), 15.0)
    _, three = run(fixed(3.0), 15.0)
    assert true < 0.001
    assert none > 2.0 * true
    assert three > 2.0 * none


def backstepping() -> BacksteppingAnalytic:
    return BacksteppingAnalytic(BacksteppingAnalytic.Gains(), WHEELS, H, PATH)


near = st.floats(-0.3, 0.3)


@given(near, near, st.floats(-1.5, 1.5), st.floats(-1, 2), st.floats(-3, 3), st.floats(0, 20), near)
def test_the_derivatives_of_the_virtual_controls_are_those_along_the_motion(
    off_x: float, off_y: float, turned: float, v: float, omega: float, s: float, s_ddot: float
) -> None:
    law, s_dot, here = backstepping(), 0.6, PATH(s)
    dt = 1e-5

    def at(t: float) -> tuple[float, float, float, float, float]:
        theta = here.theta + turned + omega * t
        mean = here.theta + turned + 0.5 * omega * t
        x, y = here.x + off_x + v * t * cos(mean), here.y + off_y + v * t * sin(mean)
        place, speed = s + s_dot * t + 0.5 * s_ddot * t * t, s_dot + s_ddot * t
        reference = PATH(place)
        errors = path_errors(x, y, theta, reference.x, reference.y, reference.theta)
        return law.virtual(errors, v, omega, reference, PathVariable(place, speed, s_ddot))

    before, now, after = at(-dt), at(0.0), at(dt)
    assert now[1] == pytest.approx((after[0] - before[0]) / (2 * dt), rel=1e-4, abs=1e-4)
    if min(before[4], after[4]) > 0.15:  # the divisor isn't held
        assert now[3] == pytest.approx((after[2] - before[2]) / (2 * dt), rel=1e-3, abs=1e-3)


def test_with_true_parameters_errors_vanish_with_no_lag_of_filters() -> None:
    _, error = run(backstepping(), 15.0)
    _, filtered = run(fixed(1.0), 15.0)
    assert error < 0.3 * filtered


def numeric() -> BacksteppingNumeric:
    return BacksteppingNumeric(BacksteppingNumeric.Gains(), WHEELS, H, PATH)


@given(near, near, st.floats(0, 20))
def test_differences_are_the_analytic_derivatives_near_the_path(
    off_x: float, off_y: float, s: float
) -> None:
    """Along a motion of constant speeds, to first order in the period."""
    law, exact, s_dot, v, omega = numeric(), backstepping(), 0.6, 0.5, 0.3
    memory, out = None, None
    for k in range(3):
        t, reference = k * H, PATH(s + s_dot * k * H)
        mean, theta = 0.5 * omega * t, omega * t
        x, y = PATH(s).x + off_x + v * t * cos(mean), PATH(s).y + off_y + v * t * sin(mean)
        motion = RobotMotion(x, y, theta, v, omega)
        out = law.step(memory, motion, reference, PathVariable(s + s_dot * t, s_dot, 0.0))
        memory = out.state
    errors = errors_of(motion, reference)
    place = PathVariable(s + s_dot * 2 * H, s_dot, 0.0)
    v_bar, v_rate, *_ = exact.virtual(errors, v, omega, reference, place)
    assert out.signals[3] == pytest.approx(v_bar, rel=1e-12)
    assert out.signals[5] == pytest.approx(v_rate, abs=0.02)


def test_a_millimetre_on_the_pose_is_newton_metres_for_differences_not_for_filters() -> None:
    """A pose that jumps by 1 mm once, on the path and at its speed."""

    def jump(law) -> float:
        """Largest change of torque from a tick to the next [N·m]."""
        memory, torques = None, []
        for k in range(20):
            s = 0.6 * k * H
            here = PATH(s)
            y = here.y + (0.001 if k >= 10 else 0.0)
            speeds = 0.6 * here.v_bar, 0.6 * here.omega_bar
            motion = RobotMotion(here.x, y, here.theta, *speeds)
            out = law.step(memory, motion, here, PathVariable(s, 0.6, 0.0))
            torques.append(out.tau_right)
            memory = out.state
        return max(abs(after - before) for before, after in pairwise(torques[5:]))

    assert jump(numeric()) > 10.0 * jump(fixed(1.0)) > 0.0
    assert jump(numeric()) > 10.0
