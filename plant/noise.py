"""Random numbers of the loop: those of `random.Random`, drawn without its interpreted methods.

`Normal` is `Random.gauss` of mean 0, by the Box-Muller transform: two numbers from two draws

    z_1 = cos(2π u_1) √(−2 ln(1 − u_2)),   z_2 = sin(2π u_1) √(−2 ln(1 − u_2))

`whole_between` is `Random.randint`. The same seeds give the same numbers as these, bit for bit.
"""

from math import cos, log, pi, sin, sqrt
from random import Random
from typing import Final

_TURN: Final = 2.0 * pi


class Normal:
    """Normally distributed numbers around 0, from a generator that nobody else uses."""

    __slots__ = ("_keeps", "_kept", "_random")

    def __init__(self, random: Random) -> None:
        self._random = random
        self._keeps = False
        self._kept = 0.0  # z_2, for the next call

    def draw(self, deviation: float) -> float:
        """The next number; `deviation`: standard deviation."""
        if self._keeps:
            self._keeps = False
            return self._kept * deviation
        angle = self._random.random() * _TURN
        radius = sqrt(-2.0 * log(1.0 - self._random.random()))
        self._keeps, self._kept = True, sin(angle) * radius
        return cos(angle) * radius * deviation


def whole_between(random: Random, least: int, most: int) -> int:
    """A whole number from `least` to `most`, both included, all equally likely."""
    count = most - least + 1
    bits = count.bit_length()
    drawn: int = random.getrandbits(bits)
    while drawn >= count:
        drawn = random.getrandbits(bits)
    return least + drawn
