"""Simulation against theory: what is predicted, what is compared, what a case's verdict is."""

import numpy as np
import pytest
from support.studies import cases_of

from bridge.process.lifecycle import Stop
from fleetloop.in_process.whole import run_in_memory
from fleetloop.sweep.batch import Kernel, rows_of
from fleetloop.sweep.cases import Cases
from fleetloop.sweep.kernel import lacks, run
from fleetloop.sweep.plan import Plan
from fleetloop.sweep.study import CONTINUOUS, MEASURED, SAMPLED
from fleetloop.sweep.theory import agreements
from fleetloop.sweep.watch import Watch

PAIR = """
schema = 1
title = "two that hear each other"
base = "two_robots"
design = "grid"
set = [
    "duration_s=1.6",
    'graph={ edges = ["r1 -> r2", "r2 -> r1"], leader = ["r1"] }',
    "robot.r2.s_0=0.001",
    "expect=[]",
]
[[factor]]
key = "coordination.p"
values = [2.0]
[keep]
quantities = []
[theory]
"""


def test_a_run_grows_as_theory_says_and_its_case_holds() -> None:
    cases = cases_of(PAIR)
    scenario = cases.scenario(cases.case(0))
    run_ = run_in_memory(scenario, Stop())
    found = cases.quantities.find(run_.record, scenario, run_.stopped, run_.events)
    # λ² + p λ + 2 q = 0 with p = 2, q = 1: Re λ = −1.
    assert found.values[CONTINUOUS] == pytest.approx(-1.0, abs=1e-9)
    assert found.values[SAMPLED] == pytest.approx(-1.0, abs=0.05)
    assert found.values[MEASURED] == pytest.approx(found.values[SAMPLED], abs=1e-4)
    assert (found.verdict, found.reason) == ("held", "")
    assert found.margin == -(found.values[MEASURED] or 0.0)


def test_a_robot_that_stops_fails_whatever_grows() -> None:
    cases = cases_of(PAIR)
    scenario = cases.scenario(cases.case(0))
    run_ = run_in_memory(scenario, Stop())
    found = cases.quantities.find(run_.record, scenario, {"r1": "off"}, run_.events)
    assert (found.verdict, found.margin, found.reason) == ("failed", -np.inf, "r1: off")


def test_a_case_without_growth_is_not_checked_and_a_contradiction_fails() -> None:
    cases = cases_of(PAIR)
    scenario = cases.scenario(cases.case(0))
    run_ = run_in_memory(scenario, Stop())
    for rows in run_.record.controller.values():
        rows["mu"] = np.exp(0.3 * np.arange(len(rows)) * scenario.clock.control_period_s)
    found = cases.quantities.find(run_.record, scenario, {}, [])
    assert found.verdict == "failed"
    assert found.margin == pytest.approx(-0.3, abs=1e-6)
    expected = "growth of the disagreement 0.3 1/s, by theory (sampled) -0.995 1/s"
    assert found.reason == expected
    for rows in run_.record.controller.values():
        rows["mu"] = 0.0
    found = cases.quantities.find(run_.record, scenario, {}, [])
    assert (found.verdict, found.margin) == ("not checked", None)


def test_agreements_are_counted_of_both_conditions() -> None:
    columns = {
        MEASURED: np.array([0.5, -0.5, -0.002, np.nan, 0.003]),
        SAMPLED: np.array([0.5, -0.4, -0.0021, 1.0, 0.003]),
        CONTINUOUS: np.array([0.5, -0.4, 0.001, 1.0, -0.0005]),
    }
    sampled, continuous = agreements("sampled", columns)
    assert (sampled.condition, sampled.judges) == ("sampled", True)
    assert (sampled.agree, sampled.disagree, sampled.stable, sampled.unstable) == (4, 0, 2, 2)
    assert sampled.least_1_s == 0.002
    assert sampled.off_1_s == pytest.approx(0.0001)
    assert sampled.words == "the law as sampled: 4 of 4 cases agree, 0 disagree"
    assert (continuous.agree, continuous.disagree, continuous.farthest_1_s) == (2, 2, 0.003)
    assert continuous.words.endswith("2 of 4 cases agree, 2 disagree, of at most 0.003 1/s")
    assert [one.condition for one in agreements("(46)", columns)] == ["(46)", "sampled"]


@pytest.mark.timeout(600)  # of which the kernel's compilation takes most
def test_the_first_cases_of_the_stability_map_contradict_no_theory() -> None:
    cases = Cases(Plan.of("stability_map"))
    with Watch(cases.study.limit_s) as watch:
        rows = rows_of(cases, range(64), watch, Kernel(lacks, run))
    assert {(row.verdict, row.engine) for row in rows} == {("held", "kernel")}
    values = [row.values for row in rows]
    theory = np.array([one[SAMPLED] for one in values], dtype=float)
    measured = np.array([one[MEASURED] for one in values], dtype=float)
    assert 0.25 < (measured > 0.0).mean() < 0.75
    slow = theory > -0.3  # what decays fast is far from any boundary, and seen less exactly
    assert np.abs(measured - theory)[slow].max() < 1e-4
