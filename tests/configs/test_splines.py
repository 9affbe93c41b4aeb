"""Quintic splines: through the points, smooth to the fourth derivative."""

import numpy as np
import pytest

from configs.splines import chord_lengths, quintic_spline


def derivatives(coefficients, u: float) -> np.ndarray:
    polynomial = np.polynomial.Polynomial(coefficients)
    return np.array([polynomial.deriv(k)(u) if k else polynomial(u) for k in range(5)])


POINTS = [(0.0, 0.0), (5.0, 0.0), (10.0, 1.0), (12.0, 5.0), (8.0, 8.0)]


@pytest.mark.parametrize("ends", ["natural", "periodic", "clamped"])
def test_a_spline_passes_its_points_and_joins_up_to_the_fourth_derivative(ends) -> None:
    values = [x for x, _ in POINTS]
    points = POINTS
    if ends == "periodic":
        values, points = [*values, values[0]], [*POINTS, POINTS[0]]
    knots = chord_lengths(points)
    segments = quintic_spline(knots, values, ends)
    for n, segment in enumerate(segments):
        width = knots[n + 1] - knots[n]
        assert derivatives(segment, 0.0)[0] == pytest.approx(values[n], abs=1e-9)
        assert derivatives(segment, width)[0] == pytest.approx(values[n + 1], abs=1e-9)
        if n + 1 < len(segments):
            assert derivatives(segment, width) == pytest.approx(
                derivatives(segments[n + 1], 0.0), abs=1e-7
            )


def test_a_periodic_spline_closes_smoothly_and_a_clamped_one_ends_as_a_constant() -> None:
    knots, values = (0.0, 1.0, 2.5, 4.0), (1.0, 3.0, -1.0, 1.0)
    periodic = quintic_spline(knots, values, "periodic")
    assert derivatives(periodic[0], 0.0) == pytest.approx(derivatives(periodic[-1], 1.5), abs=1e-9)
    clamped = quintic_spline(knots, values, "clamped")
    assert derivatives(clamped[0], 0.0)[1:3] == pytest.approx([0, 0], abs=1e-9)
    assert derivatives(clamped[-1], 1.5)[1:3] == pytest.approx([0, 0], abs=1e-9)


def test_chord_lengths_are_the_lengths_of_the_polygon() -> None:
    assert chord_lengths([(0.0, 0.0), (3.0, 4.0), (3.0, 5.0)]) == pytest.approx([0.0, 5.0, 6.0])
