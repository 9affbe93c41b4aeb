"""What the equations call of Python, said again for the compiler, value for value.

Its own versions differ in corners: `min` and `max` where an argument isn't a number, and float32 as
the bus has it. Each is tested against what it stands for.
"""

from collections.abc import Sequence

import numpy as np

FLOAT32_MOST = 3.4028234663852886e38
"""The largest float32."""


def least(a: float, b: float) -> float:
    """Python's min(a, b)."""
    return b if b < a else a  # noqa: FURB136 - that is what it says


def most(a: float, b: float) -> float:
    """Python's max(a, b)."""
    return b if b > a else a  # noqa: FURB136 - that is what it says


def bisect_right(ordered: Sequence[float], value: float) -> int:
    """As `bisect.bisect_right`."""
    low, high = 0, len(ordered)
    while low < high:
        middle = (low + high) // 2
        if value < ordered[middle]:
            high = middle
        else:
            low = middle + 1
    return low


def float32(value: float) -> float:
    """The value as four bytes carry it; beyond `FLOAT32_MOST` infinite, which `struct` refuses."""
    return float(np.float32(value))
