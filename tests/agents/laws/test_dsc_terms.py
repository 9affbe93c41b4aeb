"""Filters, projection, adaptation and the map to wheel torques."""

from math import exp

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.laws.dsc_terms import (
    Projection,
    adapt,
    project,
    sense,
    smoothing,
    wheel_torques,
)


def test_a_filter_goes_the_exact_share_of_the_way() -> None:
    assert smoothing(0.001, 0.01) == pytest.approx(1 - exp(-0.1))


def test_a_path_is_followed_in_the_papers_sense_unless_the_path_variable_goes_back() -> None:
    senses = [sense(s_dot) for s_dot in (0.6, 0.0, -0.025, -0.05, -0.6)]
    assert senses == [1.0, 1.0, 0.0, -1.0, -1.0]


BOUNDS = Projection.of(1.0, 0.1)
small = st.floats(-1.1, 1.1)
wide = st.floats(-1e3, 1e3)


@given(wide, st.floats(-1.0, 1.0))
def test_inside_the_bound_nothing_is_projected(drive: float, estimate: float) -> None:
    assert project(drive, estimate, BOUNDS) == drive


@given(wide, small)
def test_projection_never_turns_a_drive_round_nor_enlarges_it(drive, estimate) -> None:
    projected = project(drive, estimate, BOUNDS)
    assert abs(projected) <= abs(drive)
    assert projected * drive >= -1e-9


def test_at_the_outer_bound_an_outward_drive_is_stopped_on_both_sides() -> None:
    # The paper's printed condition would let the lower side through.
    assert project(5.0, 1.1, BOUNDS) == pytest.approx(0.0, abs=1e-12)
    assert project(-5.0, -1.1, BOUNDS) == pytest.approx(0.0, abs=1e-12)
    assert project(-5.0, 1.1, BOUNDS) == -5.0
    assert project(5.0, -1.1, BOUNDS) == 5.0


rows = st.tuples(small, small, small, small)
regressors = st.tuples(wide, wide, wide, wide)


@given(rows, regressors, wide)
def test_estimates_stay_within_the_outer_bound_whatever_drives_them(row, regressor, error) -> None:
    after = adapt(row, regressor, error, (0.1, 0.1, 0.1, 0.1), BOUNDS)
    assert all(abs(value) <= 1.1 + 1e-12 for value in after)


def test_adaptation_is_eulers_rule_inside_the_bound() -> None:
    after = adapt((0.0, 0.1, -0.1, 0.5), (1.0, 2.0, -3.0, 0.0), 0.5, (0.1, 0.2, 0.3, 0.4), BOUNDS)
    assert after == pytest.approx((0.05, 0.1 + 0.2, -0.1 - 0.45, 0.5))


@given(wide, wide)
def test_wheel_torques_give_the_body_what_was_asked(u_1: float, u_2: float) -> None:
    r, b = 0.04, 0.1
    right, left = wheel_torques(u_1, u_2, r, b)
    assert r / 2 * (right + left) == pytest.approx(u_1, abs=1e-6)  # B̄ B = 1
    assert r / (2 * b) * (right - left) == pytest.approx(u_2, abs=1e-6)
