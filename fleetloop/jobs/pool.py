"""Jobs in processes of their own, as many at a time as there are processors; none is left behind.

A process is in its own session, so that Ctrl-C reaches the caller alone, and ends itself when its
lifeline is cut, however the caller ends. One that tells nothing for `SILENCE_S`, as with a law
whose step never returns, is killed, and the others go on.
"""

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from multiprocessing.connection import Pipe, wait
from typing import Any

from bridge.network.messages import Progress
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import Status, Stop, pack_brief
from configs.errors import InfrastructureError
from fleetloop import packages
from fleetloop.jobs.job import Brief, Done, Job

SILENCE_S = 60.0
TERM_GRACE_S = 2.0
_LOOK_EVERY_S = 0.2


class Failed(str):
    """Why a job brought nothing."""

    __slots__ = ()


class _Worker:
    """A process and its job."""

    def __init__(self, number: int, job: Job, clock: Clock) -> None:
        self.number, self._clock = number, clock
        self.pipe, theirs = Pipe(duplex=False)
        try:
            with theirs:
                # -P: a folder here that is named like one of our packages must not shadow it.
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "fleetloop.jobs.worker"],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    pass_fds=[theirs.fileno()],
                    start_new_session=True,
                    env=packages.environment(),
                )
                fd = theirs.fileno()
        except OSError as error:
            self.pipe.close()
            raise InfrastructureError(f"can't start a run: {error.strerror}") from error
        if (lifeline := self._process.stdin) is not None:
            with contextlib.suppress(BrokenPipeError):
                lifeline.write(pack_brief(Brief(job, fd)))
                lifeline.flush()
        self.heard_s = clock.monotonic_s()

    def hear(self) -> Any:
        """What it says next; None at its end."""
        self.heard_s = self._clock.monotonic_s()
        try:
            return self.pipe.recv()
        except (EOFError, OSError):
            return None

    def reason(self) -> Failed:
        """Why it ended without a result."""
        try:
            out, _ = self._process.communicate(timeout=TERM_GRACE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            out, _ = self._process.communicate()
        code = self._process.returncode
        statuses = map(Status.from_line, out.splitlines(keepends=True))
        if status := next(filter(None, statuses), None):
            return Failed(status.error)
        if code < 0:
            return Failed(f"the run's process was killed by signal {-code}")
        return Failed(f"the run's process ended early (exit status {code})")

    def ask_to_stop(self) -> None:
        """Send SIGTERM, if it still runs."""
        self._process.terminate()

    def close(self, within_s: float) -> None:
        """Wait for its end so long, then kill; reap."""
        self.pipe.close()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        try:
            self._process.wait(max(within_s, 0.0))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0))


def work(
    jobs: Sequence[Job],
    stop: Stop,
    on_progress: Callable[[dict[int, Progress], dict[int, Any]], None] = lambda *_: None,
    on_told: Callable[[int, Any], None] = lambda *_: None,
    *,
    at_once: int | None = None,
    silence_s: float = SILENCE_S,
    grace_s: float = TERM_GRACE_S,
    clock: Clock = SYSTEM_CLOCK,
) -> dict[int, Any]:
    """Do jobs; by number, what each brought, or why it didn't (`Failed`).

    Args:
        jobs: in the order in which they are begun.
        stop: once requested, all processes are ended, and what was done is returned.
        on_progress: told a few times a second how far each job is, and what is done.
        on_told: told at once what else a job says, by its number.
        at_once: processes at a time; as many as there are processors if not given.
        silence_s: a process that tells nothing for so long is killed.
        grace_s: a process that was asked to stop has so long before it is killed.
        clock: of the caller.

    Raises:
        InfrastructureError: a process can't be started.
    """
    left = list(enumerate(jobs))
    most = at_once or processors()
    workers: dict[int, _Worker] = {}
    far: dict[int, Progress] = {}
    done: dict[int, Any] = {}
    try:
        while (left or workers) and not stop.requested:
            while left and len(workers) < most:
                number, job = left.pop(0)
                workers[number] = _Worker(number, job, clock)
            _hear(workers, far, done, on_told)
            for number, worker in list(workers.items()):
                if number not in done and clock.monotonic_s() - worker.heard_s > silence_s:
                    done[number] = Failed(f"stands still: nothing for {silence_s:g} s, ended")
                if number in done:
                    worker.close(0.0 if isinstance(done[number], Failed) else TERM_GRACE_S)
                    del workers[number]
            on_progress(far, done)
    finally:
        for worker in workers.values():
            worker.ask_to_stop()
        deadline_s = clock.monotonic_s() + grace_s
        for worker in workers.values():
            worker.close(deadline_s - clock.monotonic_s())
    return done


def _hear(
    workers: dict[int, _Worker],
    far: dict[int, Progress],
    done: dict[int, Any],
    on_told: Callable[[int, Any], None],
) -> None:
    """Take what processes say, waiting a moment for it."""
    speaking: dict[Any, _Worker] = {worker.pipe: worker for worker in workers.values()}
    for pipe in wait(list(speaking), _LOOK_EVERY_S):
        worker = speaking[pipe]
        match worker.hear():
            case None:
                done[worker.number] = worker.reason()
            case Done(result=result):
                done[worker.number] = result
            case Progress() as state:
                far[worker.number] = state
            case said:
                on_told(worker.number, said)
