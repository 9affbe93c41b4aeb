"""The bound on a case's wall time, in the process that computes it.

after limit_s     the run is asked to stop; it looks at every tick
+ `GRACE_S`       an exception is raised in the thread that computes, as of a law that loops
+ `GRACE_S`       the process ends: what is stuck in a library can't be stopped otherwise
"""

import ctypes
import os
import threading
from typing import Self

from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import Stop

GRACE_S = 5.0
STUCK = 17
"""Exit status of a process that couldn't end a case otherwise."""


class OverdueError(BaseException):
    """Raised in a thread that computes a case for too long.

    No `Exception`: a controller would take that for its law's, and a law can keep one to itself.
    """


class Watch:
    """Bounds the wall time of the cases that one thread computes; a context manager.

    Args:
        limit_s: of one case.
        grace_s: between the steps above.
        clock: of this process.
    """

    def __init__(
        self, limit_s: float, *, grace_s: float = GRACE_S, clock: Clock = SYSTEM_CLOCK
    ) -> None:
        self.limit_s = limit_s
        self._grace_s = grace_s
        self._clock = clock
        self._thread_id = threading.get_ident()
        self._changed = threading.Condition()
        self._due_s: float | None = None
        self._step = 0
        self._closed = False
        self.stop = Stop()
        """Of the case that is computed now."""
        self._watcher = threading.Thread(target=self._watch, name="case limit", daemon=True)

    def __enter__(self) -> Self:
        self._watcher.start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._watcher.join()
        self._release()

    def begin(self, cases: int = 1) -> Stop:
        """So many cases begin together; what stops them."""
        with self._changed:
            if self.stop.requested:
                self._release()
                self.stop = Stop()
            self._due_s = self._clock.monotonic_s() + self.limit_s * cases
            self._step = 0
            self._changed.notify()
            return self.stop

    def end(self) -> bool:
        """They have ended; whether that was because they took too long."""
        with self._changed:
            self._due_s = None
            return self.stop.requested

    @property
    def reason(self) -> str:
        """Why a case has no result, if it took too long."""
        return f"took longer than limit_s = {self.limit_s:g} s of wall time"

    def _watch(self) -> None:
        with self._changed:
            while not self._closed:
                left_s = None
                if self._due_s is not None:
                    left_s = self._due_s - self._clock.monotonic_s()
                    if left_s <= 0.0:
                        self._press()
                        continue
                self._changed.wait(left_s)

    def _press(self) -> None:
        """The next step of those above."""
        self._due_s = self._clock.monotonic_s() + self._grace_s
        self._step += 1
        if self._step == 1:
            self.stop.request(self.reason)
        elif self._step == 2:
            thread = ctypes.c_ulong(self._thread_id)
            ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(OverdueError))
        else:
            os._exit(STUCK)

    def _release(self) -> None:
        os.close(self.stop.wake_fd)
        os.close(self.stop.release_fd)
