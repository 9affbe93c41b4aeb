"""Path following errors (8)."""

from math import hypot, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.laws.path_errors import path_errors, wrap

angles = st.floats(-50.0, 50.0)
metres = st.floats(-100.0, 100.0)


@given(angles)
def test_a_wrapped_angle_is_the_same_direction_in_the_half_open_circle(angle: float) -> None:
    wrapped = wrap(angle)
    assert -pi < wrapped <= pi
    turns = (angle - wrapped) / (2 * pi)
    assert turns == pytest.approx(round(turns), abs=1e-9)


def test_half_a_turn_keeps_its_sign_convention() -> None:
    assert wrap(pi) == pi
    assert wrap(-pi) == pi


@given(metres, metres, angles, metres, metres, angles)
def test_errors_have_the_length_of_the_distance(x, y, theta, x_d, y_d, theta_d) -> None:
    x_e, y_e, _ = path_errors(x, y, theta, x_d, y_d, theta_d)
    assert hypot(x_e, y_e) == pytest.approx(hypot(x - x_d, y - y_d), abs=1e-9)


def test_errors_are_seen_from_the_robot() -> None:
    # The robot looks along world y; its reference is 1 m behind it and 2 m to its right.
    errors = path_errors(0.0, 0.0, pi / 2, 2.0, -1.0, 0.0)
    assert errors == pytest.approx((1.0, 2.0, pi / 2))


def test_the_heading_error_of_almost_opposite_headings_is_wrapped() -> None:
    assert path_errors(0, 0, 3.1, 0, 0, -3.1)[2] == pytest.approx(6.2 - 2 * pi)
