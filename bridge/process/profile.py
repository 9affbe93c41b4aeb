"""A profile of a process's processor time: samples of its main thread, by part of the code.

A timer that counts processor time interrupts the main thread every `SAMPLE_S`; the innermost frame
that belongs to one of the parts says what it was doing. What other threads use is Zenoh's: it
brings its own, and nobody else here does.
"""

import signal
from types import FrameType, TracebackType
from typing import Self

from bridge.process.clock import process_cpu_ns, thread_cpu_ns

SAMPLE_S = 0.002
PARTS = ("bus", "drives", "law", "plant", "Zenoh", "record", "other")
_PLACES = (
    ("/bridge/can_bus/", "bus"),
    ("/bridge/wire/", "bus"),
    ("/site-packages/can/", "bus"),
    ("/bridge/drives/", "drives"),
    ("/bridge/network/telemetry.py", "record"),
    ("/bridge/network/messages.py", "Zenoh"),
    ("/bridge/network/link.py", "Zenoh"),
    ("/bridge/network/zenoh_link.py", "Zenoh"),
    ("/msgpack/", "Zenoh"),
    ("/agents/lockstep.py", "bus"),
    ("/agents/", "law"),
    ("/plant/lockstep.py", "bus"),
    ("/plant/", "plant"),
)


class Sampler:
    """Samples while it is entered."""

    def __init__(self) -> None:
        self._counts = dict.fromkeys(PARTS, 0)
        self._process_ns = self._thread_ns = 0

    def _sample(self, _: int, frame: FrameType | None) -> None:
        while frame is not None:
            path = frame.f_code.co_filename
            for place, part in _PLACES:
                if place in path:
                    self._counts[part] += 1
                    return
            frame = frame.f_back
        self._counts["other"] += 1

    def nanoseconds(self) -> dict[str, int]:
        """Processor time by part, all threads, while it was entered."""
        total = sum(self._counts.values()) or 1
        parts = {name: self._thread_ns * n // total for name, n in self._counts.items()}
        parts["Zenoh"] += self._process_ns - self._thread_ns
        return parts

    def __enter__(self) -> Self:
        self._process_ns -= process_cpu_ns()
        self._thread_ns -= thread_cpu_ns()
        signal.signal(signal.SIGPROF, self._sample)
        signal.setitimer(signal.ITIMER_PROF, SAMPLE_S, SAMPLE_S)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        self._process_ns += process_cpu_ns()
        self._thread_ns += thread_cpu_ns()
