"""The nursery: one process that imports the roles once and forks each process of a run from itself.

    launcher ──role, pipes──► nursery ──fork──► plant, agents      and fork + exec ──► recorder

It has no thread and no network session, so forking is safe; it ends as soon as all are born, and
the launcher adopts them. So a controller is ready without importing anything, and all processes
have the same memory layout: on a core that they share, caches and branch predictors filled by one
serve the next, which is worth a third of a lockstep tick.
"""

import array
import ctypes
import fcntl
import gc
import os
import socket
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from types import TracebackType
from typing import Self

from configs.errors import InfrastructureError

FIRST_FD = 10
"""Descriptors that a process inherits are numbered from here on."""
BIRTH_S = 20.0
_PR_SET_CHILD_SUBREAPER = 36
_MAX_FDS = 250
_BATCH = "--batch"
"""Processes are born as batch work: who is woken waits for its turn instead of interrupting, which
is worth a seventh of a lockstep tick."""
_ROLES = ("agents", "plant")
"""Forked; any other module gets an interpreter of its own."""


class Nursery:
    """The launcher's end; a context manager that returns when the nursery has ended.

    Args:
        batch: processes care for throughput, not for the moment at which they are woken.
    """

    def __init__(self, *, batch: bool) -> None:
        _adopt_orphans()
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket = ours
        self._socket.settimeout(BIRTH_S)
        with theirs:
            # -P: a folder here that is named like one of our packages must not shadow it.
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "fleetloop.nursery", *([_BATCH] if batch else [])],
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                start_new_session=True,
            )

    def bear(self, module: str, stdin: int, stdout: int, fds: Sequence[int]) -> int:
        """Start a process of a role with these descriptors; return its id.

        Raises:
            InfrastructureError: the nursery is gone or doesn't answer.
        """
        try:
            socket.send_fds(self._socket, [module.encode()], [stdin, stdout, *fds])
            answer = self._socket.recv(64)
        except OSError as error:
            raise InfrastructureError(f"can't start {module}: the nursery: {error}") from error
        if not answer:
            raise InfrastructureError(f"can't start {module}: the nursery has ended")
        return int(answer)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._socket.close()
        try:
            self._process.wait(BIRTH_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _adopt_orphans() -> None:
    """Become the parent of processes whose own parent has ended, on Linux."""
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


# --- the nursery itself ---------------------------------------------------------------------------


def _serve() -> None:
    if _BATCH in sys.argv:
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    for role in _ROLES:
        __import__(f"{role}.__main__")
    gc.collect()
    gc.freeze()
    orders = socket.socket(fileno=os.dup(0))
    while True:
        module, fds = _receive(orders)
        if not module:
            return
        child = os.fork()
        if child == 0:
            orders.close()
            _be(module, fds)
        for fd in fds:
            os.close(fd)
        orders.send(str(child).encode())


def _receive(orders: socket.socket) -> tuple[str, list[int]]:
    """Like `socket.recv_fds`, without inheriting what comes."""
    room = socket.CMSG_LEN(_MAX_FDS * array.array("i").itemsize)
    message, ancillary, _, _ = orders.recvmsg(256, room, socket.MSG_CMSG_CLOEXEC)
    fds = array.array("i")
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == socket.SCM_RIGHTS:
            fds.frombytes(data[: len(data) - len(data) % fds.itemsize])
    return message.decode(), list(fds)


def _be(module: str, fds: Sequence[int]) -> None:
    """In the child: become the process. Never returns."""
    status = 1
    try:
        os.setsid()
        high = [fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, 1000) for fd in fds]
        for fd in fds:
            os.close(fd)
        stdin, stdout, *inherited = high
        os.dup2(stdin, 0)
        os.dup2(stdout, 1)
        for number, fd in enumerate(inherited, FIRST_FD):
            os.dup2(fd, number)
        for fd in high:
            os.close(fd)
        if module not in _ROLES:
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
    _serve()
