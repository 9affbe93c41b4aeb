"""The virtual leader's speed over time: steps, and ramps between two speeds.

    v_r(t) = w_k + (v_k − w_k) (t − t_k) / T_k        t_k ≤ t < t_k + T_k, t < t_k+1
           = v_k                                      t_k + T_k ≤ t < t_k+1

with T_k = 0 for a step, and w_k the speed at which change k−1 is at t_k: v_k−1, or what its ramp
has reached, which change k ends. Before the first change its speed holds. v_r = 0: the formation
stands.
"""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from math import inf
from typing import NamedTuple


class SpeedChange(NamedTuple):
    """A change of v_r: a step, or a linear ramp from the speed before."""

    from_ns: int  # scenario time at which it begins
    speed_m_s: float  # after it
    ramp_ns: int = 0  # how long it takes

    @property
    def to_ns(self) -> int:
        """Scenario time from which on the speed holds."""
        return self.from_ns + self.ramp_ns


def speed_at(changes: Sequence[SpeedChange], t_ns: float) -> float:
    """v_r at a scenario time [m/s]; `changes`: at least one, in order."""
    last = bisect_right(changes, (t_ns, inf)) - 1  # that has begun
    if last < 0:
        return changes[0].speed_m_s
    from_ns, speed, ramp_ns = changes[last]
    if t_ns >= from_ns + ramp_ns:
        return speed
    before = _speed_before(changes, last)
    return before + (speed - before) * ((t_ns - from_ns) / ramp_ns)


def _speed_before(changes: Sequence[SpeedChange], number: int) -> float:
    """The speed from which a change begins."""
    first = number  # of the ramps that the next one ends
    while first > 0 and changes[first - 1].to_ns > changes[first].from_ns:
        first -= 1
    speed = changes[max(first - 1, 0)].speed_m_s
    for one, other in pairwise(changes[first : number + 1]):
        speed += (one.speed_m_s - speed) * ((other.from_ns - one.from_ns) / one.ramp_ns)
    return speed


def corners(changes: Sequence[SpeedChange], until_ns: int) -> list[int]:
    """Instants from 0 on [ns], the last one included, between which v_r is a straight line.

    Of a step there are two: the last nanosecond before it, and its own.
    """
    found = {t_ns for one in changes for t_ns in (one.from_ns - 1, one.from_ns, one.to_ns)}
    return sorted({0, *(t_ns for t_ns in found if 0 < t_ns < until_ns), until_ns})


def with_change(changes: Sequence[SpeedChange], change: SpeedChange) -> list[SpeedChange]:
    """The changes with one more, in place of one at its time but the first.

    Args:
        changes: at least one, in order.
        change: that begins at any time.
    """
    first, *later = changes
    kept = [one for one in later if one.from_ns != change.from_ns]
    return sorted((first, *kept, change), key=lambda one: one.from_ns)


def in_order(changes: Sequence[SpeedChange]) -> bool:
    """Whether no change begins before the one before it."""
    return all(one.from_ns <= other.from_ns for one, other in pairwise(changes))
