"""The life of a role as a process: brief, run, stop, exit status; the same for all roles.

A role's process is started by a launcher that holds three lines to it:

    standard input   the pickled brief, length first; afterwards the lifeline: its end means that
                     the launcher is gone, and the process ends itself in an orderly way; a byte
                     on it means that the process's last word was heard
    standard output  status lines in JSON, one `Status` each: why the process ended
    standard error   the terminal's: tracebacks, and the last word of plant and recorder if the
                     launcher is gone

SIGTERM asks for an orderly stop; SIGINT is the launcher's business. A process that can't stop in
`GRACE_S` after its lifeline broke ends itself the hard way, so a killed launcher leaves no orphan.
"""

import contextlib
import ctypes
import gc
import json
import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import BinaryIO, TypeVar

import setproctitle

from bridge.process.kernel_stat import kernel_stat
from bridge.process.waiting import readable
from configs.errors import ExitStatus, FleetloopError, PeerLostError

GRACE_S = 3.0
LINGER_S = 2.0
LAUNCHER_GONE = "the launcher is gone"
_SAME_CAUSE_S = 0.1
"""A peer that left may have left for a reason that is on its way here too."""
_LENGTH_BYTES = 8
_PR_SET_DUMPABLE = 4
_Brief = TypeVar("_Brief")


@dataclass(slots=True)
class Stop:
    """Asked for by a signal or by the launcher's end; the role looks at it once per period."""

    requested: bool = False
    reason: str = ""
    wake_fd: int = field(default_factory=lambda: os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC))
    """Becomes readable with the request, for who waits in a poll."""
    release_fd: int = field(default_factory=lambda: os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC))

    def request(self, reason: str) -> None:
        """Ask for an orderly stop; the first reason stays."""
        if not self.requested:
            self.reason = reason
            self.requested = True
            os.eventfd_write(self.wake_fd, 1)

    def requested_soon(self) -> bool:
        """Whether it is asked for, or will be at once: who lost a peer may stop for its cause."""
        readable([self.wake_fd], _SAME_CAUSE_S)
        return self.requested

    def release(self) -> None:
        """The launcher has heard the last word, or will never hear it."""
        os.eventfd_write(self.release_fd, 1)

    @property
    def released(self) -> bool:
        """Whether the launcher has let go."""
        return bool(readable([self.release_fd], 0.0))

    def end(self, reason: str) -> None:
        """There is no launcher any more: stop, and don't wait for it to have the last word."""
        self.request(reason)
        self.release()

    def await_heard(self) -> None:
        """Having said something that the launcher answers, stay until then, at most `LINGER_S`."""
        if readable([self.release_fd], LINGER_S):
            os.eventfd_read(self.release_fd)

    def await_release(self) -> None:
        """Having said the last word, stay until the launcher has it, at most `LINGER_S`.

        A network session that closes may drop what it has not sent yet; order is kept, so with the
        last word everything has arrived.
        """
        readable([self.release_fd], LINGER_S)


@dataclass(frozen=True, slots=True)
class Status:
    """Why a process ended before its time: one line on standard output."""

    error: str
    exit_status: int
    kind: str  # name of the error's class

    def to_line(self) -> bytes:
        """The line, with its newline."""
        return json.dumps([self.error, self.exit_status, self.kind]).encode() + b"\n"

    @classmethod
    def from_line(cls, line: bytes) -> "Status | None":
        """The status that a line says, None if it says none."""
        try:
            error, exit_status, kind = json.loads(line)
        except (ValueError, TypeError):
            return None
        return cls(str(error), int(exit_status), str(kind))


def pack_brief(brief: object) -> bytes:
    """Bytes for the standard input of a role's process."""
    body = pickle.dumps(brief)
    return len(body).to_bytes(_LENGTH_BYTES, "little") + body


