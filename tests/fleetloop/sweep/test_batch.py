"""Rows of cases: which engine, and that one bad case touches no other."""

from collections.abc import Sequence

import pytest
from support.studies import FEW, MASS, SHORT, P, cases_of

from bridge.process.lifecycle import Stop
from configs.scenario import Scenario
from fleetloop.in_process.whole import run_in_memory
from fleetloop.sweep.batch import KERNEL, NO_KERNEL, REFERENCE, Kernel, rows_of
from fleetloop.sweep.watch import Watch

GRID = SHORT + 'design = "grid"\n'


def test_rows_come_in_the_order_asked_for_and_say_which_engine_and_why() -> None:
    rows = rows_of(cases_of(GRID + P + FEW), [2, 0], Watch(300.0))
    assert [row.case for row in rows] == [2, 0]
    assert {(row.engine, row.engine_reason) for row in rows} == {(REFERENCE, NO_KERNEL)}
    assert [row.factors["p"] for row in rows] == [2.0, 0.5]
    assert all(row.wall_s > 0.0 for row in rows)


def test_an_invalid_case_is_a_row_and_the_others_go_on() -> None:
    cases = cases_of(GRID + P.replace("1.0, 2.0]", "-1.0, 2.0]") + FEW)
    rows = rows_of(cases, range(3), Watch(300.0))
    assert [row.verdict for row in rows] == ["held", "invalid", "held"]
    assert rows[1].reason.startswith("case 1: p = -1.0: must be")
    assert "coordination.p=-1.0" in rows[1].command


def test_a_law_that_fails_is_the_failure_of_its_case_alone(tmp_path, monkeypatch) -> None:
    (tmp_path / "brittle.py").write_text(BRITTLE, "utf-8")
    monkeypatch.chdir(tmp_path)
    law = '[[factor]]\nkey = "control.law"\nvalues = ["adaptive_dsc", "brittle:Brittle"]\n'
    rows = rows_of(cases_of(GRID + law + FEW), [0, 1], Watch(300.0))
    assert [row.verdict for row in rows] == ["held", "failed"]
    assert "no such step" in rows[1].reason


def test_a_run_that_breaks_down_is_an_error_of_its_case_alone() -> None:
    def brittle(scenarios: Sequence[Scenario], signals: object, stop: Stop):
        runs = reference(scenarios, signals, stop)
        return [run._replace(record=None) if n == 1 else run for n, run in enumerate(runs)]

    rows = rows_of(cases_of(GRID + P), range(3), Watch(300.0), Kernel(lambda _: "", brittle))
    assert [row.verdict for row in rows] == ["held", "error", "held"]
    assert rows[1].reason.startswith("its run can't be judged: AttributeError: ")


BRITTLE = '''
from agents.laws.adaptive_dsc import AdaptiveDsc


class Brittle(AdaptiveDsc):
    """Fails in its first step."""

    def step(self, *args, **kwargs):
        raise ZeroDivisionError("no such step")
'''


def reference(scenarios: Sequence[Scenario], _signals: object, stop: Stop):
    return [run_in_memory(scenario, stop) for scenario in scenarios]


def test_the_engine_is_chosen_for_each_case() -> None:
    def lacks(scenario: Scenario) -> str:
        return "a p of 1" if scenario.coordination.p == 1.0 else ""

    cases = cases_of(GRID + P + FEW)
    rows = rows_of(cases, range(3), Watch(300.0), Kernel(lacks, reference))
    chosen = [(row.engine, row.engine_reason) for row in rows]
    assert chosen == [(KERNEL, ""), (REFERENCE, "a p of 1"), (KERNEL, "")]
    plain = rows_of(cases, range(3), Watch(300.0))
    assert [row.values for row in rows] == [row.values for row in plain]


def test_a_case_that_makes_the_kernel_fail_is_the_references_and_no_other() -> None:
    def broken(scenarios: Sequence[Scenario], signals: object, stop: Stop):
        if any(scenario.coordination.p == 1.0 for scenario in scenarios):
            raise FloatingPointError("overflow")
        return reference(scenarios, signals, stop)

    kernel = Kernel(lambda _: "", broken)
    rows = rows_of(cases_of(GRID + P + FEW), range(3), Watch(300.0), kernel)
    assert [row.verdict for row in rows] == ["held"] * 3
    assert [row.engine for row in rows] == [KERNEL, REFERENCE, KERNEL]
    assert rows[1].engine_reason.startswith("the kernel failed: FloatingPointError: overflow")


def test_a_case_that_the_kernel_hands_on_says_why() -> None:
    def handing(scenarios: Sequence[Scenario], signals: object, stop: Stop):
        runs = reference(scenarios, signals, stop)
        return [run._replace(left_course="a robot stopped") for run in runs]

    kernel = Kernel(lambda _: "", handing)
    rows = rows_of(cases_of(GRID + P + FEW), [0], Watch(300.0), kernel)
    assert (rows[0].engine, rows[0].engine_reason) == (REFERENCE, "a robot stopped")


def test_a_case_that_takes_too_long_is_an_error_and_the_next_one_has_its_own_time() -> None:
    text = GRID.replace("until_s=0.1", "clock.plant_step_s=0.002") + "limit_s = 0.2\n"
    lengths = '[[factor]]\nname = "length"\nkey = "until_s"\nvalues = [1e4, 0.1]\n'
    cases = cases_of(text + lengths + FEW)
    with Watch(cases.study.limit_s) as watch:
        rows = rows_of(cases, range(2), watch)
    assert [row.verdict for row in rows] == ["error", "held"]
    assert rows[0].reason == "took longer than limit_s = 0.2 s of wall time"
    assert rows[0].wall_s < 5.0


@pytest.mark.parametrize("number", [0, 5])
def test_a_case_is_the_same_alone_and_among_others(number: int) -> None:
    cases = cases_of(SHORT + 'design = "sobol"\ncases = 6\n' + MASS)
    (alone,) = rows_of(cases, [number], Watch(300.0))
    among = rows_of(cases, range(6), Watch(300.0))[number]
    assert (alone.values, alone.command, alone.seed) == (among.values, among.command, among.seed)
