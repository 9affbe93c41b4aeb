"""Children of a job's process, forked from it, each for one cell.

A child that crashes, or takes longer than its limit, is a result of its cell. The only other thread
of a job's process sits in a read and holds nothing that a child needs.
"""

import os
import pickle
import signal
import traceback
from collections.abc import Callable
from dataclasses import replace
from select import select

from bridge.network.messages import Progress
from bridge.process.lifecycle import Stop
from configs.errors import FleetloopError
from fleetloop.campaign.matrix import Cell
from fleetloop.campaign.verdicts import Result, Verdict
from fleetloop.jobs.job import Tell

_LOOK_EVERY_S = 0.5
_LINES_OF_A_BUG = 12


class Children:
    """Processes that were forked; what they bring is told."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._open: dict[int, tuple[int, Cell, bytearray]] = {}  # by descriptor

    def start(self, cell: Cell, body: Callable[[], Result], limit_s: float) -> None:
        """Fork; the child's `body` brings the result, or the alarm ends it."""
        ours, theirs = os.pipe()
        pid = os.fork()
        if pid:
            os.close(theirs)
            self._open[ours] = (pid, cell, bytearray())
            return
        try:
            for number in (signal.SIGTERM, signal.SIGALRM):
                signal.signal(number, signal.SIG_DFL)
            signal.setitimer(signal.ITIMER_REAL, limit_s)
            with os.fdopen(theirs, "wb") as pipe:
                pickle.dump(_result(cell, body), pipe)
        finally:
            os._exit(0)

    def gather(self, stop: Stop, *, most: int) -> None:
        """Wait until at most so many are left; if told to stop, end them all."""
        while len(self._open) > most and not stop.requested:
            for ours in select(list(self._open), [], [], _LOOK_EVERY_S)[0]:
                self._read(ours)
            self._tell(Progress(0, 0, 0))  # this process lives
        if stop.requested:
            self._end()

    def _end(self) -> None:
        for pid, *_ in self._open.values():
            os.kill(pid, signal.SIGTERM)
        for ours, (pid, *_) in self._open.items():
            os.close(ours)
            os.waitpid(pid, 0)
        self._open.clear()

    def _read(self, ours: int) -> None:
        pid, cell, data = self._open[ours]
        if part := os.read(ours, 1 << 16):
            data += part
            return
        os.close(ours)
        del self._open[ours]
        _, status = os.waitpid(pid, 0)
        try:
            self._tell(pickle.loads(data))
        except (EOFError, pickle.UnpicklingError):
            self._tell(Result(cell, Verdict.ERROR, _why(status)))


def _result(cell: Cell, body: Callable[[], Result]) -> Result:
    """What a cell brings; an exception, a law's perhaps, is a result too."""
    try:
        return body()
    except FleetloopError as error:
        return Result(cell, Verdict.ERROR, str(error))
    except Exception:
        lines = traceback.format_exc().strip().splitlines()
        failed = Result(cell, Verdict.ERROR, f"a bug: {lines[-1]}")
        return replace(failed, notices=tuple(lines[-_LINES_OF_A_BUG:]))


def _why(status: int) -> str:
    """Why a child brought nothing."""
    code = os.waitstatus_to_exitcode(status)
    if code == -signal.SIGALRM:
        return "took longer than its limit (--limit)"
    if code < 0:
        return f"its process was killed by signal {-code}"
    return f"its process ended early (exit status {code})"
