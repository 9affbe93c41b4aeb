"""Few points, every peak."""

import numpy as np
import pytest

from fleetloop.results.decimation import decimated

TICKS = 30_000
T = np.arange(TICKS) * 1e-3


@pytest.mark.parametrize("points", [4, 100, 2000])
@pytest.mark.parametrize("at", [0, 1, 15_003, TICKS - 1])
def test_a_spike_of_one_tick_stays_where_it_is(points: int, at: int) -> None:
    values = np.random.default_rng(1).normal(size=TICKS)
    values[at] = 700.0
    t, kept = decimated(T, values, points)
    assert len(kept) <= points
    assert kept.max() == 700.0
    assert t[kept.argmax()] == T[at]
    assert kept.min() == values.min()
    assert (t[0], t[-1]) == (T[0], T[-1])
    assert (np.diff(t) > 0).all()


def test_the_beginning_of_a_run_that_settles_gets_the_points() -> None:
    values = 4.5 * np.exp(-T)
    t, kept = decimated(T, values, 400)
    assert (t < 3.0).sum() > 200
    assert np.abs(np.interp(T, t, kept) - values).max() < 0.03


def test_what_is_no_number_breaks_the_line_and_moves_nothing_else() -> None:
    values = np.sin(T)
    values[10_000:20_000] = np.nan
    values[25_000:] = 1e300
    t, kept = decimated(T, values, 300)
    gone = np.isnan(kept)
    assert gone[(t > 11.0) & (t < 19.0)].all()
    assert gone[t > 26.0].all()
    assert np.nanmax(kept) == np.sin(T[:10_000]).max()


@pytest.mark.parametrize("values", [np.zeros(TICKS), np.full(TICKS, np.nan), np.full(TICKS, 3.0)])
def test_what_never_changes_needs_few_points(values: np.ndarray) -> None:
    _, kept = decimated(T, values, 50)
    assert len(kept) <= 50
    assert np.array_equal(np.unique(kept), np.unique(values), equal_nan=True)


def test_a_short_signal_is_left_alone() -> None:
    t, kept = decimated(T[:10], T[:10], 2000)
    assert np.array_equal(t, T[:10])
    assert np.array_equal(kept, T[:10])
