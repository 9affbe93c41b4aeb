"""Few points of a signal for a drawing, with every peak.

Buckets of ticks, not of equal length but of equal change: half of them by time, half by the way
that the values go up and down. So the first seconds of a run that settles get the points that they
need. Of each bucket the least and the greatest value stay, where they are.
"""

from typing import NamedTuple

import numpy as np

_DRAWABLE = 1e30
"""Of a motion that diverged only what is smaller is drawn: axes can't be laid out beyond."""
POINTS = 2000


class Points(NamedTuple):
    """What is drawn of a signal."""

    t: np.ndarray
    values: np.ndarray


def drawable(values: np.ndarray) -> np.ndarray:
    """NaN for what can't be drawn."""
    return np.where(np.abs(values) < _DRAWABLE, values, np.nan)


def decimated(t: np.ndarray, values: np.ndarray, points: int = POINTS) -> Points:
    """At most so many points (4 or more) of a signal: both ends, and all peaks of its buckets.

    A bucket without any number gives NaN, which breaks the line there.
    """
    values = drawable(values)
    if len(values) <= points:
        return Points(t, values)
    starts = _borders(values, (points - 2) // 2)
    known = np.isfinite(values)
    sizes = np.diff(starts, append=len(values))
    chosen = [np.array([0]), np.array([len(values) - 1])]
    for fill, extreme in ((np.inf, np.minimum), (-np.inf, np.maximum)):
        filled = np.where(known, values, fill)
        peaks = np.repeat(extreme.reduceat(filled, starts), sizes)
        hits = np.flatnonzero(filled == peaks)
        chosen.append(hits[np.searchsorted(hits, starts)])
    index = np.unique(np.concatenate(chosen))
    return Points(t[index], values[index])


def stride(length: int, points: int = POINTS) -> slice:
    """Few enough points to draw, evenly."""
    return slice(None, None, max(1, -(-length // points)))


def _borders(values: np.ndarray, buckets: int) -> np.ndarray:
    """First indices of buckets of equal change."""
    steps = np.abs(np.diff(np.nan_to_num(values), prepend=0.0))
    steps[0] = 0.0
    way = np.cumsum(np.minimum(steps, np.quantile(steps, 0.999) * 10.0))
    time = np.arange(len(values)) / len(values)
    measure = time if way[-1] <= 0.0 else 0.5 * time + 0.5 * way / way[-1]
    borders = np.searchsorted(measure, np.linspace(0.0, measure[-1], buckets, endpoint=False))
    return np.unique(borders)
