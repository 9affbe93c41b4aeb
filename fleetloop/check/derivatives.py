"""Derivatives that shapes of the user's own return, against the differences of their values.

    D(h) = (f(s + h) − f(s − h)) / 2h,   f' = (4 D(h/2) − D(h)) / 3 + O(h⁴)             (1)

Every derivative of a jet is held against (1) of the one before it, at places along the way. The
change from D(h) to D(h/2) bounds the error of (1), so that a kink or noise of the values is no
finding. Of an offset the third derivative isn't used, of a path only where an offset turns with it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from sys import float_info

import numpy as np

from agents.laws.failure import ShapeError
from agents.paths import PlanarJet, own_curve
from configs.paths import World
from configs.plugins import Choice, Kind
from configs.scenario import Scenario
from fleetloop.check.coordination import Forecast
from fleetloop.check.finding import Finding

STEP_M = 1e-4
PLACES = 60
PART = 0.01
"""A derivative that differs by more than this part of its largest value is wrong."""
_BASIS = "differences of the values"
_COORDINATES = {Kind.PATH: ("x", "y"), Kind.OFFSET: ("ahead", "left")}


@dataclass(frozen=True, slots=True)
class Wrong:
    """A derivative that doesn't fit the values."""

    coordinate: int
    order: int
    s: float
    claimed: float
    found: float


def derivative_findings(scenario: Scenario, ahead: Forecast) -> Iterator[Finding]:
    """One finding for the path, and one for each robot's offset, if it is the user's own."""
    turning = any(not isinstance(robot.offset, World) for robot in scenario.robot)
    if isinstance(scenario.path, Choice):
        key, orders = "path.kind", 3 if turning else 2
        yield _finding(scenario.path, ahead.s, orders, (), key)
    for n, robot in enumerate(scenario.robot):
        if isinstance(robot.offset, Choice):
            key = f"robot.{robot.name}.offset.kind"
            yield _finding(robot.offset, ahead.s[:, n], 2, (robot.name,), key)


def _finding(
    shape: Choice, way: np.ndarray, orders: int, robots: tuple[str, ...], key: str
) -> Finding:
    kind = shape.plugin.kind
    title = f"derivatives of {kind.word} {shape.name}"
    first, last = float(way.min()), float(way.max())
    try:
        wrong = wrong_derivative(own_curve(shape), first, last, orders)
    except ShapeError as error:  # at a place that the run may not come to
        return Finding("warning", title, str(error), robots, key, basis=_BASIS)
    if wrong is None:
        text = f"fit its values from s = {first:.3g} to {last:.3g} m"
        return Finding("ok", title, text, robots, basis=_BASIS)
    name = _COORDINATES[kind][wrong.coordinate]
    primes, before = "'" * wrong.order, "'" * (wrong.order - 1)
    text = (
        f"{name}{primes} at s = {wrong.s:.4g} m: jet returns {wrong.claimed:.4g}, but differences"
        f" of its {name}{before} give {wrong.found:.4g}"
    )
    return Finding("error", title, text, robots, key, basis=_BASIS)


def wrong_derivative(
    curve: Callable[[float], PlanarJet], first: float, last: float, orders: int
) -> Wrong | None:
    """The lowest order that is wrong, where it is most wrong on the way; None if all fit."""
    places = np.linspace(first + STEP_M, last - STEP_M, PLACES) if last > first else [first]
    jets = [
        np.array([curve(float(s) + part * STEP_M) for part in (-1.0, -0.5, 0.0, 0.5, 1.0)])
        for s in places
    ]
    for order in range(1, orders + 1):
        found = [_worst(jets, places, coordinate, order) for coordinate in (0, 1)]
        worst = max(found, key=lambda one: one[0])
        if worst[0] > 1.0:
            return worst[1]
    return None


def _worst(
    jets: Sequence[np.ndarray], places: Sequence[float] | np.ndarray, coordinate: int, order: int
) -> tuple[float, Wrong]:
    """The place where a derivative is most wrong, and by how many times what is tolerated."""
    values = np.array([jet[:, coordinate, order - 1] for jet in jets])
    claimed = np.array([jet[2, coordinate, order] for jet in jets])
    wide = (values[:, 4] - values[:, 0]) / (2.0 * STEP_M)
    close = (values[:, 3] - values[:, 1]) / STEP_M
    found = (4.0 * close - wide) / 3.0
    rounding = 16.0 * float_info.epsilon * np.abs(values).max() / STEP_M
    tolerated = PART * np.abs(found).max() + 10.0 * np.abs(close - wide) + rounding
    ratios = np.abs(claimed - found) / np.maximum(tolerated, float_info.min)
    n = int(ratios.argmax())
    wrong = Wrong(coordinate, order, float(places[n]), float(claimed[n]), float(found[n]))
    return float(ratios[n]), wrong
