"""Pose estimates from fixes and wheels."""

from math import pi

import pytest

from agents.localisation import Localiser
from configs.brief import Wheels

WHEELS = Wheels(0.04, 0.1)


def test_equal_wheels_roll_straight_on() -> None:
    localiser = Localiser("fused", WHEELS)
    localiser.wheels(0.0, 0.0, 0.0, 0.0)
    localiser.fix(1.0, 2.0, pi / 2)
    sense = localiser.wheels(10.0, 10.0, 25.0, 25.0)
    assert tuple(sense) == pytest.approx((1.0, 2.4, pi / 2, 1.0, 0.0))


def test_opposite_wheels_turn_on_the_spot() -> None:
    localiser = Localiser("fused", WHEELS)
    localiser.wheels(0.0, 0.0, 0.0, 0.0)
    localiser.fix(0.0, 0.0, 0.0)
    sense = localiser.wheels(2.5, -2.5, 2.5, -2.5)
    assert tuple(sense) == pytest.approx((0.0, 0.0, 1.0, 0.0, 1.0))


@pytest.mark.parametrize(("mode", "x"), [("fused", 5.4), ("external", 5.0), ("odometry", 0.8)])
def test_modes_differ_in_what_they_do_with_a_second_fix_and_with_wheels(mode, x) -> None:
    localiser = Localiser(mode, WHEELS)
    localiser.wheels(0.0, 0.0, 0.0, 0.0)
    localiser.fix(0.0, 0.0, 0.0)
    localiser.wheels(10.0, 10.0, 0.0, 0.0)
    localiser.fix(5.0, 0.0, 0.0)
    assert localiser.wheels(20.0, 20.0, 0.0, 0.0).x == pytest.approx(x)


def test_a_fix_is_taken_as_the_nearest_angle_of_its_direction() -> None:
    localiser = Localiser("fused", WHEELS)
    localiser.wheels(0.0, 0.0, 0.0, 0.0)
    localiser.fix(0.0, 0.0, 3.0)
    localiser.wheels(1.0, -1.0, 0.0, 0.0)  # on to 3.4
    assert localiser.fix(0.0, 0.0, 3.4 - 2 * pi).theta == pytest.approx(3.4)


def test_a_late_fix_loses_nothing_of_the_motion_since() -> None:
    punctual, late = Localiser("fused", WHEELS), Localiser("fused", WHEELS, delay_ticks=3)
    for localiser in (punctual, late):
        localiser.wheels(0.0, 0.0, 0.0, 0.0)
        localiser.fix(1.0, 2.0, 0.5)
    angles = [(1.0, 0.8), (2.1, 1.5), (3.0, 2.9), (4.2, 3.3), (5.0, 4.9)]
    for n, (right, left) in enumerate(angles):
        punctual.wheels(right, left, 0.0, 0.0)
        late.wheels(right, left, 0.0, 0.0)
        if n == 1:
            punctual.fix(-3.0, 1.0, -0.7)
        if n == 4:
            now = late.fix(-3.0, 1.0, -0.7, ticks_ago=3)
    assert now == pytest.approx(punctual.wheels(*angles[-1], 0.0, 0.0))
