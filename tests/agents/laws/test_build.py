"""A law of the user's own in its controller: what it raises and records, as it is told."""

from math import isnan
from pathlib import Path

import pytest
from support.robot_bench import Bench

from agents.guard import Phase
from configs.sections import LAW

TEXT = """
from dataclasses import dataclass
from agents.laws.interface import Law, LawOutput, Parameters, Signal

class Own(Law):
    @dataclass(frozen=True, slots=True, kw_only=True)
    class Gains(Parameters):
        pass

    SIGNALS = (Signal("count", "1", "of ticks"), Signal("odd", "1", ""))

    def __init__(self, gains, wheels, period_s, path):
        pass

    def step(self, state, motion, reference, along):
        count = 0 if state is None else state
        odd = 0.0
        {}
        return LawOutput(0.0, 0.0, count + 1, (count, odd))
"""
WHEN = "tick 5 (t = 0.010 s)"


def bench(folder: Path, line: str) -> Bench:
    """A controller under a law with this line in its step; it has driven 20 ticks."""
    (folder / "own_law.py").write_text(TEXT.format(line))
    made = Bench("r2", law=LAW.choose({"law": "own_law:Own"}, str(folder)))
    made.run(made.schedule.countdown_ticks + 20)
    return made


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("if count == 5: raise ValueError('no such gear')", "ValueError: no such gear"),
        ("if count == 5: raise RuntimeError", "RuntimeError"),
        ("odd = 1.0 / (count - 5)", "ZeroDivisionError: float division by zero"),
        ("odd = (1e300 * (count == 5)) ** 2.0", "OverflowError"),
        ("if count == 5: raise SystemExit(3)", "SystemExit: 3"),
    ],
)
def test_an_exception_of_a_law_is_reported_as_it_is(tmp_path: Path, line: str, error: str) -> None:
    stopped = bench(tmp_path, line)
    assert stopped.phase is Phase.STOPPED
    place = f"{tmp_path / 'own_law.py'}, line 18: "
    assert stopped.why.startswith(f"{WHEN}: law own_law:Own failed at s = ")
    assert f" m: {place}{error}" in stopped.why
    assert "diverged" not in stopped.why


@pytest.mark.parametrize(("value", "told"), [("nan", "nan"), ("-inf", "-inf")])
def test_a_signal_that_is_not_finite_is_told_once_and_recorded(
    tmp_path: Path, value: str, told: str
) -> None:
    driving = bench(tmp_path, f"odd = float('{value}') if count >= 5 else 0.0")
    assert driving.phase is Phase.DRIVING
    (said,) = (it for it in driving.agent.guard.events if it.kind == "law")
    assert said.text == f"law own_law:Own: recorded as not finite: odd = {told}"
    driving.agent.rows.finish()
    odd = [row[18] for row in driving.rows]  # behind 14 of the controller and (8), count
    assert odd[:5] == [0.0] * 5
    assert all(isnan(v) or v < 0.0 for v in odd[5:])


def test_signals_that_are_finite_give_no_notice(tmp_path: Path) -> None:
    events = bench(tmp_path, "odd = 1.0").agent.guard.events
    assert {event.kind for event in events} <= {"armed"}
