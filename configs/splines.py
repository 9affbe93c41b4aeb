"""Quintic interpolating splines: smooth curves through points, for paths and varying offsets.

Through values y_0 … y_n at knots t_0 < … < t_n goes one piecewise polynomial of degree 5 that is
continuous up to its fourth derivative. Ends, two conditions each:

    natural    third and fourth derivative are 0
    periodic   derivatives 1 to 4 agree at both ends
    clamped    first and second derivative are 0: the curve goes on as a constant

Coefficients are by powers of (t − t_n), lowest first, six per segment.
"""

import itertools
from collections.abc import Sequence
from math import dist
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Coefficients = tuple[tuple[float, ...], ...]
Ends = Literal["natural", "periodic", "clamped"]
_ORDER = 6


def quintic_spline(knots: Sequence[float], values: Sequence[float], ends: Ends) -> Coefficients:
    """Coefficients of the spline through `values` at `knots`, which must increase."""
    segments = len(knots) - 1
    rows: list[NDArray[np.float64]] = []
    right: list[float] = []

    def condition(parts: Sequence[tuple[int, float, int, float]], value: float) -> None:
        """Σ sign × derivative(order) of a segment at u = value; parts (segment, u, order, sign)."""
        row = np.zeros(segments * _ORDER)
        for segment, u, order, sign in parts:
            start = segment * _ORDER
            row[start : start + _ORDER] += sign * _powers(u, order)
        rows.append(row)
        right.append(value)

    lengths = [b - a for a, b in itertools.pairwise(knots)]
    last = segments - 1
    for n in range(segments):
        condition([(n, 0.0, 0, 1.0)], values[n])
        condition([(n, lengths[n], 0, 1.0)], values[n + 1])
    for n in range(last):
        for order in range(1, 5):
            condition([(n, lengths[n], order, 1.0), (n + 1, 0.0, order, -1.0)], 0.0)
    for order in {"natural": (3, 4), "clamped": (1, 2), "periodic": (1, 2, 3, 4)}[ends]:
        if ends == "periodic":
            condition([(0, 0.0, order, 1.0), (last, lengths[last], order, -1.0)], 0.0)
        else:
            condition([(0, 0.0, order, 1.0)], 0.0)
            condition([(last, lengths[last], order, 1.0)], 0.0)
    solution = np.linalg.solve(np.array(rows), np.array(right))
    return tuple(tuple(float(c) for c in part) for part in solution.reshape(segments, _ORDER))


def chord_lengths(points: Sequence[tuple[float, float]]) -> tuple[float, ...]:
    """Length of the polygon up to each point, from 0."""
    lengths = [0.0]
    for a, b in itertools.pairwise(points):
        lengths.append(lengths[-1] + dist(a, b))
    return tuple(lengths)


def _powers(u: float, order: int) -> NDArray[np.float64]:
    """The derivative of the given order of (1, u, u², …, u⁵)."""
    row = np.zeros(_ORDER)
    for power in range(order, _ORDER):
        factor = np.prod(np.arange(power - order + 1, power + 1, dtype=float))
        row[power] = factor * u ** (power - order)
    return row
