"""Somebody else's program, run to its end or to a deadline, so that nothing of it is left.

    benchmark ──pipe──► guard ──► program ──► whatever it starts

The guard ends everything below it when the program has ended, when the time is over, and when the
benchmark is gone, however that ended: its end of the pipe closes. Orphans come to the guard, a
daemon in a session of its own too. The program works in a temporary folder, which goes with it.
Linux only.
"""

import ctypes
import os
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

_PR_SET_CHILD_SUBREAPER = 36
_CLEARING_S = 10.0


def output_of(command: Sequence[str], limit_s: float) -> str:
    """What the program wrote to standard output; if it failed, the benchmark ends with why."""
    guard_end, our_end = os.pipe()
    guard = subprocess.Popen(
        [sys.executable, __file__, str(limit_s), *command],
        stdin=guard_end,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    os.close(guard_end)
    try:
        out, errors = guard.communicate(timeout=limit_s + _CLEARING_S)
    finally:
        os.close(our_end)
        guard.wait(_CLEARING_S)
    if guard.returncode:
        sys.exit(f"{' '.join(command)} ended with {guard.returncode}:\n{errors}{out}")
    return out


def _guard(limit_s: float, command: Sequence[str]) -> str | int:
    """Run it; return its exit status, or why there is none."""
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("told to stop"))
    with tempfile.TemporaryDirectory(prefix="benchmark-") as folder:
        try:
            program = subprocess.Popen(
                command,
                cwd=folder,
                env=os.environ | {"TMPDIR": folder},
                stdin=subprocess.DEVNULL,
                start_new_session=True,
            )
            ended = os.pidfd_open(program.pid)
            if not select.select([sys.stdin, ended], [], [], limit_s)[0]:
                return f"not over within {limit_s:g} s"
            status = program.poll()
            return "the benchmark is gone" if status is None else status
        finally:
            _end_children()


def _end_children() -> None:
    """Until there are none: the children of each that ends become ours."""
    while True:
        for pid in _children():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        try:
            os.wait()
        except ChildProcessError:
            return


def _children() -> list[int]:
    found = []
    for process in Path("/proc").iterdir():
        if process.name.isdigit():
            with suppress(OSError):
                fields = (process / "stat").read_text().rpartition(")")[2].split()
                if int(fields[1]) == os.getpid():
                    found.append(int(process.name))
    return found


if __name__ == "__main__":
    sys.exit(_guard(float(sys.argv[1]), sys.argv[2:]))
