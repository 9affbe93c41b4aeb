"""How far a signal is from breaking an expectation: the robustness of signal temporal logic.

With the slack g(k) of a signal at tick k of a window, its distance inside its bounds (negative
outside), in the signal's unit:

    always                       min_k g(k)                                              held if ≥ 0
    at a share q of n ticks      the ⌈q n⌉-th greatest g(k)                              held if ≥ 0
    eventually for w ticks       max_k min_{k ≤ j < k + w} g(j)                          held if ≥ 0
    never for w ticks            −max_k min_{k ≤ j < k + w} g(j)                         held if > 0
    settles                      limit − time from which on g ≥ 0, in seconds            held if ≥ 0

Slack that isn't known is NaN, of a value that is no number −∞. A window that wasn't recorded to its
end gives a verdict only if nothing of the rest could change it.
Source: Donzé, Maler, Robust satisfaction of temporal logic over real-valued signals, 2010.
"""

from math import ceil, inf, isnan, nan
from typing import NamedTuple

import numpy as np


class Finding(NamedTuple):
    """What was found of one series."""

    held: bool | None
    """None: not reached."""
    margin: float
    """NaN if there is none."""
    at: int | None
    """Index of the tick that it is due to."""
    settled_s: float | None = None


NOTHING = Finding(None, nan, None)


def slack(
    values: np.ndarray, *, least: float = -inf, most: float = inf, widest: float = inf
) -> np.ndarray:
    """The distance of values inside their bounds: min, max and max_abs; −∞ of what is no number."""
    finite = np.isfinite(values)
    whole = bool(finite.all())
    numbers = values if whole else np.where(finite, values, 0.0)
    distances = []  # from the bounds that there are: each pass takes its time
    if most != inf:
        distances.append(most - numbers)
    if least != -inf:
        distances.append(numbers - least)
    if widest != inf:
        distances.append(widest - np.abs(numbers))
    inside = distances[0] if distances else np.full(values.shape, inf)
    for other in distances[1:]:
        inside = np.minimum(inside, other)
    return inside if whole else np.where(finite, inside, -inf)


def always(g: np.ndarray, ticks: int) -> Finding:
    """At every tick; `ticks` are those of the whole window, of which `g` may be the first part."""
    if not len(g):
        return NOTHING
    at = int(g.argmin())  # the first that is unknown, if one is
    margin = float(g[at])
    if not isnan(margin):
        whole = True if len(g) == ticks else None
        return Finding(False if margin < 0.0 else whole, margin, at)
    unknown = np.isnan(g)
    if unknown.all():
        return NOTHING
    at = int(np.argmin(np.where(unknown, inf, g)))  # np.nanargmin takes twice as long
    margin = float(g[at])
    return Finding(False if margin < 0.0 else None, margin, at)


def share(g: np.ndarray, ticks: int, quantile: float) -> Finding:
    """At this share of the ticks, or more."""
    known = np.flatnonzero(~np.isnan(g))
    if not len(known):
        return NOTHING
    needed = max(1, ceil(quantile * ticks - 1e-9))
    order = known[np.argsort(-g[known], kind="stable")]
    at = int(order[min(needed, len(order)) - 1])
    good = int((g[known] >= 0.0).sum())
    held = True if good >= needed else None
    if len(known) - good > ticks - needed:
        held = False
    return Finding(held, float(g[at]), at)


def eventually(g: np.ndarray, ticks: int, piece: int = 1) -> Finding:
    """At some tick and the `piece` − 1 after it."""
    if len(g) < piece or np.isnan(g).all():
        return NOTHING
    least = windowed_min(np.where(np.isnan(g), -inf, g), piece)
    at = int(np.argmax(least))
    margin = float(least[at])
    whole = _if_whole(g, ticks)
    return Finding(True if margin >= 0.0 else (False if whole else None), margin, at)


def never(g: np.ndarray, ticks: int, piece: int = 1) -> Finding:
    """At no tick together with the `piece` − 1 after it."""
    if len(g) < piece or np.isnan(g).all():
        return NOTHING
    least = windowed_min(np.where(np.isnan(g), -inf, g), piece)
    at = int(np.argmax(least))
    margin = -float(least[at])
    return Finding(_if_whole(g, ticks) if margin > 0.0 else False, margin, at)


def settles(g: np.ndarray, ticks: int, period_s: float, within_s: float) -> Finding:
    """From this time after the first tick on, or earlier, until the end of the window."""
    if np.isnan(g).all():
        return NOTHING
    outside = np.flatnonzero(g < 0.0)
    last = int(outside[-1]) if len(outside) else -1
    settled_s = round((last + 1) * period_s, 9)
    late = settled_s > within_s + 1e-9
    at = last if last >= 0 else int(np.nanargmin(g))
    if _if_whole(g, ticks) is None:
        return Finding(False if late else None, nan, at)
    if last == len(g) - 1:
        return Finding(False, -inf, at)
    return Finding(not late, round(within_s - settled_s, 9), at, settled_s)


def windowed_min(values: np.ndarray, width: int) -> np.ndarray:
    """The least of each `width` values in a row, 1 ≤ `width` ≤ their number."""
    found, covered = values, 1
    while covered < width:
        step = min(covered, width - covered)
        found = np.minimum(found[: len(found) - step], found[step:])
        covered += step
    return found


def _if_whole(g: np.ndarray, ticks: int) -> bool | None:
    """True if all of the window is known."""
    return True if len(g) == ticks and not np.isnan(g).any() else None
