"""A record written by a thread of its own: compression and disk take no time from a tick.

Blocks wait in a bounded queue; a source faster than the disk waits with them. What fails in the
background is raised by the next `add`, or by `close`.
"""

import threading
from collections.abc import Callable
from functools import partial
from queue import Queue
from types import TracebackType
from typing import Self

from bridge.process.clock import SYSTEM_CLOCK, Clock
from fleetloop.record.run_record import RunRecord
from fleetloop.record.writer import Source

LOOK_EVERY_S = 0.25
_MAX_BLOCKS = 256


class BackgroundWriter:
    """Feeds a `RunRecord` from a thread of its own; a context manager that waits for it."""

    def __init__(self, record: RunRecord, *, clock: Clock = SYSTEM_CLOCK) -> None:
        self._record, self._clock = record, clock
        self._blocks: Queue[Callable[[], None] | None] = Queue(_MAX_BLOCKS)
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._write, daemon=True)
        self._thread.start()

    def add(self, robot: str, source: Source, first_tick: int, rows: bytes) -> None:
        """As `RunRecord.add`; what failed earlier is raised here."""
        self._raise()
        self._blocks.put(partial(self._record.add, robot, source, first_tick, rows))

    def end(self, robot: str, source: Source) -> None:
        """As `RunRecord.end`; what failed earlier is raised here."""
        self._raise()
        self._blocks.put(partial(self._record.end, robot, source))

    def traffic(self, bus: str, frames: bytes) -> None:
        """As `RunRecord.traffic`; what failed earlier is raised here."""
        self._raise()
        self._blocks.put(partial(self._record.traffic, bus, frames))

    def inputs(self, robot: str, first: int, block: bytes, final: bool) -> None:
        """As `RunRecord.inputs`; what failed earlier is raised here."""
        self._raise()
        self._blocks.put(partial(self._record.inputs, robot, first, block, final))

    def close(self) -> None:
        """Wait until everything is written."""
        self._blocks.put(None)
        self._thread.join()
        self._raise()

    def _raise(self) -> None:
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure

    def _write(self) -> None:
        failed = False
        look_s = 0.0
        while (write := self._blocks.get()) is not None:
            if failed:
                continue
            try:
                write()
                if (now_s := self._clock.monotonic_s()) >= look_s:
                    look_s = now_s + LOOK_EVERY_S
                    self._record.check_place()
            except Exception as error:  # raised in the thread that fills
                self._failure = error
                failed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if value is None:
            self.close()
        else:
            self._blocks.put(None)
            self._thread.join()
