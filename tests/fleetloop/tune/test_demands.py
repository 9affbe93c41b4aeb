"""Numbers over cases, and how far they miss a bound: closed forms and invariants."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from configs.errors import KeyValueError
from fleetloop.tune.demands import FAILURE_RATE, Constraint, Number, Objective, number_of

VALUES = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40)


def of(over, *, direction="minimise", missing=None) -> Objective:
    return Objective(quantity="peak_s", over=over, direction=direction, missing=missing)


@pytest.mark.parametrize(
    ("over", "direction", "number"),
    [
        ("mean", "minimise", 4.0),
        ("mean", "maximise", 4.0),
        ("median", "minimise", 2.0),
        ("worst", "minimise", 10.0),
        ("worst", "maximise", 1.0),
        (0.75, "minimise", 3.0),
        (0.75, "maximise", 2.0),
        (1.0, "minimise", 10.0),
    ],
)
def test_the_number_of_four_cases_is_that_of_the_table(over, direction, number) -> None:
    found = number_of(of(over, direction=direction), [10.0, 1.0, 3.0, 2.0])
    assert found == Number(number, 0.0)


@given(VALUES, st.floats(0.01, 1.0))
def test_a_share_of_the_cases_reaches_the_number_and_no_smaller_one_is(values, share) -> None:
    found = number_of(of(share), values).value
    assert sum(v <= found for v in values) / len(values) >= share - 1e-12
    assert sum(v < found for v in values) / len(values) < share


@given(VALUES)
def test_maximising_is_minimising_the_opposite(values) -> None:
    for over in ("worst", 0.9, "mean"):
        ours = number_of(of(over, direction="maximise"), values).value
        theirs = number_of(of(over), [-v for v in values]).value
        assert ours == pytest.approx(-theirs)


def test_a_case_without_a_value_is_worse_than_any() -> None:
    values = [1.0, None, 3.0, math.inf]
    assert number_of(of("worst"), values) == Number(None, 0.5)
    assert number_of(of("mean"), values) == Number(None, 0.5)
    assert number_of(of(0.5), values) == Number(3.0, 0.5)
    assert number_of(of(0.5, direction="maximise"), values) == Number(1.0, 0.5)


def test_a_missing_value_counts_as_what_the_file_says() -> None:
    assert number_of(of("mean", missing=8.0), [1.0, None, 3.0]) == Number(4.0, 0.0)


def test_a_failure_rate_is_a_mean_whatever_is_asked_over_the_cases() -> None:
    rate = Constraint(quantity=FAILURE_RATE, at_most=0.1)
    assert number_of(rate, [1.0, 0.0, 0.0, 0.0]).value == 0.25


@pytest.mark.parametrize(
    ("bounds", "value", "missed"),
    [
        ({"at_most": 4.0}, 4.0, 0.0),
        ({"at_most": 4.0}, 5.0, 0.25),
        ({"at_least": 4.0}, 3.0, 0.25),
        ({"at_least": -4.0}, -5.0, 0.25),
        ({"at_least": 4.0}, 9.0, 0.0),
        ({"at_most": 0.0}, 0.25, 0.25),
    ],
)
def test_how_far_a_bound_is_missed_is_relative_to_it(bounds, value, missed) -> None:
    assert Constraint(quantity="peak_s", **bounds).missed_by(value) == pytest.approx(missed)


@pytest.mark.parametrize("bounds", [{}, {"at_most": 1.0, "at_least": 0.0}])
def test_a_constraint_has_one_bound(bounds) -> None:
    with pytest.raises(KeyValueError, match="give at_most, or at_least"):
        Constraint(quantity="peak_s", **bounds)
