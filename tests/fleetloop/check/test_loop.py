"""Sampled loops of one robot against their known limits."""

from dataclasses import replace
from math import isclose, pi, sin

import numpy as np
import pytest

from agents.laws.adaptive_dsc import DscState
from agents.laws.interface import PathVariable, RobotMotion
from agents.paths import Reference
from configs.loading import load
from fleetloop.check.loop import (
    Loop,
    bisect,
    channel_radius,
    delay_margin_s,
    largest_gain,
    pole_time_s,
    speed_loop_radius,
)
from fleetloop.check.sampling import loop_of
from plant.body import State
from plant.integrate import rk4

STRAIGHT = 1.0, 0.0, 0.6


@pytest.fixture
def paper() -> Loop:
    scenario = load("paper")
    return loop_of(scenario, scenario.robot[0])


@pytest.mark.parametrize("whole", range(5))
def test_the_speed_loops_limit_is_the_closed_form_for_whole_periods(whole: int) -> None:
    limit = 2.0 * sin(pi / (2 * (2 * whole + 1)))
    found = bisect(lambda gain: speed_loop_radius(gain, whole) < 1.0, 0.0, 3.0, 30)
    assert isclose(found, limit, rel_tol=1e-4)


@pytest.mark.parametrize("part", [0.1, 0.25, 0.5, 0.8])
def test_a_delay_of_a_part_of_a_period_has_jurys_limit(part: float) -> None:
    # z² − z + K ((1 − f) z + f): K f < 1 and K (1 − 2 f) < 2.
    limit = min(1.0 / part, 2.0 / (1.0 - 2.0 * part) if part < 0.5 else 1e9)
    found = bisect(lambda gain: speed_loop_radius(gain, part) < 1.0, 0.0, 20.0, 30)
    assert isclose(found, limit, rel_tol=1e-4)


def test_the_papers_gains_stand_three_milliseconds_more_at_1_khz(paper: Loop) -> None:
    assert channel_radius(paper, *STRAIGHT) < 1.0
    assert 2.8e-3 < delay_margin_s(paper, *STRAIGHT) < 3.4e-3


def test_the_largest_k1_is_that_of_the_continuous_channel_at_a_high_rate(paper: Loop) -> None:
    # x_e' = v, filter T_1, speed loop T_2 = m̄_1/(k_4 + d) and gain k_4/(k_4 + d):
    # k_1 k_4/(k_4 + d) < 1/T_1 + 1/T_2
    t_1, t_2 = 0.05, paper.body.mbar_1 / 0.2
    limit = (1.0 / t_1 + 1.0 / t_2) * 0.2 / 0.18
    gains = replace(paper.gains, k1=100.0, k4=0.18, gamma_1_s=t_1, gamma_2_s=t_1, gamma_3_s=t_1)
    fast = replace(paper, gains=gains, period_s=1e-4)
    assert largest_gain(fast, "k1", *STRAIGHT) == pytest.approx(limit, rel=0.03)


def test_the_slowest_error_on_a_line_decays_with_the_smallest_of_the_gains(paper: Loop) -> None:
    # y_e' = −k_2 v_r y_e within the fast rest: 1/(3 × 0.3) s.
    slow = channel_radius(paper, 1.0, 0.0, 0.1)
    assert pole_time_s(slow, paper.period_s) == pytest.approx(1.0 / 0.3, rel=0.3)


def test_poses_that_are_held_for_long_are_worse_than_fresh_ones(paper: Loop) -> None:
    held = replace(paper, pose_every=1500, pose_delay=1)
    assert channel_radius(replace(paper, pose_every=5, pose_delay=1), *STRAIGHT) < 1.0
    assert channel_radius(held, *STRAIGHT) > channel_radius(paper, *STRAIGHT)


@pytest.mark.parametrize(("every", "late"), [(50, 70), (20, 130), (100, 100)])
def test_held_and_late_poses_decay_as_the_law_itself_has_it(
    paper: Loop, every: int, late: int
) -> None:
    loop = replace(paper, pose_every=every, pose_delay=late)
    off = _offsets(loop, v=0.6, fixes=20_000 // every)
    ticks = every * np.arange(len(off))
    later = slice(len(off) // 4, None)
    slope = np.polyfit(ticks[later], np.log(off[later]), 1)[0]
    assert channel_radius(loop, *STRAIGHT) == pytest.approx(np.exp(slope), abs=5e-5)
    assert channel_radius(loop, *STRAIGHT) > channel_radius(paper, *STRAIGHT) + 5e-5


def _offsets(loop: Loop, *, v: float, fixes: int) -> np.ndarray:
    """|y_e| at each fix of a robot that starts a micrometre off a line, tick by tick."""
    h = loop.period_s
    line = lambda s: Reference(s, 0.0, 0.0, 1.0, 0.0)  # noqa: E731
    law, memory = loop.law(loop.gains, loop.wheels, h, line), None
    state = State(0.0, 1e-6, 0.0, v, 0.0, 0.0, 0.0)
    poses = [(v * h * n, 0.0, 0.0) for n in range(-loop.pose_delay, 0)]
    off = []
    for tick in range(fixes * loop.pose_every):
        poses.append((state.x, state.y, state.theta))
        if tick % loop.pose_every == 0:
            fix = poses[tick]
            off.append(abs(state.y))
        reference = Reference(v * h * tick, 0.0, 0.0, 1.0, 0.0)
        motion = RobotMotion(*fix, state.v, state.omega)
        out = law.step(memory, motion, reference, PathVariable(v * h * tick, v, 0.0))
        theta = loop.gains.theta_hat_0
        memory = DscState(out.state.filters, theta[:4], theta[4:], 0.0)
        state = rk4(loop.body, state, out.tau_right, out.tau_left, 0.0, h)
    return np.array(off)


def test_late_torques_make_the_channel_unstable_where_the_speed_loop_is(paper: Loop) -> None:
    gain = 3.0 * paper.period_s / paper.body.mbar_2
    for periods in (2, 3, 4):
        late = replace(paper, torque_delay_s=periods * paper.period_s)
        assert (channel_radius(late, *STRAIGHT) < 1.0) == (speed_loop_radius(gain, periods) < 1.0)
