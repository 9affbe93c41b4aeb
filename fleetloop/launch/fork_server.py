"""The fork server: a process that imports the roles once and forks the processes of a run.

    launcher ──role, pipes──► fork server ──fork──► plant, agents   and fork + exec ──► recorder

It has no thread and no network session, so forking is safe; it ends as soon as all are started, and
the launcher adopts them. So a controller is ready without importing anything, and all processes
have the same memory layout: on a core that they share, caches and branch predictors filled by one
serve the next, which is worth a third of a lockstep tick.

If the launcher is killed before all are started, the fork server removes the run's folder of
sockets; later the recorder does.
"""

import array
import ctypes
import gc
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from configs.errors import InfrastructureError
from configs.roles import STARTED
from fleetloop import packages

START_S = 20.0
_PR_SET_CHILD_SUBREAPER = 36
_MAX_FDS = 200
"""Descriptors that travel with one message; the kernel takes 253 and drops the rest silently."""
_MORE, _ALL_STARTED = "+", "."
_BATCH = "--batch"
"""Processes start as batch work: one that is woken waits for its turn and interrupts none, which
is worth a seventh of a lockstep tick."""
_FORKED = tuple(role.module for role in STARTED if role.forked)
"""Forked; any other module gets an interpreter of its own."""


class Forked(NamedTuple):
    """A process, and the numbers that the descriptors given to it have there."""

    pid: int
    fds: tuple[int, ...]


class ForkServer:
    """The launcher's end; a context manager that returns when the fork server has ended.

    Args:
        folder: the run's folder of sockets, which may not exist yet.
        batch: processes care for throughput, not for the moment at which they are woken.
    """

    def __init__(self, folder: Path, *, batch: bool) -> None:
        _adopt_orphans()
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket = ours
        self._socket.settimeout(START_S)
        options = [str(folder), *([_BATCH] if batch else [])]
        # Ctrl-C is the launcher's business: fork server and roles start with it blocked.
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            with theirs:
                # -P: a folder here that is named like one of our packages must not shadow it.
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "fleetloop.launch.fork_server", *options],
                    stdin=theirs.fileno(),
                    stdout=subprocess.DEVNULL,
                    start_new_session=True,
                    env=packages.environment(),
                )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)

    def fork(self, module: str, stdin: int, stdout: int, fds: Sequence[int] = ()) -> Forked:
        """Start a process of a role with these descriptors.

        Raises:
            InfrastructureError: the fork server is gone, doesn't answer, or the system refuses.
        """
        passed = [stdin, stdout, *fds]
        try:
            while len(passed) > _MAX_FDS:
                socket.send_fds(self._socket, [_MORE.encode()], passed[:_MAX_FDS])
                passed = passed[_MAX_FDS:]
            socket.send_fds(self._socket, [module.encode()], passed)
            answer = self._socket.recv(65536)
        except OSError as error:
            raise InfrastructureError(f"can't start {module}: the fork server: {error}") from error
        if not answer:
            raise InfrastructureError(f"can't start {module}: the fork server has ended")
        said = json.loads(answer)
        if isinstance(said, str):
            raise InfrastructureError(f"can't start {module}: {said}")
        return Forked(said[0], tuple(said[1:]))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        with suppress(OSError):
            self._socket.send(_ALL_STARTED.encode())
        self._socket.close()
        try:
            self._process.wait(START_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _adopt_orphans() -> None:
    """Become the parent of processes whose own parent has ended, on Linux."""
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


# --- the server's own process ---------------------------------------------------------------------


def _serve(folder: Path) -> None:
    from bridge.can_bus import sockets

    if _BATCH in sys.argv:
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    for role in _FORKED:
        __import__(f"{role}.__main__")
    gc.collect()
    gc.freeze()
    orders = socket.socket(fileno=os.dup(0))
    while True:
        try:
            module, fds = _receive(orders)
        except OSError as error:
            _answer(orders, str(error))
            continue
        if module == _ALL_STARTED:
            return
        if not module:  # the launcher was killed
            sockets.remove_run_folder(folder)
            return
        try:
            child = os.fork()
        except OSError as error:
            _answer(orders, f"no more processes: {error.strerror}")
            continue
        if child == 0:
            orders.close()
            _be(module, *fds)
        for fd in fds:
            os.close(fd)
        _answer(orders, [child, *fds[2:]])


def _answer(orders: socket.socket, what: object) -> None:
    with suppress(OSError):  # its end is seen with the next order
        orders.send(json.dumps(what).encode())


def _receive(orders: socket.socket) -> tuple[str, list[int]]:
    """The next order with all its descriptors, which no other child inherits.

    Raises:
        OSError: not all descriptors could be taken; the text says why.
    """
    room = socket.CMSG_LEN(_MAX_FDS * array.array("i").itemsize)
    fds = array.array("i")
    cut = False
    order = _MORE
    while order == _MORE:
        message, ancillary, flags, _ = orders.recvmsg(256, room, socket.MSG_CMSG_CLOEXEC)
        order = message.decode()
        cut |= bool(flags & socket.MSG_CTRUNC)
        for level, kind, data in ancillary:
            if level == socket.SOL_SOCKET and kind == socket.SCM_RIGHTS:
                fds.frombytes(data[: len(data) - len(data) % fds.itemsize])
    if cut:
        for fd in fds:
            os.close(fd)
        raise OSError("too many open files (ulimit -n)")
    return order, list(fds)


def _be(module: str, stdin: int, stdout: int, *given: int) -> None:
    """In the child: become the process, its other descriptors as they came. Never returns."""
    status = 1
    try:
        os.setsid()
        for fd, standard in ((stdin, 0), (stdout, 1)):
            os.dup2(fd, standard)
            os.close(fd)
        if module not in _FORKED:
            for fd in given:
                os.set_inheritable(fd, True)
            os.execv(sys.executable, [sys.executable, "-P", "-m", module])
        role = sys.modules[f"{module}.__main__"]
        status = role.main()
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        with suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)


if __name__ == "__main__":
    _serve(Path(sys.argv[1]))
