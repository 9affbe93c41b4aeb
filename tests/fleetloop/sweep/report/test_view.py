"""What a report shows if nothing is asked for, and if something is."""

import math

import numpy as np
import pytest
from support.studies import FEW, MASS, SHORT, P
from support.study_results import Came, made_results, made_study

from configs.errors import ScenarioError
from fleetloop.sweep.report.derived import with_derived
from fleetloop.sweep.report.results import results_of
from fleetloop.sweep.report.tables import rate_words, remarks
from fleetloop.sweep.report.view import Choice, numbers_of, view_of

HEAD = SHORT + 'design = "random"\ncases = 120\n'
SEED = '[[factor]]\nkey = "seed"\nintegers = [1, 1000]\n'
K1 = '[[factor]]\nkey = "control.k1"\nuniform = [1.0, 3.0]\n'
TEXT = HEAD + SEED + MASS + K1 + FEW


def by_mass_and_k1(case) -> Came:
    if case["mass_kg"] > 3.0 or case["k1"] > 2.8:
        return Came("failed", -0.1 * case["mass_kg"], "too heavy")
    return Came("held", 0.2)


def test_the_map_is_over_the_two_factors_with_the_largest_effects(tmp_path) -> None:
    view = view_of(made_results(tmp_path, TEXT, by_mass_and_k1), Choice())
    assert [one.factor.name for one in view.effects] == ["mass_kg", "k1", "seed"]
    assert view.heat is not None
    assert (view.heat.x.column.name, view.heat.y.column.name) == ("mass_kg", "k1")
    assert view.result.name == "failure_rate"


def test_what_is_asked_for_is_shown(tmp_path) -> None:
    results = made_results(tmp_path, TEXT, by_mass_and_k1)
    view = view_of(results, Choice("seed", "k1", "margin"))
    assert view.heat is not None
    assert (view.heat.x.column.name, view.heat.y.column.name) == ("seed", "k1")
    assert view.heat.result.name == view.effects[0].result.name == "margin"
    other = view_of(results, Choice(y="mass_kg")).heat
    assert other is not None
    assert (other.x.column.name, other.y.column.name) == ("k1", "mass_kg")


def test_one_column_makes_no_map(tmp_path) -> None:
    results = made_results(tmp_path, TEXT, by_mass_and_k1)
    with pytest.raises(ScenarioError, match="a map needs two different columns"):
        view_of(results, Choice("k1", "k1"))


def test_with_one_factor_it_says_why_there_is_no_map(tmp_path) -> None:
    text = SHORT + 'design = "grid"\n' + P + FEW
    view = view_of(made_results(tmp_path, text, lambda _: Came()), Choice())
    assert view.heat is None
    assert view.no_map == "1 factor has several values here: a map needs two"


def test_the_rate_is_of_cases_that_held_or_failed(tmp_path) -> None:
    def some(case) -> Came:
        if case["k1"] < 1.5:
            return Came("invalid", None, "no", engine=("", ""))
        return by_mass_and_k1(case)

    view = view_of(made_results(tmp_path, TEXT, some), Choice())
    counts = view.results.counts
    assert view.rate.judged == counts["held"] + counts["failed"] < 120
    assert view.rate.failed == counts["failed"]
    assert "Wilson's 95 % interval" in rate_words(view)


def test_a_study_in_which_all_held_shows_margins(tmp_path) -> None:
    results = made_results(tmp_path, TEXT, lambda case: Came("held", case["k1"]))
    view = view_of(results, Choice())
    assert view.result.name == "margin"
    assert view.effects[0].factor.name == "k1"
    assert view.effects[0].share > 0.95


def test_a_run_that_diverged_outweighs_none_of_the_others(tmp_path) -> None:
    def wild(case) -> Came:
        return Came("held", 1e9 if case["seed"] % 50 == 0 else case["k1"])

    view = view_of(made_results(tmp_path, TEXT, wild), Choice())
    assert view.effects[0].factor.name == "k1"
    assert view.effects[0].share > 0.8


def test_the_worst_come_first_and_stopped_ones_before_all(tmp_path) -> None:
    def some(case) -> Came:
        if case["k1"] > 2.9:
            return Came("failed", -math.inf, "r1: diverged")
        return by_mass_and_k1(case)

    view = view_of(made_results(tmp_path, TEXT, some), Choice(worst=30))
    margins = [one.margin for one in view.worst]
    assert len(margins) == 30
    assert margins[0] == -math.inf
    assert margins == sorted(margins)
    first = view.worst[0]
    assert first.reason == "r1: diverged"
    assert f"--set control.k1={first.factors['k1']}" in first.command
    assert view_of(view.results, Choice(worst=0)).worst == ()


def test_a_case_whose_run_was_kept_has_its_place(tmp_path) -> None:
    results = made_results(tmp_path, TEXT, by_mass_and_k1)
    worst = view_of(results, Choice()).worst[0].case
    kept = tmp_path / "worst" / f"case-{worst:06d}"
    kept.mkdir(parents=True)
    first, second, *_ = view_of(results, Choice()).worst
    assert first.record == f"worst/case-{worst:06d}"
    assert second.record == ""


def test_what_brought_no_result_is_grouped_by_its_reason(tmp_path) -> None:
    def some(case) -> Came:
        if case["k1"] < 1.5:
            return Came("invalid", None, "must be less", engine=("", ""))
        return Came("error", None, "it broke") if case["k1"] < 1.6 else Came()

    view = view_of(made_results(tmp_path, TEXT, some), Choice())
    found = view.without_result()
    assert [(verdict, reason) for verdict, reason, *_ in found] == [
        ("invalid", "must be less"),
        ("error", "it broke"),
    ]
    assert [n for *_, n, _, _ in found] == [
        view.results.counts["invalid"],
        view.results.counts["error"],
    ]


def test_engines_are_counted_with_why(tmp_path) -> None:
    def some(case) -> Came:
        return Came(engine=("in process", "wire timing") if case["p"] == 1.0 else ("kernel", ""))

    view = view_of(made_results(tmp_path, SHORT + 'design = "grid"\n' + P + FEW, some), Choice())
    assert view.engines() == [("kernel", "", 2), ("in process", "wire timing", 1)]


def test_a_study_without_a_result_has_a_report(tmp_path) -> None:
    view = view_of(made_results(tmp_path, TEXT, lambda _: Came("error", None, "no")), Choice())
    assert view.heat is None
    assert view.rate.value is None
    assert rate_words(view) == "unknown: no case held or failed"
    assert view.worst == ()
    numbers = numbers_of(view)
    assert numbers["counts"] == {"error": 120}


def test_what_is_not_done_is_said(tmp_path) -> None:
    made_study(tmp_path, TEXT, by_mass_and_k1, range(50))
    (line,) = remarks(view_of(with_derived(results_of(tmp_path)), Choice()))
    assert line == f"70 of 120 cases aren't done: go on with fleetloop sweep --resume {tmp_path}"


def test_the_effects_of_all_results_are_those_on_each(tmp_path) -> None:
    view = view_of(made_results(tmp_path, TEXT, by_mass_and_k1), Choice())
    shares = {result.name: found for result, found in view.shares()}
    assert list(shares) == ["failure_rate", "margin"]
    assert shares["failure_rate"] == [one.share for one in view.effects]
    assert np.isfinite(shares["margin"]).all()
