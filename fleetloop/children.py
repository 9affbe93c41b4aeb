"""The processes that a run starts: spawn them, hear why they ended, end them within a bound.

Only processes started here are ever signalled, by their own id. They run in their own session, so a
Ctrl-C at the terminal reaches the launcher alone; their standard input is their lifeline.
"""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

from bridge.process import Status, pack_brief
from configs.errors import InfrastructureError

TERM_GRACE_S = 1.0
"""From asking a process to stop until it is killed."""


class Child:
    """One process of the run."""

    def __init__(self, name: str, module: str, brief: object, fds: Sequence[int] = ()) -> None:
        self.name = name
        self.status: Status | None = None
        # -P: a folder named like one of our packages in the current directory must not shadow it.
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=tuple(fds),
            start_new_session=True,
        )
        self._reader = threading.Thread(target=self._read_status, daemon=True)
        self._reader.start()
        assert self._process.stdin is not None  # noqa: S101 - asked for two lines above
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(pack_brief(brief))
            self._process.stdin.flush()

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def ended(self) -> bool:
        """Whether the process has ended."""
        return self._process.poll() is not None

    def failure(self) -> "Failure | None":
        """Why it ended, None if it has not or if it ended well."""
        code = self._process.poll()
        if code is None or code == 0:
            return None
        self._reader.join(1.0)
        if code < 0:
            return Failure(0, self.name, f"{self.name} was killed by {signal.Signals(-code).name}")
        if self.status is None:
            text = f"{self.name} crashed (exit status {code}); its traceback is above"
            return Failure(1, self.name, text)
        return Failure(3 if self.status.peer_lost else 2, self.name, self.status.error)

    def ask_to_stop(self) -> None:
        """Send SIGTERM, if it still runs."""
        if not self.ended():
            self._process.terminate()

    def kill(self) -> None:
        """Send SIGKILL, if it still runs."""
        if not self.ended():
            self._process.kill()

    def close(self) -> None:
        """Cut the lifeline and reap."""
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()
        self._process.wait()
        self._reader.join(1.0)
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _read_status(self) -> None:
        if self._process.stdout is None:
            return
        for line in self._process.stdout:
            self.status = Status.from_line(line) or self.status


class Failure:
    """Why a run ended before its time. The lowest rank is the cause, the others are consequences.

    Ranks: 0 killed by a signal, 1 crashed, 2 gave up by itself, 3 lost a peer.
    """

    def __init__(self, rank: int, name: str, text: str) -> None:
        self.rank = rank
        self.name = name
        self.text = text

    @property
    def unexpected(self) -> bool:
        """Whether the process had no chance to say when it happened."""
        return self.rank < 2


def cause(children: Iterable[Child]) -> Failure | None:
    """The failure that explains the others, None if nobody failed."""
    failures = [failure for child in children if (failure := child.failure()) is not None]
    return min(failures, key=lambda failure: failure.rank, default=None)


def await_end(children: Iterable[Child], within_s: float) -> list[Child]:
    """Wait until all have ended, at most `within_s`; return those that have not."""
    deadline = time.monotonic() + within_s
    fds = {os.pidfd_open(child.pid): child for child in children if not child.ended()}
    try:
        import select

        poller = select.poll()
        for fd in fds:
            poller.register(fd, select.POLLIN)
        waiting = dict(fds)
        while waiting and (left_s := deadline - time.monotonic()) > 0:
            for fd, _ in poller.poll(left_s * 1e3):
                poller.unregister(fd)
                del waiting[fd]
    finally:
        for fd in fds:
            os.close(fd)
    return [child for child in waiting.values() if not child.ended()]


def end(children: Sequence[Child], *, grace_s: float = TERM_GRACE_S) -> None:
    """End all: ask, wait a bounded time, kill; nobody is left."""
    for child in children:
        child.ask_to_stop()
    for child in await_end(children, grace_s):
        child.kill()
    for child in children:
        child.close()


def refuse_shadowed_roles(modules: Iterable[str]) -> None:
    """Refuse to start roles that aren't this installation's own.

    Raises:
        InfrastructureError: another package named `agents` or `plant` would be started.
    """
    import importlib.util

    home = Path(__file__).resolve().parent.parent
    for module in modules:
        spec = importlib.util.find_spec(module)
        origin = Path(spec.origin).resolve() if spec is not None and spec.origin else None
        if origin is None or origin.parent.parent != home:
            raise InfrastructureError(
                f"the package {module!r} found at {origin} is not Fleetloop's own (expected in"
                f" {home}): install Fleetloop in an environment of its own"
            )
