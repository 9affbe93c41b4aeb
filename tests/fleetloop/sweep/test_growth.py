"""Growth of the fastest mode, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fleetloop.sweep.growth import growth_1_s
from fleetloop.sweep.statistics import Course, statistic

T_S = np.arange(5001) * 1e-3
GROWTH = st.floats(-1.0, 1.0)


@settings(deadline=None)
@given(st.lists(GROWTH, min_size=1, max_size=4), st.floats(1.0, 4.0), st.floats(-5.0, 5.0))
def test_it_is_that_of_the_fastest_of_several_swings(
    growths: list[float], rate_rad_s: float, offset: float
) -> None:
    swings = [
        offset + np.exp(growth * T_S) * np.sin((1.0 + 0.7 * n) * rate_rad_s * T_S + n)
        for n, growth in enumerate(growths)
    ]
    mixed = [sum(swings[n - k] / (k + 1.0) for k in range(n + 1)) for n in range(len(swings))]
    assert growth_1_s(T_S, mixed) == pytest.approx(max(growths), abs=1e-5)


@given(st.floats(-3.0, 3.0).filter(lambda a: abs(a) > 1e-3), st.floats(-100.0, 100.0))
def test_of_one_exponential_it_is_its_exponent(a_1_s: float, scale: float) -> None:
    found = growth_1_s(T_S, [(scale + 200.0) * np.exp(a_1_s * T_S)])
    assert found == pytest.approx(a_1_s, abs=1e-6)


@given(st.floats(1e-7, 1e-4))
def test_its_sign_is_right_closely_beside_the_boundary(a_1_s: float) -> None:
    # Within this run nothing grows or vanishes by more than a fraction of a thousandth.
    swing = np.cos(2.0 * T_S)
    up, down = (growth_1_s(T_S, [np.exp(sign * a_1_s * T_S) * swing]) for sign in (1.0, -1.0))
    assert up == pytest.approx(a_1_s, abs=1e-8)
    assert down == pytest.approx(-a_1_s, abs=1e-8)


@given(st.floats(1e-6, 1e6), st.permutations(range(3)))
def test_it_depends_neither_on_units_nor_on_the_order_of_courses(
    scale: float, order: list[int]
) -> None:
    swings = [np.exp(-0.1 * n * T_S) * np.sin((1.0 + n) * T_S) for n in range(3)]
    expected = growth_1_s(T_S, swings)
    assert growth_1_s(T_S, [scale * swings[n] for n in order]) == pytest.approx(expected, abs=1e-8)


def test_what_has_no_mode_has_no_growth() -> None:
    noise = np.random.default_rng(1).normal(size=(2, len(T_S)))
    assert growth_1_s(T_S, noise) is None
    assert growth_1_s(T_S, [np.zeros_like(T_S), np.full_like(T_S, 3.0)]) is None
    assert growth_1_s(T_S[:9], [np.exp(T_S[:9])]) is None
    assert growth_1_s(T_S, [np.where(T_S > 1.0, np.nan, T_S)]) is None


def test_as_a_statistic_it_is_of_all_courses_together() -> None:
    decays, grows = (np.exp(a * T_S) for a in (-1.0, 0.5))
    both = [Course(T_S, decays + grows), Course(T_S, decays - grows)]
    assert statistic("growth_1_s_of", both) == pytest.approx(0.5, abs=1e-7)
    late = Course(T_S[9:], decays[9:])
    assert statistic("growth_1_s_of", [both[0], late]) is None
    assert math.isclose(statistic("growth_1_s_of", [late]) or 0.0, -1.0, abs_tol=1e-7)
