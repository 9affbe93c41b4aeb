"""How fast signals of a linear system grow in the end, found early: from a run of a few seconds.

Of the changes d_k = y_{k+1} − y_k of courses y(t), sampled Δ apart, x_k = (d_k, d_{k+m}) is a
state if there are at most two modes per course, as of robots that are coupled in the second order
(dynamic mode decomposition, Tu et al. 2014, with a delay of m Δ, a tenth of the run). What is
constant is in no change, and doesn't count. A row w of numbers is a mode if it makes a geometric
sequence of the states:

    w x_{k+1} = λ w x_k        growth = ln|λ|/Δ   [1/s]

w and λ are left eigenvectors and eigenvalues of the least squares fit x_{k+1} ≈ A x_k among the
principal components that are above the rounding of the numbers; those of noise, and of what isn't
linear, make no geometric sequence and don't count. The ratio of two root mean squares would need a
run of many periods and time constants for what this tells within one or two. Modes that decay fast
and alike, as of a chain, are told apart only by a run that is longer than their time constants.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FEWEST_SAMPLES, SAMPLES_PER_COURSE = 40, 8
"""Instants that are looked at: as many as these at least, if there are."""
DELAY = 10
"""Of the state, as a part of the run."""
ROUNDING = 1e-13
"""Of the largest principal component: smaller ones are rounding."""
GEOMETRIC = 1e-5
"""Deviation from a geometric sequence, of its root mean square, within which it is one."""
_ZERO = 1e-150

Series = NDArray[np.float64]


def growth_1_s(t_s: Series, courses: Sequence[Series]) -> float | None:
    """Growth of the mode that grows fastest, or decays slowest, over these courses together.

    Args:
        t_s: evenly spaced times [s].
        courses: values at these times.

    Returns:
        it [1/s], above 0: it grows; None: too few values, some that aren't finite, constants, or
        no mode at all.
    """
    y = np.array(courses)
    count = max(FEWEST_SAMPLES, SAMPLES_PER_COURSE * len(y))
    every = max((y.shape[1] - 1) // count, 1) if y.ndim == 2 else 1
    y = np.diff(y[:, ::every])
    if y.shape[1] < max(SAMPLES_PER_COURSE * len(y), DELAY) or not np.isfinite(y).all():
        return None
    largest = float(np.abs(y).max())
    if largest < _ZERO:
        return None
    delay = y.shape[1] // DELAY
    state = np.concatenate([y[:, :-delay], y[:, delay:]]) / largest
    # In principal components: x_k are the columns of `now`, x_{k+1} those of `then`.
    u, size, now = np.linalg.svd(state[:, :-1], full_matrices=False)
    rank = int((size > ROUNDING * size[0]).sum())
    now = now[:rank]
    then = (u[:, :rank].T @ state[:, 1:]) / size[:rank, None]
    factors, rows = np.linalg.eig((then @ now.T).T)
    made = rows.T @ now
    off = np.linalg.norm(rows.T @ then - factors[:, None] * made, axis=1)
    modes = np.abs(factors[(off < GEOMETRIC * np.linalg.norm(made, axis=1)) & (factors != 0.0)])
    if not len(modes):
        return None
    return float(np.log(modes.max()) / (float(t_s[every] - t_s[0])))
