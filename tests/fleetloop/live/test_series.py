"""Series in bounded memory: few points, no peak lost, whatever blocks the rows come in."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleetloop.live.series import History, Track, merged

PEAKS = np.array([False, True])


def rows_of(ticks: int) -> np.ndarray:
    ramp = np.arange(ticks, dtype=float)
    return np.column_stack([ramp, np.sin(ramp)])


def test_a_bin_has_the_last_of_a_signal_and_the_largest_of_a_peak_signal() -> None:
    rows = np.array([[1.0, 2.0], [3.0, -7.0], [5.0, 6.0], [7.0, np.nan]])
    assert merged(rows, 2, PEAKS).tolist() == [[3.0, -7.0], [7.0, 6.0]]


def test_a_bin_of_nothing_known_is_not_known() -> None:
    assert np.isnan(merged(np.full((2, 2), np.nan), 2, PEAKS)).all()


@given(st.lists(st.integers(1, 40), min_size=1, max_size=12))
def test_bins_are_the_same_however_rows_are_cut_into_blocks(cuts: list[int]) -> None:
    rows, stride = rows_of(sum(cuts)), 7
    track, first = Track([0, 1], PEAKS.tolist(), stride), 0
    for count in cuts:
        track.add(first, rows[first : first + count])
        first += count
    whole = len(rows) // stride * stride
    got = [values for _, values in track.ready]
    made = np.concatenate(got) if got else np.empty((0, 2))
    assert np.array_equal(made, merged(rows[:whole], stride, PEAKS))
    assert track.last.tolist() == rows[-1].tolist()


def test_rows_that_did_not_come_are_unknown_in_their_bin_only() -> None:
    track = Track([0], [False], 4)
    track.add(0, rows_of(4))
    track.add(10, rows_of(6))  # ticks 10 to 15: bin 2 has its second half, bin 3 is whole
    assert [(first, len(values)) for first, values in track.ready] == [(0, 1), (2, 2)]


def test_rows_that_come_twice_are_passed_over() -> None:
    track = Track([0], [False], 1)
    track.add(0, rows_of(8))
    track.add(4, rows_of(8))
    assert track.last_tick == 11
    assert sum(len(values) for _, values in track.ready) == 12


def test_a_history_stays_within_its_capacity_and_keeps_every_peak_and_its_ends() -> None:
    history = History([False, True], capacity=64)
    t = np.arange(5000.0)
    values = np.where(t == 1234.0, -99.0, 1.0)
    for first in range(0, 5000, 37):
        history.append(first, np.column_stack([t, values])[first : first + 37])
    rows = history.since(0)
    assert len(rows) <= 64
    assert rows[:, 1].min() == -99.0
    assert rows[-1, 0] == 4999.0
    assert np.all(np.diff(rows[:, 0]) > 0.0)


def test_what_came_since_a_number_is_what_came_since() -> None:
    history = History([False, True], capacity=64)
    history.append(0, rows_of(20))
    assert history.since(history.end).shape == (0, 2)
    history.append(20, rows_of(5) + 20.0)
    assert history.since(20)[:, 0].tolist() == [20.0, 21.0, 22.0, 23.0, 24.0]


@pytest.mark.parametrize("count", [1, 63, 1000])
def test_a_large_block_finds_room(count: int) -> None:
    history = History([False, True], capacity=64)
    history.append(0, rows_of(count))
    assert history.since(0)[-1, 0] == count - 1
