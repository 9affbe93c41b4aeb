"""Findings as a table, on terminals that are wide and narrow."""

import pytest

from configs.loading import load
from fleetloop.check.finding import Finding
from fleetloop.check.table import print_findings

FINDINGS = [
    Finding("ok", "gain", "4", limit="≥ 4", basis="(45)"),
    Finding(
        "warning",
        "torque along the path",
        "0.4 N·m at 0.6 m/s",
        ("r1",),
        "drive.current_limit_A",
        limit="≤ 0.15 N·m, gear 1 × 0.05 N·m/A × 3 A",
        remedy="raise it [A], or go slower",
        basis="(4) inverse",
    ),
]


@pytest.mark.parametrize(("columns", "below"), [("200", False), ("70", True)])
def test_what_to_change_is_whole_however_narrow_the_terminal_is(
    columns: str,
    below: bool,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setenv("FORCE_COLOR", "1")  # a terminal, to rich
    monkeypatch.setenv("NO_COLOR", "1")
    print_findings(load("two_robots"), FINDINGS)
    out = capsys.readouterr().out
    assert ("to change" in out) is not below
    said = " ".join(out.split("torque along the path, r1:")[-1].split())
    assert "drive.current_limit_A: raise it [A], or go slower" in said
