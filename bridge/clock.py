"""One instant on the clocks of several machines.

Within a process everything is timed by its monotonic clock, which no two machines share. An instant
travels as the reading of the wall clock, which NTP or PTP keeps alike on all machines, and is
converted once, on arrival: what the wall clock does afterwards moves nothing.
"""

import time


def wall_of(monotonic_ns: int) -> int:
    """What the wall clock reads when this machine's monotonic clock reads `monotonic_ns`."""
    return monotonic_ns + time.time_ns() - time.monotonic_ns()


def monotonic_of(wall_ns: int) -> int:
    """What this machine's monotonic clock reads when the wall clock reads `wall_ns`."""
    return wall_ns + time.monotonic_ns() - time.time_ns()
