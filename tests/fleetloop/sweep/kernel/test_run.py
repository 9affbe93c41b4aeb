"""What callers of the kernel have: asked signals, stops, refusals, expectations' verdicts."""

import numpy as np
import pytest

from bridge.process.lifecycle import Stop
from configs.loading import load
from fleetloop.results.expectations import judge
from fleetloop.sweep.kernel import lacks, run
from fleetloop.sweep.kernel.reference import referred


def test_a_record_has_the_signals_that_were_asked_for_and_no_others() -> None:
    scenario = load("paper", ["until_s=0.02"])
    (outcome,) = run([scenario], {"x_m", "s_spread"}, Stop())
    assert outcome.record.plant["r1"].dtype.names == ("tick", "t_s", "x_m")
    assert outcome.record.controller["r1"].dtype.names == ("tick", "t_s", "s")
    assert [signal.name for signal in outcome.record.signals["r4"]] == ["t_s", "s"]


def test_cases_come_in_their_order() -> None:
    gains = [0.5, 1.0, 2.0]
    scenarios = [load("paper", ["until_s=0.02", f"control.k4={k4}"]) for k4 in gains]
    together = run(scenarios, {"alpha_v_m_s", "x_m"}, Stop())
    for scenario, outcome in zip(scenarios, together, strict=True):
        (alone,) = run([scenario], {"x_m"}, Stop())
        assert np.array_equal(outcome.record.plant["r1"]["x_m"], alone.record.plant["r1"]["x_m"])
    ends = {float(outcome.record.plant["r1"]["x_m"][-1]) for outcome in together}
    assert len(ends) == len(gains)


def test_a_case_is_the_same_whatever_was_run_before_it() -> None:
    overrides = ("until_s=0.1", "coordination.p=3.0"), ("until_s=0.1", "graph.weights=normalised")
    graph = 'graph={ edges = ["r1 -> r2", "r1 -> r3", "r2 -> r3", "r3 -> r4"], leader = ["r1"] }'
    some = [load("paper", each) for each in (*overrides, ("until_s=0.1", graph), overrides[0])]
    for scenario, outcome in zip(some, run(some, {"s", "x_m"}, Stop()), strict=True):
        (alone,) = run([scenario], {"s", "x_m"}, Stop())
        for robot in scenario.names:
            assert np.array_equal(outcome.record.controller[robot], alone.record.controller[robot])


def test_more_degrees_than_are_remembered_are_as_in_process() -> None:
    adjacency = [[0.0] * 70 for _ in range(70)]
    for n in range(1, 70):
        adjacency[n][n - 1] = 1.0 + n / 100
    robots = [{"name": f"r{n}", "pose": {"x_m": -4.0, "y_m": n}} for n in range(1, 71)]
    scenario = load("paper", ["until_s=0.02"]).with_(
        {"robot": robots, "graph": {"adjacency": adjacency, "leader": ["r1"]}, "graph.edges": None}
    )
    (outcome,) = run([scenario], {"s", "mu"}, Stop())
    reference = referred(scenario, Stop(), "")
    for robot in scenario.names:
        for name in ("s", "mu"):
            found = outcome.record.controller[robot][name]
            assert np.array_equal(found, reference.record.controller[robot][name])


def test_expectations_are_judged_on_a_record_of_the_kernel() -> None:
    scenario = load("paper", ["until_s=3.0"])
    signals = {expect.signal for expect in scenario.expect if expect.signal}
    (outcome,) = run([scenario], signals, Stop())
    for expect in scenario.expect:
        judged = judge(expect, outcome.record, scenario, outcome.events)
        assert judged["claim"]


def test_a_stop_ends_it_before_the_next_case() -> None:
    stop = Stop()
    stop.request("enough")
    assert run([load("paper", ["until_s=0.02"])], {"s"}, stop) == []


def test_a_scenario_that_is_not_covered_is_refused_by_name_and_reason() -> None:
    scenario = load("realistic")
    assert lacks(scenario)
    with pytest.raises(ValueError, match=r"realistic: the kernel has no "):
        run([scenario], {"s"}, Stop())


def test_a_case_off_the_ordinary_course_is_the_references_and_says_so() -> None:
    scenario = load("paper", ["until_s=0.2", "control.k4=400.0", "host.rearm=true"])
    (outcome,) = run([scenario], {"s"}, Stop())
    assert outcome.left_course == (
        "a robot that stopped itself may arm again (r1, tick 50 (t = 0.050 s))"
    )
    assert outcome.record.controller["r1"]["kappa_hat"].size  # it has all signals
    assert "r1" in outcome.stopped
    assert any(event.kind == "stopped" for event in outcome.events)
