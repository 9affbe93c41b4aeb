"""Verdicts of the check against runs, on a few random scenarios; the benchmark has hundreds."""

from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def test_no_random_scenario_that_is_called_ok_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(BENCHMARKS)
    from check_verdicts import LEVELS, REFUSED, false_verdicts, verdict

    verdicts = [verdict(number) for number in range(8)]
    assert {one.level for one in verdicts} == {*LEVELS, REFUSED}
    assert not [one for one in false_verdicts(verdicts) if one.level == "ok"]


def test_a_scenario_is_the_same_whenever_it_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(BENCHMARKS)
    from check_verdicts import drawn

    assert drawn(7) == drawn(7) != drawn(8)
