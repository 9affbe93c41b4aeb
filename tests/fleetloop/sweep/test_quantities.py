"""What is kept of a case, against the summary of the same run and closed forms."""

import math

import numpy as np
import pytest
from support.studies import SHORT, P, cases_of

from bridge.process.lifecycle import Stop
from fleetloop.in_process.whole import run_in_memory
from fleetloop.results.summary import RunStats, summarise
from fleetloop.sweep.statistics import Course, parts_of, statistic

T = np.arange(0.0, 20.0, 0.01)
DECAY = Course(T, np.exp(-T))
SWING = Course(T, np.sin(T) - 0.25)


def test_statistics_are_those_of_their_closed_forms() -> None:
    assert statistic("peak", [SWING]) == pytest.approx(1.25, abs=1e-4)
    assert statistic("least", [SWING, DECAY]) == pytest.approx(-1.25, abs=1e-4)
    assert statistic("greatest", [SWING, DECAY]) == 1.0
    assert statistic("final", [DECAY]) == pytest.approx(math.exp(-15.0), rel=0.02)
    assert statistic("settle_s_of", [DECAY]) == pytest.approx(math.log(20.0), abs=0.01)
    assert statistic("mean", [DECAY]) == pytest.approx(1.0 / 20.0, rel=0.01)
    assert statistic("rms", [DECAY]) == pytest.approx(math.sqrt(0.5 / 20.0), rel=0.01)


def test_what_never_settles_has_no_time_to_settle() -> None:
    assert statistic("settle_s_of", [DECAY, SWING]) is None


def test_what_is_no_number_is_no_value() -> None:
    assert statistic("peak", [Course(T[:2], np.array([1.0, math.nan]))]) is None
    assert statistic("peak", [Course(T[:0], T[:0])]) is None


def test_a_name_has_its_statistic_and_its_signal() -> None:
    assert parts_of("settle_s_of_s_spread") == ("settle_s_of", "s_spread")
    assert parts_of("peak_x_e_m") == ("peak", "x_e_m")
    assert parts_of("x_e_m") is None
    assert parts_of("peak_") is None


def test_the_quantities_of_a_case_are_those_of_its_summary() -> None:
    cases = cases_of(SHORT.replace("until_s=0.1", "until_s=1.0") + 'design = "grid"\n' + P)
    scenario = cases.scenario(cases.case(1))
    run = run_in_memory(scenario, Stop())
    found = cases.quantities.find(run.record, scenario, run.stopped, run.events)
    stats = RunStats("in-process", stopped_robots=run.stopped, events=run.events)
    summary = summarise(run.record, scenario, stats)
    worst, along = summary["worst"], summary["s_spread"]
    for name in ("x_e_m", "y_e_m", "theta_e_rad"):
        assert found.values[f"settle_s_of_{name}"] == worst["settle_s"][name]
        assert found.values[f"final_{name}"] == worst["final_max"][name]
    assert found.values["peak_s_spread"] == along["peak"]
    assert found.values["final_s_spread"] == along["final"]
    assert found.values["peak_torque_wheel_N_m"] == worst["peak_torque_wheel_N_m"]
    assert found.verdict == summary["verdict"]
    margins = [one["margin"] for one in summary["expectations"]]
    assert [found.values[f"expect_{n}_margin"] for n in (1, 2)] == margins
    assert found.margin == min(margins)


def test_a_robot_that_stopped_fails_its_case_by_more_than_any_bound() -> None:
    cases = cases_of(SHORT + 'design = "grid"\n' + P)
    scenario = cases.scenario(cases.case(0))
    run = run_in_memory(scenario, Stop())
    found = cases.quantities.find(run.record, scenario, {"r2": "heading is not finite"}, [])
    assert (found.verdict, found.margin) == ("failed", -math.inf)
    assert found.reason.startswith("r2: heading is not finite")
