"""Workers share the machine, but for tests of the wall clock, and end with their parent."""

import fcntl
import os
import select
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from support.workers import machine

HANGS = """
import os, signal, sys

def test_hangs():
    try:
        with open(os.environ["LOG"], "w") as fifo:
            fifo.write(f"{os.getpid()}\\n")
        signal.pause()
    finally:
        with open(os.environ["LOG"], "w") as fifo:
            fifo.write("cleaned up\\n")
"""


def workers(folder: Path, tests: str) -> "subprocess.Popen[str]":
    here = Path(__file__).parents[1]
    (folder / "test_it.py").write_text(tests)
    (folder / "conftest.py").write_text((here / "conftest.py").read_text("utf-8"))
    (folder / "pytest.ini").write_text("[pytest]\nmarkers = wall_clock\n")
    options = ("-q", "-n", "2", "--dist", "worksteal", "-p", "no:cacheprovider", str(folder))
    return subprocess.Popen(
        [sys.executable, "-m", "pytest", *options],
        env=os.environ | {"PYTHONPATH": str(here), "LOG": str(folder / "log")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,  # as a terminal's foreground: what it sends, all get
    )


def waits(folder: Path) -> bool:
    """Whether a test waits for the others' end."""
    with (folder / "turn").open("w") as turn:
        try:
            fcntl.flock(turn, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def test_a_test_of_the_wall_clock_has_the_machine_to_itself_and_is_the_next(tmp_path: Path) -> None:
    order: list[str] = []
    go_on = threading.Event()

    def alone() -> None:
        with machine(tmp_path, alone=True):
            order.append("alone")
            go_on.wait(30.0)
            order.append("over")

    def together() -> None:
        with machine(tmp_path, alone=False):
            order.append("together")

    tests = [threading.Thread(target=work) for work in (alone, together)]
    with machine(tmp_path, alone=False):
        with machine(tmp_path, alone=False):
            tests[0].start()
            while not waits(tmp_path):
                assert tests[0].is_alive()
            tests[1].start()
        assert order == []
    while not order:
        assert tests[0].is_alive()
    assert order == ["alone"]
    go_on.set()
    for test in tests:
        test.join(30.0)
    assert order == ["alone", "over", "together"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGABRT])
def test_no_worker_outlives_its_parent(tmp_path: Path, number: signal.Signals) -> None:
    os.mkfifo(tmp_path / "log")
    with workers(tmp_path, HANGS) as run:
        with (tmp_path / "log").open() as log:
            worker = os.pidfd_open(int(log.readline()))
        reader = os.open(tmp_path / "log", os.O_RDONLY | os.O_NONBLOCK)
        if number == signal.SIGINT:
            os.killpg(run.pid, number)  # Ctrl-C
        else:
            os.kill(run.pid, number)  # tests/support/within.sh
        said, _ = run.communicate(timeout=60)
        assert select.select([worker], [], [], 30.0)[0], "the worker is still there"
    if number == signal.SIGINT:
        assert run.returncode == pytest.ExitCode.INTERRUPTED
        assert os.read(reader, 100) == b"cleaned up\n"
    else:
        assert "most recent call first" in said  # parent and worker write it at the same time
    os.close(reader)
    os.close(worker)
