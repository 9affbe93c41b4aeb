"""Cases on Dask workers: chunks out, rows in, whatever happens to a worker.

A chunk is as many cases as take about `CHUNK_S`, or `FEW_CASES` if these don't take `LONGEST_S`:
what a task costs Dask is spread over them, and each worker has one more waiting. Rows are handed on
as they come.

A worker that ends takes its chunks with it: they are halved and computed again, so that a case that
ends its worker is soon alone. A chunk of one that was lost is a suspect. Suspects are computed at
the end, one at a time; whose worker ends `MOST_DEATHS` times then is an error, the others are done.
"""

import queue
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import Stop
from configs.errors import InfrastructureError
from fleetloop.sweep.batch import row_without_result
from fleetloop.sweep.cases import Cases
from fleetloop.sweep.dataset import Columns
from fleetloop.sweep.scheduler import ask, why
from fleetloop.sweep.versions import versions_here
from fleetloop.sweep.work import Done, VersionMismatchError, work

CHUNK_S, LONGEST_S = 2.0, 10.0
FEW_CASES, MOST_CASES, FASTEST_GROWTH = 16, 2000, 4
MOST_DEATHS = 2
LOOK_EVERY_S, COUNT_EVERY_S = 0.2, 2.0
NO_WORKER_S, WAITING_EVERY_S = 60.0, 10.0
FETCH_S = 30.0


@dataclass(frozen=True, slots=True)
class Chunk:
    """Cases that are computed together."""

    numbers: tuple[int, ...]
    deaths: int = 0
    """How often a worker ended with it, alone."""

    def halves(self) -> "list[Chunk]":
        """The same cases in two chunks."""
        middle = len(self.numbers) // 2
        return [Chunk(self.numbers[:middle]), Chunk(self.numbers[middle:])]


@dataclass(slots=True)
class Pace:
    """How many cases a chunk has, by what the last ones took."""

    size: int = 1
    cases: int = 0
    idle_s: float = 0.0
    """Of all workers together, between two chunks."""
    followed: int = 0
    """Cases of the chunks before which these waits were."""
    _ended_s: dict[int, float] = field(default_factory=dict)

    def take(self, cases: int, done: Done) -> None:
        """A chunk of so many cases is done."""
        self.cases += cases
        if (last_s := self._ended_s.get(done.process)) is not None:
            self.idle_s += max(0.0, done.began_s - last_s)
            self.followed += cases
        self._ended_s[done.process] = done.ended_s
        each_s = max(done.busy_s / cases, 1e-9)
        fitting = max(int(CHUNK_S / each_s), min(int(LONGEST_S / each_s), FEW_CASES))
        self.size = max(1, min(fitting, max(self.size, cases) * FASTEST_GROWTH, MOST_CASES))


