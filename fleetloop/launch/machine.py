"""Stalls of the machine during a run, as the launcher sees them: its only work is to wait.

A stall is a wait that lasted `bridge.process.awake.STALL_S` longer than asked for: the machine
stood still or was starved of processor time, or the launcher was stopped (Ctrl-Z) and continued
(`fg`). What other processes owed in that time isn't held against them.
"""

import os
import signal
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any, Self

from bridge.process.awake import AwakeClock
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import processor_wait_ns

WATCH_EVERY_S = 0.05
"""The launcher's longest wait between two looks."""


class MachineWatch:
    """Keeps the launcher's clock of awake time; a context manager, as it listens to SIGCONT.

    Args:
        scenario_s: how far the run is [s].
        on_stall: told of each stall, in words.
        clock: the machine's.
    """

    def __init__(
        self,
        scenario_s: Callable[[], float],
        on_stall: Callable[[str], None],
        *,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._clock = clock
        self._scenario_s = scenario_s
        self._tell = on_stall
        self.clock = AwakeClock(look_s=WATCH_EVERY_S, on_stall=self._note, clock=clock)
        self._count = self._stops = self._continued = 0
        self._total_s = self._longest_s = self._longest_at_s = 0.0
        self._last = ""
        self._last_s = 0.0
        self._waited_ns = processor_wait_ns()

    def lately(self, within_s: float) -> str:
        """The last stall in words, "" if it ended longer ago than that."""
        return self._last if self._clock.monotonic_s() - self._last_s <= within_s else ""

    def report(self) -> dict[str, Any]:
        """For the summary."""
        found: dict[str, Any] = {
            "stalls": self._count,
            "stalled_s": round(self._total_s, 3),
            "longest_stall_s": round(self._longest_s, 3),
            "longest_stall_at_s": round(self._longest_at_s, 3),
            "stopped_and_continued": self._stops,
            "longest_late_s": round(self.clock.longest_late_s, 4),
            "processor_wait_s": round((processor_wait_ns() - self._waited_ns) * 1e-9, 3),
            "load_average": round(os.getloadavg()[0], 2),
            "cores": len(os.sched_getaffinity(0)),
        }
        return found

    def _note(self, lasted_s: float) -> None:
        at_s = self._scenario_s()
        self._count += 1
        self._total_s += lasted_s
        if lasted_s > self._longest_s:
            self._longest_s, self._longest_at_s = lasted_s, at_s
        self._last = f"the machine stalled for {lasted_s:.2f} s at t = {at_s:.2f} s"
        if self._continued:
            self._stops, self._continued = self._stops + 1, 0
            self._last = f"stopped for {lasted_s:.2f} s at t = {at_s:.2f} s (Ctrl-Z), and continued"
        self._last_s = self._clock.monotonic_s()
        self._tell(self._last)

    def _on_continue(self, _number: int, _frame: FrameType | None) -> None:
        self._continued += 1

    def __enter__(self) -> Self:
        self._before = signal.signal(signal.SIGCONT, self._on_continue)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        signal.signal(signal.SIGCONT, self._before)