def serve(
    kind: type[_Brief],
    body: Callable[[_Brief, Stop], str | None],
    *,
    name: str,
    orphaned: Callable[[_Brief], None] = lambda _: None,
) -> int:
    """Take the brief from standard input, run `body` until it returns, return the exit status.

    What `body` returns is its last word: said if there is no launcher any more that could say it.
    `orphaned` is called, in a thread of its own, as soon as there is none.
    """
    if sys.stdin.isatty():
        _tell(f"{name}: started by `fleetloop run`, not by hand")
        return ExitStatus.USAGE
    keep_to_itself()
    status_line = reserve_stdout()
    brief = _read_brief(sys.stdin.buffer)
    if not isinstance(brief, kind):
        _tell(f"{name}: no {kind.__name__} on standard input")
        return ExitStatus.USAGE
    name_process(name)
    stop = Stop()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: stop.request("asked to stop"))
    lifeline = threading.Thread(
        target=_watch_lifeline, args=(stop, partial(orphaned, brief)), daemon=True
    )
    lifeline.start()
    try:
        word = body(brief, stop)
    except FleetloopError as error:
        peer_lost = isinstance(error, PeerLostError)
        if peer_lost:
            stop.requested_soon()
        if stop.reason != LAUNCHER_GONE:
            _say(
                status_line, Status(str(error), int(error.exit_status), type(error).__name__), name
            )
            return int(error.exit_status)
        word = None if peer_lost else str(error)
    if word and stop.reason == LAUNCHER_GONE:
        _tell(f"{name}: {LAUNCHER_GONE}; {word}")
    return ExitStatus.OK


def reserve_stdout() -> int:
    """Give standard output a descriptor of its own, and return it.

    What libraries write to descriptor 1, as Zenoh does with its log, goes to standard error.
    """
    own = os.dup(1)
    with contextlib.suppress(OSError):  # standard error may be closed
        os.dup2(2, 1)
    return own


def name_process(name: str) -> None:
    """What `ps` and `pgrep -f` call this process."""
    setproctitle.setproctitle(f"fleetloop {name}")


def keep_to_itself() -> None:
    """No core dump, and no look into its memory from this user's other processes: it has passwords.

    Debuggers and profilers from outside need root then.
    """
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_DUMPABLE, 0, 0, 0, 0)


def launcher_stopped() -> bool:
    """Whether the process that started this one is stopped, as by Ctrl-Z: its router is, too."""
    stat = kernel_stat(os.getppid())
    return stat is not None and stat.state in ("T", "t")


def kill_self() -> None:
    """Kill this process at once, as the kernel does."""
    os.kill(os.getpid(), signal.SIGKILL)


def freeze_self() -> None:
    """Stop this process; returns when it was told to continue (SIGCONT)."""
    os.kill(os.getpid(), signal.SIGSTOP)


def processor_wait_ns() -> int:
    """How long this process's main thread was ready to run and had no processor; 0 if unknown."""
    try:
        return int(Path("/proc/self/schedstat").read_text("ascii").split()[1])
    except (OSError, ValueError, IndexError):
        return 0


def settle_memory() -> None:
    """Call once before a periodic loop: what start-up allocated is never scanned again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 50, 100)


@contextlib.contextmanager
def settled_memory() -> Iterator[None]:
    """The same for a loop in somebody's process: as it was afterwards."""
    thresholds = gc.get_threshold()
    settle_memory()
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)
        gc.unfreeze()


def _read_brief(stream: BinaryIO) -> object:
    length = int.from_bytes(stream.read(_LENGTH_BYTES), "little")
    body = stream.read(length)
    # The pipe comes from the process that started this one, which could run anything anyway.
    return pickle.loads(body) if body and len(body) == length else None


def _watch_lifeline(stop: Stop, orphaned: Callable[[], None]) -> None:
    while os.read(0, 4096):
        stop.release()
    stop.end(LAUNCHER_GONE)
    orphaned()
    threading.Event().wait(GRACE_S)
    os._exit(ExitStatus.INFRASTRUCTURE)


def _say(descriptor: int, status: Status, name: str) -> None:
    try:
        os.write(descriptor, status.to_line())
    except OSError:
        _tell(f"{name}: {status.error}")


def _tell(text: str) -> None:
    """Say it on the terminal, if there is one."""
    with contextlib.suppress(OSError, ValueError):
        print(text, file=sys.stderr, flush=True)  # noqa: T201
