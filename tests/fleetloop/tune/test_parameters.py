"""Ranges that are searched: what is drawn, what is tried, what is refused."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from configs.errors import KeyValueError
from fleetloop.sweep.factors import Range
from fleetloop.tune.parameters import ParameterSection


def of(**kinds: object) -> ParameterSection:
    return ParameterSection(key="control.k4", **kinds)


@given(st.floats(0.05, 0.6))
def test_what_is_tried_has_four_digits_and_stays_within_its_bounds(drawn: float) -> None:
    tried = of(log_uniform=(0.05, 0.6)).value(drawn)
    assert tried == pytest.approx(drawn, rel=5.1e-4)
    assert 0.05 <= tried <= 0.6
    assert float(f"{tried:.4g}") == tried


def test_rounding_leaves_no_bound() -> None:
    bounds = (0.123449, 0.123451)
    assert of(uniform=bounds).value(bounds[0]) == bounds[0]
    assert of(uniform=bounds).value(bounds[1]) == bounds[1]


def test_a_range_is_drawn_by_its_levels() -> None:
    levels = of(range=Range(least=1.0, most=100.0, steps=3, log=True))
    assert [levels.value(n) for n in range(3)] == [1.0, 10.0, 100.0]
    assert [levels.drawn(value) for value in (1.0, 10.0, 100.0)] == [0, 1, 2]


@pytest.mark.parametrize(
    "kinds",
    [
        {"uniform": (0.1, 0.5), "baseline": 0.6},
        {"uniform": (0.1, 0.5), "baseline": "0.2"},
        {"integers": (1, 5), "baseline": 2.5},
        {"values": ("hold", "extrapolate"), "baseline": "forget"},
        {"range": Range(least=1.0, most=3.0, steps=3), "baseline": 1.5},
    ],
)
def test_a_baseline_is_one_of_the_values(kinds) -> None:
    with pytest.raises(KeyValueError, match="baseline: must be one of its values"):
        of(**kinds)


@pytest.mark.parametrize("pair", [(0.5, 0.5), (0.6, 0.5)])
def test_an_empty_range_is_refused(pair) -> None:
    with pytest.raises(KeyValueError, match="the range is empty"):
        of(uniform=pair)


def test_a_distribution_without_bounds_is_not_searched() -> None:
    from fleetloop.sweep.factors import Normal

    with pytest.raises(KeyValueError, match="isn't searched: give bounds"):
        of(normal=Normal(mean=1.0, sd=0.1))
