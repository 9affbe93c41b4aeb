"""How the kernel schedules a process: in real time, in short turns, or as batch work.

Processes in lockstep wake each other several times a tick and compute for some tens of
microseconds. On processors that they share with a program that computes for long, each of these
wake-ups would wait for the end of its turn, of 3 ms; and if they interrupted each other, each would
throw the other out of the caches.
"""

import ctypes
import os
import platform
import struct
from contextlib import suppress
from pathlib import Path
from typing import Final

TURN_NS: Final = 300_000
"""Longer than what a process computes at once, shorter than the kernel's turns of 1 to 3 ms."""
_MCL_CURRENT, _MCL_FUTURE = 1, 2
_SET_ATTR, _GET_ATTR = {"x86_64": (314, 315), "aarch64": (274, 275), "riscv64": (274, 275)}.get(
    platform.machine(), (-1, -1)
)
"""Numbers of the system calls sched_setattr and sched_getattr, which have no name in Python."""
_ATTRIBUTES: Final = struct.Struct("=IIQiIQQQII")
"""struct sched_attr: size, policy, flags, nice, priority, runtime, deadline, period, clamps."""


def go_realtime(priority: int) -> list[str]:
    """Ask the kernel for what real time needs; return the privileges that are missing, by name.

    Call before saying to be ready: locking memory reads all that is mapped, for seconds where it
    comes from a slow disk.

    On a single processor a loop that is late would keep it from the network's own threads, so
    there it shares.
    """
    missing = []
    try:
        if len(os.sched_getaffinity(0)) > 1:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        else:
            missing.append("SCHED_FIFO (a single processor)")
    except OSError:
        missing.append("SCHED_FIFO")
    if ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
        missing.append("memory locking")
    with suppress(OSError):
        Path("/proc/self/timerslack_ns").write_text("1", "ascii")
    return missing


def go_by_short_turns() -> None:
    """Take turns of `TURN_NS` from now on, as does all that this process starts.

    Woken, it gets the processor at once from one whose turns are longer, but not from its like,
    and of the processor it gets no more than before. Where the kernel has only turns of its own
    (Linux before 6.12), this process is batch work.
    """
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    size = _ATTRIBUTES.size
    asked = _ATTRIBUTES.pack(size, os.SCHED_OTHER, 0, nice, 0, TURN_NS, 0, 0, 0, 0)
    granted = ctypes.create_string_buffer(size)
    call = ctypes.CDLL(None, use_errno=True).syscall
    if (
        call(_SET_ATTR, 0, asked, 0) != 0
        or call(_GET_ATTR, 0, granted, size, 0) != 0
        or _ATTRIBUTES.unpack(granted.raw)[5] != TURN_NS  # an older kernel has 0
    ):
        go_batch()


def go_batch(pid: int = 0) -> None:
    """Make a process batch work: one that is woken waits for its turn and interrupts none."""
    os.sched_setscheduler(pid, os.SCHED_BATCH, os.sched_param(0))
