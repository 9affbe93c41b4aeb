"""Compiled copies and sources: the same records."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from configs.compiled import PURE
from fleetloop.results.diff import print_comparison

pytestmark = pytest.mark.system
CHECKED = (
    ("two_robots", ()),
    ("realtime_100hz", ()),
    ("realistic", ()),
    ("lossy_chain", ()),
    ("paper", ("--set", "control={law='fixed_dsc', factor=0.9}")),
)
SHORT = ("--set", "expect=[]", "--duration", "1", "--allow-unchecked", "--no-report", "--json")


def fleetloop(*words: str, pure: bool) -> str:
    """What a command prints, with the sources or what is installed."""
    env = {key: value for key, value in os.environ.items() if key != PURE}
    done = subprocess.run(
        [sys.executable, "-m", "fleetloop", *words],
        env=env | ({PURE: "1"} if pure else {}),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def ran(folder: Path, *words: str, pure: bool) -> bool:
    """Run; whether it says that it ran compiled."""
    compiled: bool = json.loads(fleetloop("run", *words, *SHORT, "--out", str(folder), pure=pure))[
        "compiled"
    ]
    return compiled


@pytest.mark.parametrize("scenario", ["two_robots", "realistic", "lossy_chain"])
@pytest.mark.parametrize("how", ["processes", "in_process"])
def test_compiled_and_not_a_run_leaves_the_same_record(
    scenario: str, how: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = (scenario, *(("--in-process",) if how == "in_process" else ()))
    if not ran(tmp_path / "compiled", *words, pure=False):
        pytest.skip("this installation has no compiled copies of these sources")
    assert not ran(tmp_path / "pure", *words, pure=True)
    same = print_comparison(tmp_path / "compiled", tmp_path / "pure", as_json=False)
    assert same == 0, capsys.readouterr().out


@pytest.mark.parametrize(("scenario", "options"), CHECKED)
def test_compiled_and_not_a_check_finds_the_same(scenario: str, options: tuple[str, ...]) -> None:
    words = ("check", scenario, *options, "--json")
    assert fleetloop(*words, pure=False) == fleetloop(*words, pure=True)
