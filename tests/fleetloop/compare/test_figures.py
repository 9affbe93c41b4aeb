"""Figures of a comparison, whatever the courses are."""

import warnings

import numpy as np
import pytest

from configs.loading import load
from fleetloop.compare.figures import all_figures
from fleetloop.compare.jobs import Outcome
from fleetloop.compare.measures import Course
from fleetloop.compare.results import Row
from fleetloop.results.pictures import png

SOUND = {"stopped_robots": {}, "verdict": "held", "expectations": []}
STOPPED = SOUND | {"stopped_robots": {"r1": "diverged"}}
T = np.linspace(0.0, 10.0, 101)


def row(label: str, values: np.ndarray, summary: dict = SOUND) -> Row:
    courses = {name: Course(T, values) for name in ("x_e_m", "torque_wheel_N_m")}
    return Row(label, load("two_robots"), {1: Outcome(summary, None, courses)})


@pytest.mark.parametrize(
    "values",
    [
        np.full_like(T, 3.0),
        np.full_like(T, 1e-9),
        np.zeros_like(T),
        np.exp(-5.0 * T),
        np.full_like(T, np.nan),
    ],
    ids=["large", "tiny", "zero", "decaying", "no number"],
)
def test_any_course_is_drawn(values: np.ndarray) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figures = all_figures([row("one", values), row("other", values)], seed=1)
        assert [png(one.figure)[:4] for one in figures] == [b"\x89PNG"] * 2


def test_the_scale_is_that_of_the_laws_that_came_through() -> None:
    rows = [row("good", np.exp(-T)), row("bad", np.exp(3.0 * T), STOPPED)]
    for figure in all_figures(rows, seed=1):
        whole, close = figure.figure.axes
        assert 1.0 < whole.get_ylim()[1] < 10.0
        assert close.get_ylim()[1] < 0.01
        assert len(whole.get_lines()) >= 2
