"""Fork servers: processes that import the roles once and fork the processes of a run.

    launcher ──role, pipes──► fork server ──fork──► plant, agents
             ──role, pipes──► fork server ──fork──► recorder

They have no thread and no network session, so forking is safe; they end as soon as all are started,
and the launcher adopts the roles. So a controller is ready without importing anything, and all
processes of a tick have the same memory layout: on a core that they share, caches and branch
predictors filled by one serve the next, which is worth a third of a lockstep tick.

They import while the launcher still does: `ForkServer` needs nothing of the run, `serve` says it.

If the launcher is killed before all are started, the fork servers remove the run's folder of
sockets; later the recorder does.
"""

import array
import ctypes
import gc
import importlib
import importlib.util
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from bridge.process.scheduling import go_batch, go_by_short_turns
from configs.errors import InfrastructureError
from configs.roles import STARTED
from fleetloop import packages

START_S = 20.0
_PR_SET_CHILD_SUBREAPER = 36
_MAX_FDS = 200
"""Descriptors that travel with one message; the kernel takes 253 and drops the rest silently."""
_MORE, _ALL_STARTED = "+", "."
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""Of the recorder's numpy, which would start others when it is imported: a process with threads
can't be forked. Roles in step import none; users' laws may, with all its threads."""
IN_STEP = tuple(role.module for role in STARTED if role.in_step)
"""Modules of one fork server; any other module has one of its own."""
_GROUPS = (IN_STEP, *((role.module,) for role in STARTED if not role.in_step))


class Forked(NamedTuple):
    """A process, and the numbers that the descriptors given to it have there."""

    pid: int
    fds: tuple[int, ...]


class ForkServer:
    """The launcher's end; a context manager that returns when the fork servers have ended.

    Args:
        groups: the modules that each fork server imports; default: those of all roles of a run.

    Raises:
        InfrastructureError: other packages have the names of ours, or the system refuses.
    """

    def __init__(self, *groups: Sequence[str]) -> None:
        refuse_shadowed_roles()
        _adopt_orphans()
        self._servers: list[_Server] = []
        self._of: dict[str, _Server] = {}
        self._serving = False
        try:
            for modules in groups or _GROUPS:
                server = _Server(modules)
                self._servers.append(server)
                self._of.update(dict.fromkeys(modules, server))
        except OSError as error:
            self.close()
            raise InfrastructureError(f"can't start a fork server: {error.strerror}") from error

    def serve(self, folder: Path, *, lockstep: bool) -> None:
        """Say for which run they are.

        Args:
            folder: the run's folder of sockets, which may not exist yet.
            lockstep: processes care for throughput, not for the moment at which they are woken:
                those of a tick don't interrupt each other, all others wait for them.
        """
        self._serving = True
        for server in self._servers:
            with suppress(OSError):  # its end is seen with the first process
                server.socket.send(json.dumps([str(folder), lockstep]).encode())

    def fork(self, module: str, stdin: int, stdout: int, fds: Sequence[int] = ()) -> Forked:
        """Start a process of a role with these descriptors.

        Raises:
            InfrastructureError: the fork server is gone, doesn't answer, or the system refuses.
        """
        passed, end = [stdin, stdout, *fds], self._of[module].socket
        try:
            while len(passed) > _MAX_FDS:
                socket.send_fds(end, [_MORE.encode()], passed[:_MAX_FDS])
                passed = passed[_MAX_FDS:]
            socket.send_fds(end, [module.encode()], passed)
            answer = end.recv(65536)
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
        self.close()

    def close(self) -> None:
        """End them; what they have forked goes on. Idempotent."""
        for server in self._servers:
            if self._serving:
                with suppress(OSError):
                    server.socket.send(_ALL_STARTED.encode())
            else:  # it has forked nothing, and may import for a while
                server.process.kill()
            server.socket.close()
        for server in self._servers:
            try:
                server.process.wait(START_S)
            except subprocess.TimeoutExpired:
                server.process.kill()
                server.process.wait()


class _Server:
    """One fork server, as the launcher has it."""

    def __init__(self, modules: Sequence[str]) -> None:
        self.socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.socket.settimeout(START_S)
        # Ctrl-C is the launcher's business: fork server and roles start with it blocked.
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        environment = packages.environment() | ({} if modules == IN_STEP else _ONE_THREAD)
        try:
            with theirs:
                # -P: a folder here that is named like one of our packages must not shadow it.
                self.process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "fleetloop.launch.fork_server", *modules],
                    stdin=theirs.fileno(),
                    stdout=subprocess.DEVNULL,
                    start_new_session=True,
                    env=environment,
                )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextmanager
def imports_begun(*, wanted: bool) -> Iterator[ForkServer | None]:
    """Fork servers that import while this program does; None if there can be none.

    Why not is told by the run, which tries again. Those that no run has used are ended at once.
    """
    fork_server = None
    if wanted:
        with suppress(InfrastructureError):
            fork_server = ForkServer()
    try:
        yield fork_server
    finally:
        if fork_server is not None:
            fork_server.close()


def refuse_shadowed_roles() -> None:
    """Refuse to start roles that aren't this installation's own.

    Raises:
        InfrastructureError: another package named `agents` or `plant` would be started.
    """
    for name in ("agents", "plant", "fleetloop"):
        spec = importlib.util.find_spec(name)
        origin = Path(spec.origin).resolve() if spec is not None and spec.origin else None
        if origin is None or origin.parent.parent != packages.HOME:
            raise InfrastructureError(
                f"the package {name!r} found at {origin} is not Fleetloop's own (expected in"
                f" {packages.HOME}): install Fleetloop in an environment of its own"
            )


def _adopt_orphans() -> None:
    """Become the parent of processes whose own parent has ended, on Linux."""
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


# --- the server's own process ---------------------------------------------------------------------


def _serve(modules: Sequence[str]) -> None:
    from bridge.can_bus import sockets

    for module in modules:
        importlib.import_module(module)
    gc.collect()
    gc.freeze()
    orders = socket.socket(fileno=os.dup(0))
    if not (said := orders.recv(65536)):
        return
    folder, lockstep = json.loads(said)
    if lockstep:
        (go_by_short_turns if modules[0] in IN_STEP else go_batch)()
    while True:
        try:
            module, fds = _receive(orders)
        except OSError as error:
            _answer(orders, str(error))
            continue
        if module == _ALL_STARTED:
            return
        if not module:  # the launcher was killed
            sockets.remove_run_folder(Path(folder))
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


def _be(module: str, stdin: int, stdout: int, *_: int) -> None:
    """In the child: become the process, its other descriptors as they came. Never returns."""
    status = 1
    try:
        os.setsid()
        for fd, standard in ((stdin, 0), (stdout, 1)):
            os.dup2(fd, standard)
            os.close(fd)
        status = sys.modules[module].main()
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        with suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)


if __name__ == "__main__":
    _serve(sys.argv[1:])
    os._exit(0)  # the launcher waits for it, and there is nothing to clean up
