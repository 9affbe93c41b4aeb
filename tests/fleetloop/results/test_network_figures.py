"""Strips of ages: few columns, and no peak lost."""

import numpy as np
import pytest

from fleetloop.results.network_figures import COLUMNS, oldest


@pytest.mark.parametrize("ticks", [1, 599, 600, 601, 30_000])
def test_a_strip_keeps_the_oldest_age_in_few_columns(ticks: int) -> None:
    ages = np.linspace(0.0, 1.0, ticks)
    ages[ticks // 3] = 7.0
    strip = oldest(ages, ticks)
    assert len(strip) <= COLUMNS
    assert np.nanmax(strip) == 7.0
    assert strip[-1] == ages[-1]


def test_what_was_not_heard_or_comes_after_a_robots_end_is_blank() -> None:
    ages = np.array([np.nan, np.nan, 0.1, 0.2])
    strip = oldest(ages, 6)
    assert np.isnan(strip[[0, 1, 4, 5]]).all()
    assert list(strip[2:4]) == [0.1, 0.2]
