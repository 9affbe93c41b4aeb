"""Losses: their rate and the lengths of their bursts."""

from itertools import groupby
from random import Random

import numpy as np
import pytest

from bridge.netem.loss import distance_draw, loss_draw
from configs.netem import BernoulliLoss, DistanceLoss, GilbertElliottLoss, Loss

DRAWS = 40_000


def lost(loss: Loss, seed: str = "1") -> np.ndarray:
    draw = loss_draw(loss, Random(seed))
    return np.array([draw() for _ in range(DRAWS)])


def mean_burst(losses: np.ndarray) -> float:
    return float(np.mean([len(list(run)) for is_lost, run in groupby(losses) if is_lost]))


@pytest.mark.parametrize("probability", [0.0, 0.1, 0.5, 1.0])
def test_bernoulli_losses_have_their_rate_and_geometric_bursts(probability: float) -> None:
    losses = lost(BernoulliLoss(kind="bernoulli", probability=probability))
    assert losses.mean() == pytest.approx(probability, abs=0.01)
    if 0.0 < probability < 1.0:
        assert mean_burst(losses) == pytest.approx(1.0 / (1.0 - probability), rel=0.03)


@pytest.mark.parametrize(("to_bad", "to_good"), [(0.02, 0.2), (0.1, 0.1)])
def test_gilbert_losses_have_the_chains_rate_and_burst_length(
    to_bad: float, to_good: float
) -> None:
    loss = GilbertElliottLoss(kind="gilbert_elliott", good_to_bad=to_bad, bad_to_good=to_good)
    losses = lost(loss)
    assert losses.mean() == pytest.approx(to_bad / (to_bad + to_good), rel=0.1)
    assert mean_burst(losses) == pytest.approx(1.0 / to_good, rel=0.1)


def test_elliotts_losses_occur_in_both_states() -> None:
    loss = GilbertElliottLoss(
        kind="gilbert_elliott",
        good_to_bad=0.1,
        bad_to_good=0.3,
        loss_in_bad=0.8,
        loss_in_good=0.1,
    )
    assert lost(loss).mean() == pytest.approx(0.25 * 0.8 + 0.75 * 0.1, rel=0.05)


def test_losses_of_two_directions_are_independent() -> None:
    loss = BernoulliLoss(kind="bernoulli", probability=0.5)
    there, back = lost(loss, "1 r1 -> r2 loss"), lost(loss, "1 r2 -> r1 loss")
    assert abs(np.corrcoef(there, back)[0, 1]) < 0.02


def test_from_the_range_on_all_is_lost_and_below_it_by_the_power_of_the_distance() -> None:
    draw = distance_draw(DistanceLoss(range_m=4.0, exponent=2.0), Random("1"))
    assert all(draw(distance_m) for distance_m in (4.0, 9.0))
    for distance_m in (0.0, 1.0, 3.0):
        rate = np.mean([draw(distance_m) for _ in range(10_000)])
        assert rate == pytest.approx((distance_m / 4.0) ** 2, abs=0.015)


def test_without_an_exponent_nothing_is_lost_below_the_range() -> None:
    draw = distance_draw(DistanceLoss(range_m=4.0), Random("1"))
    assert not any(draw(3.99) for _ in range(1000))
    assert draw(4.0)
