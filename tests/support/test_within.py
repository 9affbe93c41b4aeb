"""The bound of the test run: kept from outside, whatever hangs inside."""

import subprocess
import sys
from pathlib import Path

WITHIN = Path(__file__).parent / "within.sh"
HANGS = """
import ctypes, faulthandler
faulthandler.enable()
print("begun", flush=True)
ctypes.PyDLL(None).sleep(60)  # with the GIL held: no signal handler and no thread of Python runs
"""


def within(bound: str, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([WITHIN, bound, *command], capture_output=True, text=True, timeout=30)


def test_a_program_that_holds_the_interpreter_for_ever_ends_red_with_its_stacks() -> None:
    done = within("2s", sys.executable, "-c", HANGS)
    assert done.returncode in (124, 137)
    assert done.stdout == "begun\n"
    assert "most recent call first" in done.stderr
    assert "HANGS: not done after 2s, killed: " in done.stderr


def test_a_program_that_ends_in_time_keeps_its_exit_status_and_its_words() -> None:
    done = within("20s", sys.executable, "-c", "print('done'); raise SystemExit(3)")
    assert (done.returncode, done.stdout, done.stderr) == (3, "done\n", "")
