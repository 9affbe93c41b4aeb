"""Strips of ages: few columns, and no peak lost."""

from pathlib import Path

import numpy as np
import pytest

from configs.loading import load
from fleetloop.record.reader import Record
from fleetloop.results.network_figures import COLUMNS, edge_states, oldest


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


@pytest.mark.parametrize("mean_s", [-0.005, 0.0, 0.02])
def test_the_graph_is_drawn_whatever_the_mean_ages(mean_s: float) -> None:
    # In real time a path state may be dated ahead of its hearer's clock.
    controller = {
        "r1": np.full(10, np.nan, dtype=[("age_of_leader_s", float)]),
        "r2": np.full(10, mean_s, dtype=[("age_of_r1_s", float)]),
    }
    record = Record(Path(), ("r1", "r2"), {}, controller, {}, "", "")
    figure = edge_states(record, load("two_robots"))
    texts = {text.get_text() for axes in figure.axes for text in axes.texts}
    assert f"{mean_s:.3g} s" in texts
    assert "silent" in texts
