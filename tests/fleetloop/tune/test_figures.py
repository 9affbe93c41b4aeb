"""Figures of a tuning, of numbers that are known."""

import pytest
from support.tunings import TINY, tuning_of

from fleetloop.tune.figures import all_figures
from fleetloop.tune.scores import Score, Trial, best


def trial(number: int, objective: float | None, missed: float = 0.0) -> Trial:
    values = {"p": 0.5 + 0.1 * number, "q": 10.0 ** (number - 2)}
    return Trial(number, values, Score(objective, {}, {"a": missed}, {"held": 2}, {}, ""))


TRIALS = [trial(0, 3.0), trial(1, 5.0, 0.5), trial(2, 2.0), trial(3, None, 1.0), trial(4, 2.5)]


def drawn(trials: list[Trial]) -> dict:
    tuning = tuning_of(TINY)
    chosen = best(tuning, trials)
    assert chosen is not None
    cases = {"baseline": [1.0, None], "best": [0.5, 0.6]}
    figures = all_figures(tuning, trials, chosen, {"q": 0.8, "p": 0.2}, cases)
    return {one.name: one.figure for one in figures}


def test_every_figure_of_a_tuning_is_there() -> None:
    assert set(drawn(TRIALS)) == {"history", "slices", "importances", "cases"}


def test_the_best_so_far_is_of_feasible_trials() -> None:
    (axes,) = drawn(TRIALS)["history"].axes
    line = next(one for one in axes.lines if one.get_label() == "best so far")
    assert list(line.get_ydata()) == [3.0, 3.0, 2.0, 2.0, 2.0]


def test_crosses_are_trials_that_miss_a_constraint() -> None:
    (axes,) = drawn(TRIALS)["history"].axes
    dots, crosses = axes.lines[:2]
    assert list(dots.get_xdata()) == [0, 2, 4]
    assert (crosses.get_marker(), list(crosses.get_xdata())) == ("x", [1])


def test_a_parameter_that_is_searched_in_the_logarithm_is_drawn_so() -> None:
    panels = drawn(TRIALS)["slices"].axes
    assert [axes.get_xscale() for axes in panels] == ["linear", "log"]


@pytest.mark.parametrize(("least", "scale"), [(0.1, "log"), (2.0, "linear"), (-1.0, "linear")])
def test_an_objective_over_decades_is_drawn_in_the_logarithm(least: float, scale: str) -> None:
    (axes,) = drawn([trial(0, 3.0), trial(1, least)])["history"].axes
    assert axes.get_yscale() == scale


def test_the_least_importance_is_below() -> None:
    (axes,) = drawn(TRIALS)["importances"].axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["p", "q"]


def test_trials_without_any_number_are_drawn_all_the_same() -> None:
    assert "history" in drawn([trial(0, None, 1.0), trial(1, None, 1.0)])
