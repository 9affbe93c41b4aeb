"""Clocks: the only module that reads one.

Loops are given a `Clock`, so that tests hand in one that they set; everything else is told the
time. Within a process everything is timed by its monotonic clock, which no two machines share. An
instant travels as the reading of the wall clock, which NTP or PTP keeps alike on all machines, and
is converted once, on arrival: what the wall clock does afterwards moves nothing.
"""

import time
from datetime import datetime
from typing import Protocol


class Clock(Protocol):
    """What tells the time, and lets it pass."""

    def monotonic_ns(self) -> int:
        """Time since some instant [ns]; never goes back."""

    def monotonic_s(self) -> float:
        """The same clock [s]."""

    def wall_ns(self) -> int:
        """Time since 1970-01-01 UTC [ns]; may be set."""

    def sleep(self, seconds: float) -> None:
        """Return after so long [s]; 0 lets other threads run."""


class SystemClock:
    """This machine's."""

    __slots__ = ()
    monotonic_ns = staticmethod(time.monotonic_ns)
    monotonic_s = staticmethod(time.monotonic)
    wall_ns = staticmethod(time.time_ns)
    sleep = staticmethod(time.sleep)


SYSTEM_CLOCK: Clock = SystemClock()


def local_date(wall_ns: int) -> datetime:
    """A reading of the wall clock [ns] as a date in this machine's time zone."""
    return datetime.fromtimestamp(wall_ns // 1_000_000_000).astimezone()


def process_cpu_ns() -> int:
    """Processor time of this process so far, all threads [ns]."""
    return time.process_time_ns()


def thread_cpu_ns() -> int:
    """Processor time of the calling thread so far [ns]."""
    return time.thread_time_ns()


def wall_of(monotonic_ns: int, clock: Clock = SYSTEM_CLOCK) -> int:
    """What the wall clock reads when this machine's monotonic clock reads `monotonic_ns`."""
    return monotonic_ns + clock.wall_ns() - clock.monotonic_ns()


def monotonic_of(wall_ns: int, clock: Clock = SYSTEM_CLOCK) -> int:
    """What this machine's monotonic clock reads when the wall clock reads `wall_ns`."""
    return wall_ns + clock.monotonic_ns() - clock.wall_ns()


def implausible_start(epoch_ns: int, within_s: float, clock: Clock = SYSTEM_CLOCK) -> str | None:
    """Why a run doesn't begin at this monotonic instant, None if it may.

    Args:
        epoch_ns: tick 0 by this machine's monotonic clock.
        within_s: an instant farther from now than this can't be meant.
        clock: this machine's.
    """
    away_s = (epoch_ns - clock.monotonic_ns()) * 1e-9
    if abs(away_s) <= within_s:
        return None
    direction = "from now" if away_s > 0 else "ago"
    return f"tick 0 would be {abs(away_s):.6g} s {direction}: the machines' clocks differ"
