"""The kernel's word on a process: /proc/PID/stat (proc(5)), field 3 and those after it."""

from pathlib import Path
from typing import NamedTuple


class KernelStat(NamedTuple):
    """One process."""

    state: str  # R, S, D, T (stopped by a signal), t (by a debugger), Z, ...
    parent: int
    cpu_ticks: int  # user and system time of all threads, in units of sysconf(SC_CLK_TCK)


def kernel_stat(pid: int, proc: Path = Path("/proc")) -> KernelStat | None:
    """What the kernel says of a process; None if it isn't there."""
    try:
        text = (proc / str(pid) / "stat").read_text("ascii", "replace")
        # The second field, the name in brackets, may have anything in it.
        state, parent, *more = text.rpartition(")")[2].split()
        return KernelStat(state, int(parent), int(more[9]) + int(more[10]))
    except (OSError, ValueError, IndexError):
        return None
