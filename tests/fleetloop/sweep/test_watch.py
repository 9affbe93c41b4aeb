"""The bound on a case's wall time: asked first, then made to end."""

import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from fleetloop.sweep.watch import STUCK, OverdueError, Watch


def test_what_takes_too_long_is_asked_to_stop() -> None:
    with Watch(0.05) as watch:
        stop = watch.begin()
        deadline_s = time.monotonic() + 30.0
        while not stop.requested and time.monotonic() < deadline_s:
            pass
        assert watch.end()
        assert stop.reason == "took longer than limit_s = 0.05 s of wall time"


def test_cases_that_begin_together_have_the_time_of_all_of_them() -> None:
    with Watch(60.0) as watch:
        watch.begin(cases=3)
        assert watch._due_s - time.monotonic() > 120.0
        assert not watch.end()


def test_the_next_case_is_not_stopped_by_the_last_one() -> None:
    with Watch(0.02) as watch:
        stop = watch.begin()
        deadline_s = time.monotonic() + 30.0
        while not stop.requested and time.monotonic() < deadline_s:
            pass
        watch.end()
        watch.limit_s = 60.0
        assert not watch.begin().requested


def test_python_that_does_not_look_is_interrupted() -> None:
    with Watch(0.02, grace_s=0.02) as watch, pytest.raises(OverdueError):
        watch.begin()
        deadline_s = time.monotonic() + 30.0
        while time.monotonic() < deadline_s:
            pass


def test_so_is_python_that_keeps_all_exceptions_to_itself() -> None:
    with Watch(0.02, grace_s=0.02) as watch, pytest.raises(OverdueError):
        watch.begin()
        deadline_s = time.monotonic() + 30.0
        while time.monotonic() < deadline_s:
            with suppress(Exception, SystemExit):  # as a controller does with its law
                while time.monotonic() < deadline_s:
                    pass


def test_what_is_stuck_in_a_library_ends_its_process() -> None:
    stuck = (
        "import ctypes\n"
        "from fleetloop.sweep.watch import Watch\n"
        "with Watch(0.05, grace_s=0.05) as watch:\n"
        "    watch.begin()\n"
        "    ctypes.CDLL(None).usleep(900_000)\n"
    ).replace("usleep(900_000)", "sleep(100)")
    done = subprocess.run([sys.executable, "-c", stuck], timeout=60)
    assert done.returncode == STUCK


def test_it_leaves_no_descriptor_open() -> None:
    before = len([*Path("/proc/self/fd").iterdir()])
    for _ in range(20):
        with Watch(60.0) as watch:
            watch.begin().request("now")
            watch.begin()
            watch.end()
    assert len([*Path("/proc/self/fd").iterdir()]) == before
