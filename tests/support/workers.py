"""Test workers (pytest-xdist): tests of the wall clock run alone, no worker outlives its parent.

All other tests share the machine. A test of the wall clock waits until they have ended, and new
ones wait until it has: `turn` is held by the next test to begin, `room` by those that run.

A worker whose parent is gone, however it ended, is aborted: faulthandler then says where every
thread is, even if none runs Python any more. Ctrl-C interrupts a worker's test as it does without
workers, and leaves it `CLEAN_UP_S` to clean up, whether or not its parent waits.
"""

import ctypes
import faulthandler
import fcntl
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest

_PR_SET_PDEATHSIG = 1
CLEAN_UP_S = 30.0


def pytest_configure(config: pytest.Config) -> None:
    """In a worker, ask the kernel for the signal, and Python for the interrupt."""
    if not hasattr(config, "workerinput"):
        return
    _end_with_parent(signal.SIGABRT)
    signal.signal(signal.SIGINT, _interrupt)


def _end_with_parent(number: int) -> None:
    """Have the kernel send this signal when the parent ends; 0: none."""
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, number, 0, 0, 0)


def _interrupt(number: int, frame: FrameType | None) -> None:
    _end_with_parent(0)
    faulthandler.dump_traceback_later(CLEAN_UP_S, exit=True)
    signal.default_int_handler(number, frame)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put tests of the wall clock at the end, where one waits for another of them only."""
    items.sort(key=_alone)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Wait for the machine, outside the test's own time limit."""
    if not hasattr(item.config, "workerinput"):
        return (yield)
    shared = Path(item.config.option.basetemp).parent
    with machine(shared, alone=_alone(item)):
        return (yield)


@contextmanager
def machine(folder: Path, *, alone: bool) -> Iterator[None]:
    """Hold the machine, with others or alone; locks in `folder` are all processes' that name it."""
    with (folder / "turn").open("w") as turn, (folder / "room").open("w") as room:
        fcntl.flock(turn, fcntl.LOCK_EX)
        fcntl.flock(room, fcntl.LOCK_EX if alone else fcntl.LOCK_SH)
        fcntl.flock(turn, fcntl.LOCK_UN)
        yield


def _alone(item: pytest.Item) -> bool:
    return item.get_closest_marker("wall_clock") is not None
