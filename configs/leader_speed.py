"""The virtual leader's speed over time: steps, and ramps between two speeds.

    v_r(t) = v_k−1                                        t < t_k
           = v_k−1 + (v_k − v_k−1) (t − t_k) / T_k        t_k ≤ t < t_k + T_k
           = v_k                                          t_k + T_k ≤ t < t_k+1

with T_k = 0 for a step. Before the first change its speed holds. v_r = 0: the formation stands.
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
    """v_r at a scenario time [m/s]; `changes`: at least one, in order, none within another."""
    last = bisect_right(changes, (t_ns, inf)) - 1  # that has begun
    if last < 0:
        return changes[0].speed_m_s
    from_ns, speed, ramp_ns = changes[last]
    if t_ns >= from_ns + ramp_ns:
        return speed
    before = changes[max(last - 1, 0)].speed_m_s
    return before + (speed - before) * ((t_ns - from_ns) / ramp_ns)


def corners(changes: Sequence[SpeedChange], until_ns: int) -> list[int]:
    """Instants from 0 on [ns], the last one included, between which v_r is a straight line.

    Of a step there are two: the last nanosecond before it, and its own.
    """
    found = {t_ns for one in changes for t_ns in (one.from_ns - 1, one.from_ns, one.to_ns)}
    return sorted({0, *(t_ns for t_ns in found if 0 < t_ns < until_ns), until_ns})


def with_change(changes: Sequence[SpeedChange], change: SpeedChange) -> Sequence[SpeedChange] | str:
    """The changes with one more, in place of one at its time but the first; why not, if it can't.

    Args:
        changes: at least one, in order.
        change: that begins at any time.
    """
    first, *later = changes
    kept = [one for one in later if one.from_ns != change.from_ns]
    found = sorted((first, *kept, change), key=lambda one: one.from_ns)
    for one, other in pairwise(found):
        if one.to_ns > other.from_ns:
            since_s, until_s = one.from_ns * 1e-9, one.to_ns * 1e-9
            return (
                f"v_r changes at {other.from_ns * 1e-9:g} s, within its ramp from {since_s:g} s to"
                f" {until_s:g} s"
            )
    return found


def in_order(changes: Sequence[SpeedChange]) -> bool:
    """Whether each change begins when the one before it is over."""
    return all(one.to_ns <= other.from_ns for one, other in pairwise(changes))
