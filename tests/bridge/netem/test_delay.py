"""Distributions of delays: their moments, bounds and streams."""

from math import sqrt
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.netem.delay import delay_draw, lognormal_parameters
from configs.netem import (
    ConstantDelay,
    Delay,
    LognormalDelay,
    NormalDelay,
    TraceDelay,
    UniformDelay,
)

DRAWS = 20_000


def drawn_s(delay: Delay, seed: str = "1") -> np.ndarray:
    draw = delay_draw(delay, Random(seed))
    return np.array([draw() for _ in range(DRAWS)]) * 1e-9


@pytest.mark.parametrize(
    ("delay", "mean_s", "std_s"),
    [
        (ConstantDelay(kind="constant", delay_s=0.1), 0.1, 0.0),
        (UniformDelay(kind="uniform", min_s=0.1, max_s=0.3), 0.2, 0.2 / sqrt(12.0)),
        (NormalDelay(kind="normal", mean_s=0.2, std_s=0.03), 0.2, 0.03),
        (LognormalDelay(kind="lognormal", mean_s=0.05, std_s=0.04), 0.05, 0.04),
    ],
    ids=lambda value: getattr(value, "kind", None),
)
def test_delays_have_the_mean_and_deviation_of_the_file(
    delay: Delay, mean_s: float, std_s: float
) -> None:
    delays_s = drawn_s(delay)
    assert delays_s.mean() == pytest.approx(mean_s, abs=4.0 * std_s / sqrt(DRAWS) + 1e-9)
    assert delays_s.std() == pytest.approx(std_s, rel=0.06, abs=1e-9)


def test_a_normal_delay_is_never_negative() -> None:
    delays_s = drawn_s(NormalDelay(kind="normal", mean_s=0.0, std_s=0.1))
    assert delays_s.min() == 0.0
    assert (delays_s == 0.0).mean() == pytest.approx(0.5, abs=0.02)


@given(mean_s=st.floats(1e-4, 10.0), ratio=st.floats(0.01, 3.0))
def test_lognormal_parameters_invert_the_moments(mean_s: float, ratio: float) -> None:
    mu, sigma = lognormal_parameters(mean_s, ratio * mean_s)
    assert np.exp(mu + 0.5 * sigma**2) == pytest.approx(mean_s)
    assert sqrt(np.exp(sigma**2) - 1.0) == pytest.approx(ratio)


def test_a_trace_is_repeated_and_a_negative_delay_is_a_lost_message() -> None:
    draw = delay_draw(TraceDelay(kind="trace", delays_s=(0.1, -1.0, 0.3)), Random("1"))
    assert [draw() for _ in range(4)] == [100_000_000, None, 300_000_000, 100_000_000]


def test_equal_seeds_draw_equal_delays_and_others_do_not() -> None:
    delay = UniformDelay(kind="uniform", max_s=1.0)
    assert (drawn_s(delay, "1 r1 -> r2") == drawn_s(delay, "1 r1 -> r2")).all()
    assert abs(np.corrcoef(drawn_s(delay, "1 r1 -> r2"), drawn_s(delay, "1 r2 -> r1"))[0, 1]) < 0.03
