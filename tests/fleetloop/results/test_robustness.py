"""Robustness of expectations, against what signal temporal logic says tick by tick."""

from math import ceil, inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleetloop.results.robustness import (
    always,
    eventually,
    never,
    settles,
    share,
    slack,
    windowed_min,
)

numbers = st.floats(-10.0, 10.0).map(lambda x: round(x, 3))
slacks = st.lists(numbers, min_size=1, max_size=40).map(np.array)
PERIOD_S = 0.01


def test_slack_is_the_distance_inside_the_nearest_bound() -> None:
    values = np.array([0.0, 0.5, -0.5, 2.0, np.nan, inf])
    assert slack(values, most=1.0).tolist() == [1.0, 0.5, 1.5, -1.0, -inf, -inf]
    assert slack(values, least=0.0).tolist()[:4] == [0.0, 0.5, -0.5, 2.0]
    assert slack(values, widest=0.5, most=0.25).tolist()[:4] == [0.25, -0.25, 0.0, -1.75]


@given(slacks, st.data())
def test_the_least_of_a_piece_is_that_of_its_values(g: np.ndarray, data) -> None:
    width = data.draw(st.integers(1, len(g)))
    pieces = [min(g[k : k + width]) for k in range(len(g) - width + 1)]
    assert windowed_min(g, width).tolist() == pieces


@given(slacks)
def test_always_is_the_least_slack_and_never_and_eventually_the_greatest(g: np.ndarray) -> None:
    ticks = len(g)
    assert always(g, ticks)[:3] == (g.min() >= 0.0, g.min(), int(g.argmin()))
    assert eventually(g, ticks)[:3] == (g.max() >= 0.0, g.max(), int(g.argmax()))
    assert never(g, ticks)[:3] == (g.max() < 0.0, -g.max(), int(g.argmax()))


@given(slacks, st.data())
def test_for_a_time_means_in_one_piece(g: np.ndarray, data) -> None:
    piece = data.draw(st.integers(1, len(g)))
    runs = [all(x >= 0.0 for x in g[k : k + piece]) for k in range(len(g) - piece + 1)]
    found = eventually(g, len(g), piece)
    assert found.held == any(runs)
    assert never(g, len(g), piece).held == (not any(runs))
    assert found.margin == min(g[found.at : found.at + piece])


@given(slacks, st.sampled_from([0.01, 0.5, 0.9, 0.99]))
def test_a_share_of_the_ticks_is_counted(g: np.ndarray, quantile: float) -> None:
    found = share(g, len(g), quantile)
    needed = max(1, ceil(quantile * len(g) - 1e-9))
    assert found.held == ((g >= 0.0).sum() >= needed)
    assert (g >= found.margin).sum() >= needed > (g > found.margin).sum()


def test_the_quantile_of_evenly_spread_values_is_in_closed_form() -> None:
    values = np.arange(1.0, 101.0)
    rng = np.random.default_rng(3)
    g = slack(rng.permutation(values), most=95.0)
    assert share(g, 100, 0.95).margin == 0.0
    assert share(g, 100, 0.96).margin == -1.0


@pytest.mark.parametrize(("within_s", "held"), [(0.69, False), (0.7, True), (3.0, True)])
def test_a_decaying_error_settles_when_its_exponential_says(within_s: float, held: bool) -> None:
    t = np.arange(0.0, 5.0, PERIOD_S)
    found = settles(slack(np.exp(-t), widest=0.5), len(t), PERIOD_S, within_s)
    assert found.settled_s == pytest.approx(np.log(2.0), abs=PERIOD_S)
    assert found.settled_s == 0.7
    assert found.held == held
    assert found.margin == pytest.approx(within_s - 0.7)


def test_what_is_outside_at_the_end_has_not_settled_and_what_never_was_has_at_once() -> None:
    g = np.array([-1.0, 1.0, 1.0, -1.0])
    assert settles(g, 4, PERIOD_S, 0.03)[:3] == (False, -inf, 3)
    assert settles(np.ones(4), 4, PERIOD_S, 0.0)[:2] == (True, 0.0)


@given(slacks, st.data())
def test_a_part_of_a_window_never_says_other_than_the_whole(g: np.ndarray, data) -> None:
    part = g[: data.draw(st.integers(0, len(g)))]
    piece = data.draw(st.integers(1, 4))
    within_s = data.draw(st.integers(0, len(g))) * PERIOD_S
    ticks = len(g)
    for judge in (
        lambda g: always(g, ticks),
        lambda g: share(g, ticks, 0.9),
        lambda g: settles(g, ticks, PERIOD_S, within_s),
        *([lambda g: eventually(g, ticks, piece), lambda g: never(g, ticks, piece)])
        * (piece <= ticks),
    ):
        assert judge(part).held in (None, judge(g).held)


def test_ticks_that_are_not_known_leave_it_open_unless_the_others_decide() -> None:
    g = np.array([1.0, np.nan, 2.0])
    assert always(g, 3).held is None
    assert always(np.array([1.0, np.nan, -2.0]), 3).held is False
    assert eventually(g, 3).held is True
    assert eventually(g, 3, 2).held is None  # an unknown tick breaks a piece
    assert never(-g, 3).held is None
    assert always(np.array([np.nan]), 1).margin != always(np.array([np.nan]), 1).margin
