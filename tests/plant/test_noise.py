"""`plant.noise`."""

from random import Random

import pytest

from plant.noise import Normal, whole_between


def test_normal_numbers_are_those_of_the_standard_library_bit_for_bit() -> None:
    ours, theirs = Normal(Random("a")), Random("a")
    for n in range(1001):
        assert ours.draw(0.001 * n) == theirs.gauss(0.0, 0.001 * n)


@pytest.mark.parametrize(("least", "most"), [(0, 0), (100_000, 500_000), (5, 6), (0, 2**40 - 1)])
def test_whole_numbers_are_those_of_the_standard_library(least: int, most: int) -> None:
    ours, theirs = Random("b"), Random("b")
    for _ in range(1000):
        assert whole_between(ours, least, most) == theirs.randint(least, most)