@dataclass(slots=True)
class Engine:
    """Computes cases of a study on the workers of a client.

    Args:
        client: of Dask.
        cases: of the study.
        on_rows: takes rows as they come; True: that's enough.
        notice: told what happens to workers, in words.
        kernel: whether the batch kernel is to be used for what it can do.
    """

    client: Any
    cases: Cases
    on_rows: Callable[[Any], bool]
    notice: Callable[[str], None]
    kernel: bool = True
    scheduler: str | None = None
    """Address of the user's own, whose workers the user starts."""
    clock: Clock = SYSTEM_CLOCK
    pace: Pace = field(default_factory=Pace)
    threads: int = 1
    """Of all workers now."""
    most_threads: int = 1
    _running: dict[Any, Chunk] = field(default_factory=dict)
    _again: deque[Chunk] = field(default_factory=deque)
    _suspects: deque[Chunk] = field(default_factory=deque)
    _came: "queue.SimpleQueue[Any]" = field(default_factory=queue.SimpleQueue)
    _said: "queue.SimpleQueue[str]" = field(default_factory=queue.SimpleQueue)
    _next_count_s: float = 0.0
    _seen_s: float = 0.0
    """When there was a worker at last."""
    _next_waiting_s: float = 0.0
    _tasks: int = 0

    def compute(
        self, left: Iterable[int], count: int, stop: Stop, on_look: Callable[[], None]
    ) -> None:
        """Compute these cases until they are done, it's enough, or a stop is asked for.

        Args:
            left: the numbers of the cases, in the order in which they are begun.
            count: how many these are.
            stop: looked at a few times a second.
            on_look: called as often.

        Raises:
            InfrastructureError: no worker comes, or the scheduler has gone; rows that came are
                handed on.
        """
        numbers = iter(left)
        self._seen_s = self.clock.monotonic_s()
        self._listen()
        enough = False
        try:
            while not (stop.requested or enough):
                self._count()
                count -= self._fill(numbers, count)
                if not self._running:
                    break
                enough = self._hear()
                on_look()
        finally:
            for future in self._running:
                future.release()
            self._running.clear()
            self._stop_listening()

    # --- out --------------------------------------------------------------------------------------

    def _fill(self, numbers: Iterator[int], count: int) -> int:
        """Give each worker work, and one more chunk; how many of these cases were begun."""
        begun = 0
        while len(self._running) < 2 * self.threads:
            if self._again:
                self._begin(self._again.popleft())
                continue
            share = -(-(count - begun) // (2 * self.threads))
            some = tuple(islice(numbers, max(1, min(self.pace.size, share))))
            if not some:
                break
            self._begin(Chunk(some))
            begun += len(some)
        if not self._running and self._suspects:
            self._begin(self._suspects.popleft())
        return begun

    def _begin(self, chunk: Chunk) -> None:
        self._tasks += 1
        future = self.client.submit(
            work,
            self.cases.plan,
            chunk.numbers,
            versions_here(),
            kernel=self.kernel,
            key=f"fleetloop-sweep-{id(self):x}-{self._tasks}",
            pure=False,
        )
        self._running[future] = chunk
        future.add_done_callback(self._came.put)

    # --- in ---------------------------------------------------------------------------------------

    def _hear(self) -> bool:
        """Take what comes within a moment; whether it's enough."""
        enough = False
        try:
            future = self._came.get(timeout=LOOK_EVERY_S)
            while True:
                enough |= self._take(future)
                future = self._came.get_nowait()
        except queue.Empty:
            pass
        while not self._said.empty():
            self.notice(self._said.get_nowait())
        return enough

    def _take(self, future: Any) -> bool:
        from distributed import CancelledError, KilledWorker

        chunk = self._running.pop(future, None)
        if chunk is None:
            return False
        if future.status == "finished":
            try:
                done: Done = future.result(timeout=FETCH_S)
            except (OSError, TimeoutError, CancelledError, KilledWorker):  # its worker ended
                self._again.append(chunk)
                return False
            self.pace.take(len(chunk.numbers), done)
            return self.on_rows(done.rows)
        if future.status != "error":  # done, and lost with its worker before it was fetched
            self._again.append(chunk)
            return False
        try:
            error = future.exception(timeout=FETCH_S)
        except (OSError, TimeoutError, CancelledError):
            self._again.append(chunk)
            return False
        if isinstance(error, VersionMismatchError):
            raise InfrastructureError(f"a worker has other versions: {error}")
        if not isinstance(error, KilledWorker) and len(chunk.numbers) == 1:
            return self._give_up(chunk, f"its worker failed: {type(error).__name__}: {error}")
        return self._lost(chunk)

    def _lost(self, chunk: Chunk) -> bool:
        """A worker ended with a chunk."""
        alone = not self._running
        if len(chunk.numbers) > 1:
            self._again.extend(chunk.halves())
            return False
        deaths = chunk.deaths + alone
        if deaths >= MOST_DEATHS:
            said = f"its worker ended {deaths} times while it computed this case alone"
            return self._give_up(chunk, f"{said}: killed, or out of memory")
        self._suspects.append(Chunk(chunk.numbers, deaths))
        return False

    def _give_up(self, chunk: Chunk, reason: str) -> bool:
        (number,) = chunk.numbers
        self.notice(f"case {number}: {reason}")
        row = row_without_result(self.cases, number, "error", reason)
        return self.on_rows(Columns(self.cases).batch([row]))

    # --- workers ----------------------------------------------------------------------------------

    def _count(self) -> None:
        """Count the workers now and then.

        Raises:
            InfrastructureError: there has been none for too long.
        """
        now_s = self.clock.monotonic_s()
        if now_s < self._next_count_s:
            return
        self._next_count_s = now_s + COUNT_EVERY_S
        if self.client.status not in ("running", "newly-created"):
            raise InfrastructureError(f"the scheduler has gone (client {self.client.status})")
        try:
            threads = sum(ask(self.client, self.client.scheduler.ncores).values())
        except (OSError, TimeoutError) as error:
            raise InfrastructureError(f"the scheduler has gone: {why(error)}") from error
        if threads:
            self.threads, self._seen_s = threads, now_s
            self.most_threads = max(self.most_threads, threads)
            self._next_waiting_s = 0.0
            return
        left_s = self._seen_s + NO_WORKER_S - now_s
        if left_s < 0.0:
            raise InfrastructureError(self._without_worker())
        if self.scheduler is not None and now_s >= self._next_waiting_s:
            self._next_waiting_s = now_s + WAITING_EVERY_S
            self.notice(f"waits for a worker at {self.scheduler}, {left_s:.0f} s more")

    def _without_worker(self) -> str:
        if self.scheduler is None:
            return f"no worker for {NO_WORKER_S:g} s"
        return (
            f"--scheduler {self.scheduler}: no worker for {NO_WORKER_S:g} s; start one with"
            f" dask worker {self.scheduler}"
        )

    def _listen(self) -> None:
        """Hear what happens to workers; told by other threads."""

        def of_workers(event: Any) -> None:
            said = event[1]
            if isinstance(said, dict) and said.get("action") == "remove-worker":
                lost = len(said.get("processing-tasks", ()))
                if not said.get("expected"):
                    again = "; its cases are computed again" if lost else ""
                    self._said.put(f"worker {said.get('worker')} has ended{again}")

        def of_memory(event: Any) -> None:
            said = event[1]
            used = said.get("rss", 0) / 2**20
            self._said.put(f"worker {said.get('worker')}: out of memory at {used:.0f} MiB, ended")

        for topic, told in {"all": of_workers, "worker-restart-memory": of_memory}.items():
            self.client.subscribe_topic(topic, told)

    def _stop_listening(self) -> None:
        with suppress(Exception):
            for topic in ("all", "worker-restart-memory"):
                self.client.unsubscribe_topic(topic)
