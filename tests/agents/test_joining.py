"""The path variable with which a robot joins: nothing jumps for those that hear it."""

import numpy as np
import pytest

from agents.coordination import CoordinationState, Coordinator
from agents.joining import joining
from agents.neighbours import Neighbours
from configs.edges import InEdge
from configs.sections import Coordination

H_S = 0.01
START = CoordinationState(0.1, 0.2, 0.3)
GAINS = Coordination()


def neighbours(**said: tuple[float, float]) -> Neighbours:
    """In-neighbours r1 and r2 with weights 1 and 3 that said (s, v̂) at t = 0."""
    made = Neighbours([InEdge("r1", 1.0), InEdge("r2", 3.0)], GAINS, H_S)
    for name, (s, v_hat) in said.items():
        made.receive(name, 0, s, v_hat)
    return made


def test_it_is_the_weighted_mean_carried_on_to_the_tick() -> None:
    heard = neighbours(r1=(2.0, 0.4), r2=(4.0, 0.8))
    v_hat, mu, s = joining(heard, 500_000_000, 0.0, 0.6, START)
    assert (v_hat, mu) == (pytest.approx(0.7), 0.0)
    assert s == pytest.approx(0.25 * (2.0 + 0.4 * 0.5) + 0.75 * (4.0 + 0.8 * 0.5))


def test_the_leader_counts_with_its_weight_in_the_speed_and_not_in_the_place() -> None:
    heard = neighbours(r1=(2.0, 0.4), r2=(4.0, 0.8))
    v_hat, _, s = joining(heard, 0, 2.0, 1.0, START)
    assert v_hat == pytest.approx((0.4 + 3 * 0.8 + 2.0 * 1.0) / 6.0)
    assert s == pytest.approx(3.5)


def test_a_robot_that_hears_nobody_begins_at_its_start() -> None:
    assert joining(neighbours(), 0, 1.0, 0.6, START) == START
    silent_ns = round(GAINS.silence_limit_s * 1e9) + 1
    assert joining(neighbours(r1=(2.0, 0.4)), silent_ns, 1.0, 0.6, START) == START


def test_it_is_where_speed_and_place_are_in_equilibrium() -> None:
    heard = neighbours(r1=(5.0, 0.6), r2=(5.0, 0.6))
    state = joining(heard, 0, 1.0, 0.6, START)
    after = Coordinator(GAINS, H_S).advance(state, heard.sums(0, state.s), 1.0, 0.6)
    assert after.v_hat == pytest.approx(0.6, abs=1e-12)
    assert after.mu == pytest.approx(0.0, abs=1e-4)  # the middle of the period is heard
    assert after.s == pytest.approx(5.0 + 0.6 * H_S, abs=1e-6)


def test_its_own_place_instead_would_shift_what_all_agree_on_by_beta_times_the_distance() -> None:
    # Two robots that hear each other agree; the second is put D = 1 m behind: βᵀ = (1/2, 1/2).
    states = [CoordinationState(0.0, 0.0, 1.0), CoordinationState(0.0, 0.0, 0.0)]
    minds = [Coordinator(GAINS, H_S) for _ in states]
    ears = [Neighbours([InEdge("other")], GAINS, H_S) for _ in states]
    for tick in range(3000):
        now_ns = round(tick * H_S * 1e9)
        for ear, other in zip(ears, reversed(states), strict=True):
            ear.receive("other", now_ns, other.s, other.v_hat)
        states = [
            mind.advance(own, ear.sums(now_ns, own.s), 0.0, 0.0)
            for mind, ear, own in zip(minds, ears, states, strict=True)
        ]
    assert np.array([state.s for state in states]) == pytest.approx(0.5, abs=1e-3)
