"""One instant on the clocks of several machines.

Within a process everything is timed by its monotonic clock, which no two machines share. An instant
travels as the reading of the wall clock, which NTP or PTP keeps alike on all machines, and is
converted once, on arrival: what the wall clock does afterwards moves nothing.
"""

import time


def wall_of(monotonic_ns: int) -> int:
    """What the wall clock reads when this machine's monotonic clock reads `monotonic_ns`."""
    return monotonic_ns + time.time_ns() - time.monotonic_ns()


def implausible_start(epoch_ns: int, within_s: float) -> str | None:
    """Why a run doesn't begin at this monotonic instant, None if it may.

    Args:
        epoch_ns: tick 0 by this machine's monotonic clock.
        within_s: farther from now than this nobody would wait for.
    """
    away_s = (epoch_ns - time.monotonic_ns()) * 1e-9
    if abs(away_s) <= within_s:
        return None
    direction = "from now" if away_s > 0 else "ago"
    return f"tick 0 would be {abs(away_s):.6g} s {direction}: the machines' clocks differ"


def monotonic_of(wall_ns: int) -> int:
    """What this machine's monotonic clock reads when the wall clock reads `wall_ns`."""
    return wall_ns + time.monotonic_ns() - time.time_ns()
