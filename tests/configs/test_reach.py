"""How far path variables can come: what happens stays within, what can't be is beyond."""

from math import inf, nan

import pytest

from configs.loading import load
from configs.reach import MOST_AMPLIFIED, Reach, beyond, reach_of, within_world

PAPER = load("paper").reach


def test_the_bounds_of_the_paper_s_scenario_are_the_documented_ones() -> None:
    """P = 2, q = 1: critically damped with one neighbour, which amplifies nothing."""
    scenario = load("paper")
    starts = [robot.s_0 for robot in scenario.robot]
    speed = max(0.0, scenario.coordination.v_hat_0, scenario.leader.speed_m_s)
    margin = 1.0 + 2.0 * (max(starts) - min(starts) + 2.0 * speed)
    assert (max(starts) + margin, min(starts) - margin) == (PAPER.s_max_m, PAPER.s_min_m)
    assert (PAPER.v_min_m_s, PAPER.v_max_m_s, PAPER.v_margin_m_s) == (0.0, speed, speed)


def test_the_bound_moves_with_the_fastest_speed() -> None:
    top = PAPER.s_max_m + 0.6 * 30.0
    assert beyond(PAPER, 30.0, top - 1e-9, 0.6) is None
    assert "where this scenario has" in str(beyond(PAPER, 30.0, top + 1e-6, 0.6))
    assert beyond(PAPER, 0.0, top, 0.6) is not None


@pytest.mark.parametrize("value", [nan, inf, -inf, 1e308])
def test_what_is_no_number_is_beyond(value: float) -> None:
    assert beyond(PAPER, 1.0, value, 0.6) is not None
    assert beyond(PAPER, 1.0, 0.0, value) is not None
    assert not within_world(value, 0.0, 0.0)
    assert not within_world(0.0, 0.0, value)


def test_a_path_variable_may_stand_still_for_ever() -> None:
    assert beyond(PAPER, 1e6, 0.0, 0.0) is None


def test_a_chain_that_amplifies_has_room_for_it() -> None:
    def room(p: float, robots: int) -> float:
        starts = [1.0] + [0.0] * (robots - 1)
        return reach_of(starts, [0.0], mu_0=0.0, p=p, q=1.0, max_in_degree=1.0).s_max_m - 1.0

    assert room(2.0, 8) == pytest.approx(1.0 + 2.0)
    assert room(0.5, 2) < room(0.5, 8)
    assert room(1e-6, 256) == pytest.approx(1.0 + 2.0 * MOST_AMPLIFIED)


@pytest.mark.parametrize("p", [1e-308, 1e308])
@pytest.mark.parametrize("q", [1e-308, 1e308])
def test_absurd_gains_give_bounds_that_are_numbers(p: float, q: float) -> None:
    bounds: Reach = reach_of([0.0, 1.0], [0.0, 0.6], mu_0=1.0, p=p, q=q, max_in_degree=1.0)
    assert beyond(bounds, 0.0, 0.5, 0.3) is None
    assert beyond(bounds, 0.0, 1e12, 0.3) is not None
