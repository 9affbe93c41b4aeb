"""Tests of the wall clock are tried again on a machine that stalls, and on no other."""

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support.wall_clock import stalled, why_again

QUIET = {
    "wall_s": 4.0,
    "startup_s": 0.5,
    "teardown_s": 0.1,
    "waits_s": {"plant": {"waited": 3.0, "processor": 0.01}},
    "machine": {"stalls": 0, "longest_late_s": 0.002, "processor_wait_s": 0.0},
}


@pytest.mark.parametrize(
    ("machine", "processor_s", "why"),
    [
        ({}, 0.01, ""),
        ({"stalls": 2, "longest_stall_s": 0.8}, 0.01, "the machine stalled for 0.80 s"),
        ({"longest_late_s": 0.21}, 0.01, "the launcher woke up 0.210 s late"),
        ({}, 2.0, "plant waited 2.00 s of 4.60 s for a processor"),
    ],
)
def test_a_run_tells_whether_its_machine_stalled(
    machine: dict[str, float], processor_s: float, why: str, tmp_path: Path
) -> None:
    summary = QUIET | {"machine": QUIET["machine"] | machine}
    summary |= {"waits_s": {"plant": {"waited": 3.0, "processor": processor_s}}}
    assert stalled(summary) == why
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    assert why_again(tmp_path) == why


def test_a_controller_that_stalled_is_an_excuse_and_one_that_was_stopped_is_none() -> None:
    stopped = {"r1": "tick 900 (t = 4.500 s): left drive dropped out: WATCHDOG_TIMER_EXPIRED"}
    assert stalled(QUIET | {"stopped_robots": stopped}) == ""
    stopped["r1"] += "; this controller, or its machine, stalled for 0.79 s"
    assert stalled(QUIET | {"stopped_robots": stopped}) == "a controller stalled"


TESTS = """
import json
import pytest

def leave(folder, stalls):
    quiet = {quiet!r}
    quiet["machine"] |= dict(stalls=stalls, longest_stall_s=1.0)
    (folder / "summary.json").write_text(json.dumps(quiet))

tries = []

@pytest.mark.wall_clock
def test_stalls_once(tmp_path):
    tries.append(1)
    assert not list(tmp_path.iterdir())
    leave(tmp_path, stalls=len(tries) == 1)
    assert len(tries) == 2

@pytest.mark.wall_clock
def test_has_no_excuse(tmp_path):
    leave(tmp_path, stalls=0)
    assert False

once = []

@pytest.mark.system
def test_of_processes_on_a_machine_that_stood_still(tmp_path):
    once.append(1)
    leave(tmp_path, stalls=len(once) == 1)
    assert len(once) == 2

@pytest.mark.system
def test_of_processes_has_no_excuse(tmp_path):
    leave(tmp_path, stalls=0)
    assert False

def test_signals_are_as_ever():
    import signal, subprocess, sys
    code = "import signal; print(signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGHUP))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "default_int_handler" in done.stdout
    assert done.stdout.split()[-1] == str(int(signal.SIG_DFL))
"""


def test_a_stall_is_an_excuse_and_children_get_the_default_signals_back(tmp_path: Path) -> None:
    here = Path(__file__).parents[1]
    (tmp_path / "test_it.py").write_text(TESTS.replace("{quiet!r}", repr(QUIET)))
    (tmp_path / "conftest.py").write_text((here / "conftest.py").read_text("utf-8"))
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n wall_clock\n system\n")

    def ignore() -> None:
        for number in (signal.SIGINT, signal.SIGHUP):  # as in the background of a script
            signal.signal(number, signal.SIG_IGN)

    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path)],
        env=os.environ | {"PYTHONPATH": str(here)},
        capture_output=True,
        text=True,
        timeout=60,
        preexec_fn=ignore,
    )
    assert "2 failed, 3 passed" in done.stdout, done.stdout + done.stderr
    assert "TRIED AGAIN test_it.py::test_stalls_once: the machine stalled for 1.00 s" in done.stdout
    assert "TRIED AGAIN test_it.py::test_of_processes_on_a_machine" in done.stdout
    for test in ("test_has_no_excuse", "test_of_processes_has_no_excuse"):
        assert re.search(rf"FAILED \S*test_it\.py::{test}", done.stdout)
