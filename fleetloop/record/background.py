"""A record written beside the work that fills it: compressing and writing take no time from a tick.

Blocks wait in a bounded queue; who is faster than the disk waits with them. What fails in the
background is raised by the next `add`, or by `close`.
"""

import threading
from queue import Queue
from types import TracebackType
from typing import Self

from fleetloop.record.writer import RecordWriter, Source

_MAX_BLOCKS = 256
_Block = tuple[str, Source, int, bytes]


class BackgroundWriter:
    """Feeds a `RecordWriter` from a thread of its own; a context manager that waits for it."""

    def __init__(self, writer: RecordWriter) -> None:
        self._writer = writer
        self._blocks: Queue[_Block | None] = Queue(_MAX_BLOCKS)
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._write, daemon=True)
        self._thread.start()

    def add(self, robot: str, source: Source, first_tick: int, rows: bytes) -> None:
        """As `RecordWriter.add`; what that raised earlier is raised here."""
        self._raise()
        self._blocks.put((robot, source, first_tick, rows))

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
        while (block := self._blocks.get()) is not None:
            if failed:
                continue
            try:
                self._writer.add(*block)
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
