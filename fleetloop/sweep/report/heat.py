"""A result over two factors: cells with the mean of their cases.

Cells of a grid are its levels, those of samples equal parts of the range, in the logarithm where a
factor is spread so. A cell without a case, or without a value in any, is NaN.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fleetloop.sweep.report.columns import MOST_LEVELS, Column, Series

MOST_GRID_LEVELS = 400
"""Of one axis of a grid whose cells are its levels."""
_PER_CELL = 8
"""Cases of a cell of samples, about."""
_LEAST_PART = 0.01
"""Of a range, between levels that aren't a grid's."""
_FEWEST, _MOST = 4, 24
"""Parts of a range."""


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis of a map."""

    column: Column
    edges: Series
    """Of the cells, one more than cells."""
    ticks: Series
    """Middles of levels of texts, or else nothing."""
    exact: bool
    """Whether a cell is one level."""

    @property
    def cells(self) -> int:
        """Their number."""
        return len(self.edges) - 1

    def places(self) -> NDArray[np.intp]:
        """The number of each case's cell; −1: none."""
        values = self.column.values
        found = np.searchsorted(self.edges, values, side="right") - 1
        found = np.where(values == self.edges[-1], self.cells - 1, found)
        known = np.isfinite(values) & (found >= 0) & (found < self.cells)
        return np.where(known, found, -1)


@dataclass(frozen=True, slots=True)
class Heat:
    """Means of a result, rows along y, columns along x."""

    x: Axis
    y: Axis
    result: Column
    means: Series
    """(y, x); NaN: no value."""
    counts: NDArray[np.int64]
    """Cases with a value."""

    @property
    def empty(self) -> int:
        """Cells without a value."""
        return int((self.counts == 0).sum())


def heat_of(x: Column, y: Column, result: Column) -> Heat:
    """The map of a result over two columns."""
    known = np.isfinite(result.values)
    count = int((known & np.isfinite(x.values) & np.isfinite(y.values)).sum())
    axes = axis_of(x, count), axis_of(y, count)
    columns, rows = axes[0].places(), axes[1].places()
    here = known & (columns >= 0) & (rows >= 0)
    shape = axes[1].cells, axes[0].cells
    cells = rows[here] * shape[1] + columns[here]
    counts = np.bincount(cells, minlength=shape[0] * shape[1])
    sums = np.bincount(cells, weights=result.values[here], minlength=shape[0] * shape[1])
    with np.errstate(all="ignore"):
        means = np.where(counts > 0, sums / counts, np.nan)
    return Heat(*axes, result, means.reshape(shape), counts.reshape(shape))


def axis_of(column: Column, count: int) -> Axis:
    """The cells of an axis for so many cases."""
    distinct = column.distinct
    if column.levels:
        middles = np.arange(len(column.levels), dtype=np.float64)
        edges: Series = np.arange(len(column.levels) + 1, dtype=np.float64) - 0.5
        return Axis(column, edges, middles, exact=True)
    if len(distinct) <= (MOST_GRID_LEVELS if column.exact else MOST_LEVELS) and (
        column.exact or _apart(distinct, log=column.log)
    ):
        return Axis(column, _between(distinct, log=column.log), np.empty(0), exact=True)
    cells = int(np.clip(np.sqrt(count / _PER_CELL), _FEWEST, _MOST))
    ends = distinct[0], distinct[-1]
    if column.log and ends[0] > 0.0:
        edges = np.geomspace(*ends, cells + 1)
        edges[[0, -1]] = ends
    else:
        edges = np.linspace(*ends, cells + 1)
    return Axis(column, edges, np.empty(0), exact=False)


def _apart(levels: Series, *, log: bool) -> bool:
    """Whether the cells of levels would all be seen."""
    at = np.log(levels) if log and levels[0] > 0.0 else levels
    return len(at) < 2 or bool(np.diff(at).min() > _LEAST_PART * (at[-1] - at[0]))


def _between(levels: Series, *, log: bool) -> Series:
    """Edges halfway between levels, and as far beyond the outermost."""
    log = log and levels[0] > 0.0
    at = np.log(levels) if log else levels
    if len(at) == 1:
        half = 0.5 * (abs(at[0]) or 1.0)
        edges = np.array([at[0] - half, at[0] + half])
    else:
        middles = 0.5 * (at[1:] + at[:-1])
        first, last = at[0] - (middles[0] - at[0]), at[-1] + (at[-1] - middles[-1])
        edges = np.concatenate([[first], middles, [last]])
    return np.exp(edges) if log else edges
