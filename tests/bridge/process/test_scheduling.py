"""Policies and turns, as the kernel's own table of a process has them."""

import os
import re
import subprocess
import sys

import pytest

from bridge.process.scheduling import TURN_NS

GO = """
import os, sys
from pathlib import Path
from bridge.process.scheduling import go_batch, go_by_short_turns
{act}
if os.fork() == 0:
    print(os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0))
    print(Path("/proc/self/sched").read_text())
    sys.stdout.flush()
    os._exit(0)
os.wait()
"""
KERNEL = tuple(int(n) for n in re.findall(r"\d+", os.uname().release)[:2])


def after(act: str) -> tuple[list[str], dict[str, str]]:
    """Policy and nice value of a child of a process that did something, and the kernel's table."""
    command = [sys.executable, "-c", GO.format(act=act)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=True)
    first, _, table = done.stdout.partition("\n")
    return first.split(), dict(re.findall(r"^(\S+)\s*:\s*(\S+)$", table, re.MULTILINE))


@pytest.mark.skipif(KERNEL < (6, 12), reason="turns of a process's own: Linux 6.12")
def test_short_turns_are_the_kernel_s_and_those_of_what_is_started_later() -> None:
    (policy, _), table = after("go_by_short_turns()")
    assert int(policy) == os.SCHED_OTHER
    if "se.slice" in table:
        assert int(table["se.slice"]) == TURN_NS


def test_where_turns_are_the_kernel_s_own_it_is_batch_work() -> None:
    act = "import bridge.process.scheduling as s; s._SET_ATTR = -1; go_by_short_turns()"
    (policy, _), _ = after(act)
    assert int(policy) == os.SCHED_BATCH


def test_a_nice_process_stays_nice() -> None:
    (_, nice), _ = after("os.nice(7); go_by_short_turns()")
    assert int(nice) == os.getpriority(os.PRIO_PROCESS, 0) + 7


def test_batch_work_is_of_its_policy() -> None:
    (policy, _), _ = after("go_batch()")
    assert int(policy) == os.SCHED_BATCH
