"""Main effects: what each factor does to a result by itself, and which factor does most.

The cases are sorted into bins of a factor: its levels, or equal shares of its samples. A bin has
the mean of the result and a confidence interval: Student's of a mean, Wilson's of a failure rate.
The effect is the share of the variance of the result's ranks that the bins explain, as Kruskal and
Wallis test it; that of N cases and B bins is raised by chance, so it is corrected (Kelley 1935):

    ε² = (SS_between − (B − 1) MS_within) / SS_total,   MS_within = SS_within / (N − B)        (1)

It needs no straight line and no monotony, as a correlation would, and a run that diverged counts as
the last, however far it got. Of a failure rate ranks change nothing; of independent factors it then
estimates the first-order Sobol' index. 0: the factor by itself changes nothing; what it does only
together with another one isn't in it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fleetloop.sweep.extra import require
from fleetloop.sweep.report.columns import Column, Series
from fleetloop.sweep.report.results import RATES, Results
from fleetloop.sweep.stopping import Rate

MEASURE = (
    "ε²: share of the variance of the result's ranks that the bins of a factor explain"
    " (Kruskal-Wallis, corrected for chance); no linearity is assumed, interactions aren't in it"
)
MOST_BINS, PER_BIN = 10, 20
"""Of a factor without levels: at most so many, with so many cases at least."""
_FEWEST_BINS = 3


class Bin(NamedTuple):
    """The cases of a level, or between two values."""

    label: str
    at: float
    """Its level, or the mean of its values."""
    cases: int
    """Cases with a value of the result."""
    mean: float
    low: float
    high: float
    """Of the mean's confidence interval; NaN: unknown, of one case."""


@dataclass(frozen=True, slots=True)
class Effect:
    """What one factor does to one result."""

    factor: Column
    result: Column
    bins: tuple[Bin, ...]
    share: float
    """ε² of (1), 0 at least; NaN: too few cases, or a result that doesn't vary."""


def effect_of(factor: Column, result: Column, confidence: float) -> Effect:
    """The main effect of a factor on a result."""
    known = np.isfinite(factor.values) & np.isfinite(result.values)
    x, y = factor.values[known], result.values[known]
    places, labels = binned(factor, x)
    made = []
    for n, label in enumerate(labels):
        here = places == n
        values = y[here]
        if not len(values):
            continue
        of_rate = result.name in RATES
        low, high = (
            rate_interval(values, confidence) if of_rate else mean_interval(values, confidence)
        )
        made.append(Bin(label, float(x[here].mean()), len(values), float(values.mean()), low, high))
    return Effect(factor, result, tuple(made), explained(places, ranks(y)))


def ranking(factors: Sequence[Column], result: Column, confidence: float) -> list[Effect]:
    """The main effects of all factors that can have one, the largest first."""
    effects = [effect_of(one, result, confidence) for one in factors if one.is_axis]
    return sorted(effects, key=lambda one: -np.nan_to_num(one.share, nan=-1.0))


def ranks(values: Series) -> Series:
    """Ranks from 1 on, the mean of them where values are equal."""
    _, places, counts = np.unique(values, return_inverse=True, return_counts=True)
    of_equals: Series = np.cumsum(counts) - 0.5 * (counts - 1)
    return of_equals[places]


def explained(places: NDArray[np.intp], y: Series) -> float:
    """ε² of (1) from the number of each value's bin; NaN if there is none."""
    count = len(y)
    total = float(((y - y.mean()) ** 2).sum()) if count else 0.0
    bins = np.unique(places)
    scale = float(np.abs(y).max(initial=0.0)) ** 2 * count
    if count <= len(bins) or len(bins) < 2 or total <= 1e-24 * scale:
        return float("nan")
    within = sum(float(((y[places == n] - y[places == n].mean()) ** 2).sum()) for n in bins)
    between = total - within
    share = (between - (len(bins) - 1) * within / (count - len(bins))) / total
    return min(max(share, 0.0), 1.0)


def binned(factor: Column, x: Series) -> tuple[NDArray[np.intp], list[str]]:
    """The number of each value's bin, and the bins' labels.

    Bins of samples have about equal shares of the cases; a value that more have is one by itself.
    """
    distinct, places, counts = np.unique(x, return_inverse=True, return_counts=True)
    if factor.levels or len(distinct) <= MOST_BINS:
        return places, [factor.shown(float(one)) for one in distinct]
    bins = int(min(MOST_BINS, max(_FEWEST_BINS, len(x) // PER_BIN)))
    heavy = counts * bins > len(x)
    light = np.where(heavy, 0, counts)
    left = int(np.clip(light.sum() // PER_BIN, 1, max(bins - heavy.sum(), 1)))
    if not heavy.any():
        left = bins
    shares = left * (np.cumsum(light) - 0.5 * light) / max(light.sum(), 1)
    starts = (np.diff(np.floor(shares)) > 0) | heavy[1:] | heavy[:-1]
    numbers = np.concatenate([[0], np.cumsum(starts)])
    ends = [(distinct[numbers == n][0], distinct[numbers == n][-1]) for n in np.unique(numbers)]
    labels = [
        factor.shown(a) if a == b else f"{factor.shown(a)} to {factor.shown(b)}" for a, b in ends
    ]
    return numbers[places], labels


def rate_interval(failed: Series, confidence: float) -> tuple[float, float]:
    """Wilson's interval of a failure rate, from 1 and 0 of each case."""
    return Rate(int(failed.sum()), len(failed), confidence).interval


def mean_interval(values: Series, confidence: float) -> tuple[float, float]:
    """Student's interval of a mean; NaN of one value.

    Raises:
        ScenarioError: SciPy isn't there.
    """
    require("scipy")
    from scipy.special import stdtrit

    count = len(values)
    if count < 2:
        return float("nan"), float("nan")
    half = float(stdtrit(count - 1, 0.5 + 0.5 * confidence)) * float(values.std(ddof=1))
    half /= sqrt(count)
    mean = float(values.mean())
    return mean - half, mean + half


def varying_result(results: Results) -> Column:
    """What is coloured if nothing is asked for.

    Of a study that is held against theory the share of unstable cases; else the failure rate if
    some cases held and some failed; else the least margin; else the first quantity that varies;
    else the failure rate.
    """
    margin = results.quantities[-1]
    others = (margin, *results.quantities[:-1])
    found = (*results.rates, *others)
    return next((one for one in found if one.varies), results.failure_rate)
