"""The processes that a run starts: forked, observed, and ended within a bound.

Only processes started here are ever signalled, by their own id. They run in their own session, so a
Ctrl-C at the terminal reaches the launcher alone; their standard input is their lifeline.
"""

import contextlib
import os
import select
import signal
import threading
from collections.abc import Iterable, Sequence

from bridge.process.clock import SYSTEM_CLOCK
from bridge.process.kernel_stat import kernel_stat
from bridge.process.lifecycle import Status, pack_brief
from configs.errors import InfrastructureError, PeerLostError, PeerSilentError
from fleetloop.launch.fork_server import ForkServer

KILLED, CRASHED, GAVE_UP, PEER_SILENT, PEER_LOST = range(5)
_CONSEQUENCES = {PeerSilentError.__name__: PEER_SILENT, PeerLostError.__name__: PEER_LOST}
_STATES = {
    "T": ", stopped by a signal",
    "t": ", stopped by a debugger",
    "D": ", waits for a disk",
    "R": ", ready to run: the machine is busy",
}
TERM_GRACE_S = 1.0
"""From asking a process to stop until it is killed."""


class Child:
    """One process of the run."""

    fds: tuple[int, ...]
    """The numbers that the descriptors given to it have there."""

    def __init__(
        self, fork_server: ForkServer, name: str, module: str, fds: Sequence[int] = ()
    ) -> None:
        self.name = name
        self.status: Status | None = None
        self._code: int | None = None
        try:
            stdin, self._stdin = os.pipe()
            self._stdout, stdout = os.pipe()
        except OSError as error:
            raise InfrastructureError(f"can't start {name}: {error.strerror}") from error
        try:
            self._pid, self.fds = fork_server.fork(module, stdin, stdout, fds)
        except InfrastructureError:
            os.close(self._stdin)
            os.close(self._stdout)
            raise
        finally:
            os.close(stdin)
            os.close(stdout)
        self._reader = threading.Thread(target=self._read_status, daemon=True)
        self._reader.start()

    def tell(self, brief: object) -> None:
        """Hand it its brief."""
        with (
            contextlib.suppress(BrokenPipeError),
            os.fdopen(self._stdin, "wb", closefd=False) as lifeline,
        ):
            lifeline.write(pack_brief(brief))

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._pid

    def ended(self) -> bool:
        """Whether the process has ended."""
        return self._poll(os.WNOHANG) is not None

    def _poll(self, options: int) -> int | None:
        if self._code is None:
            try:
                pid, status = os.waitpid(self._pid, options)
            except ChildProcessError:  # still the fork server's
                return None
            if pid:
                self._code = os.waitstatus_to_exitcode(status)
        return self._code

    def await_end(self, within_s: float) -> None:
        """Wait until it has ended, at most so long."""
        fd = os.pidfd_open(self._pid)
        try:
            poller = select.poll()
            poller.register(fd, select.POLLIN)
            poller.poll(within_s * 1e3)
        finally:
            os.close(fd)

    def failure(self) -> "Failure | None":
        """Why it ended, None if it has not or if it ended well."""
        code = self._poll(os.WNOHANG)
        if code is None or code == 0:
            return None
        self._reader.join(1.0)
        if code < 0:
            return Failure(
                KILLED, self.name, f"{self.name} was killed by {signal.Signals(-code).name}"
            )
        if self.status is None:
            text = f"{self.name} crashed (exit status {code}); its traceback is above"
            return Failure(CRASHED, self.name, text)
        rank = _CONSEQUENCES.get(self.status.kind, GAVE_UP)
        return Failure(rank, self.name, self.status.error)

    def state(self) -> str:
        """Why it may be silent, as far as the kernel knows: ", stopped by a signal"; else ""."""
        stat = kernel_stat(self._pid)
        return "" if stat is None else _STATES.get(stat.state, "")

    def release(self) -> None:
        """Tell it that its report has arrived."""
        with contextlib.suppress(OSError):
            os.write(self._stdin, b"\n")

    def ask_to_stop(self) -> None:
        """Send SIGTERM, if it still runs."""
        if not self.ended():
            os.kill(self._pid, signal.SIGTERM)

    def wake(self) -> bool:
        """Let it go on if a signal has stopped it; whether one had."""
        stopped = not self.ended() and self.state() == _STATES["T"]
        if stopped:
            os.kill(self._pid, signal.SIGCONT)
        return stopped

    def kill(self) -> None:
        """Send SIGKILL, if it still runs."""
        if not self.ended():
            os.kill(self._pid, signal.SIGKILL)

    def close(self) -> None:
        """Cut the lifeline and reap."""
        if self._stdin >= 0:
            os.close(self._stdin)
            self._stdin = -1
        self._poll(0)
        self._reader.join(1.0)

    def _read_status(self) -> None:
        with os.fdopen(self._stdout, "rb") as lines:
            for line in lines:
                self.status = Status.from_line(line) or self.status


class Failure:
    """Why a run ended before its time. The lowest rank is the cause, the others are consequences.

    Ranks: killed by a signal, crashed, gave up by itself, misses a peer's word, lost a peer.
    """

    def __init__(self, rank: int, name: str, text: str) -> None:
        self.rank = rank
        self.name = name
        self.text = text

    @property
    def unexpected(self) -> bool:
        """Whether the process had no chance to say when it happened."""
        return self.rank < GAVE_UP


def cause(children: Iterable[Child]) -> Failure | None:
    """The failure that explains the others, None if none failed."""
    failures = [failure for child in children if (failure := child.failure()) is not None]
    return min(failures, key=lambda failure: failure.rank, default=None)


def await_end(children: Iterable[Child], within_s: float) -> list[Child]:
    """Wait until all have ended, at most `within_s`; return those that have not.

    By this machine's clock, which real processes end by.
    """
    children = list(children)
    deadline = SYSTEM_CLOCK.monotonic_s() + within_s
    for child in children:
        if not child.ended():
            child.await_end(max(deadline - SYSTEM_CLOCK.monotonic_s(), 0.0))
    return [child for child in children if not child.ended()]


def end(children: Sequence[Child], *, grace_s: float = TERM_GRACE_S) -> None:
    """End all: ask, wait a bounded time, kill; none is left."""
    for child in children:
        child.ask_to_stop()
    for child in await_end(children, grace_s):
        child.kill()
    for child in children:
        child.close()
