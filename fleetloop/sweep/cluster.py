"""Where cases are computed: Dask workers, of this machine or of a cluster that the user has.

    here        a scheduler in this process and a process per worker, all on loopback, with
                certificates made for this command: nobody else on the machine can give them work
    elsewhere   the scheduler of an address, as it is; what it has is not ended

Dask's own messages go to a file in the study's folder, never to the terminal.
"""

import logging
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

from configs.errors import InfrastructureError, ScenarioError
from fleetloop.sweep import worker_start
from fleetloop.sweep.scheduler import ANSWER_S, Tls, ask, client_of_scheduler, why
from fleetloop.sweep.versions import mismatch, versions_here

LOG = "dask.log"
_LOGGERS = ("distributed", "tornado", "asyncio")
_OF_A_KILL = "ignore:resource_tracker:UserWarning"
"""What multiprocessing would say on the terminal of a command that was killed."""
START_S, CLOSE_S = 60.0, 15.0
_SETTINGS: dict[str, Any] = {
    # What a worker is killed for is said, and its cases are computed again; a worker that only
    # pauses would stand still for ever.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    "distributed.nanny.pre-spawn-environ.NUMBA_NUM_THREADS": 1,
    "distributed.nanny.pre-spawn-environ.DASK_LOGGING__DISTRIBUTED": "critical",
    "distributed.admin.tick.limit": "1h",
}


@dataclass(frozen=True, slots=True)
class Place:
    """Where a study's cases are computed."""

    workers: int
    """Processes here."""
    memory: str = "auto"
    """Of each of them at most, as Dask takes it."""
    scheduler: str | None = None
    """Address of a scheduler elsewhere."""
    tls: Tls = field(default_factory=Tls)


@contextmanager
def client_of(place: Place, folder: Path) -> Iterator[Any]:
    """A Dask client whose workers are there, with this program's versions.

    Raises:
        ScenarioError: the address or a file is none.
        InfrastructureError: the scheduler doesn't answer, or workers have other versions.
    """
    import dask
    import distributed  # before its settings are changed: it brings its own

    with ExitStack() as stack:
        stack.enter_context(_logged(folder / LOG))
        stack.enter_context(dask.config.set(_SETTINGS))
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("ignore")  # of Dask; what matters is checked below
        if place.scheduler is None:
            client = _here(distributed, place, folder, stack)
        else:
            client = client_of_scheduler(distributed, place.scheduler, place.tls)
            stack.callback(_close, client)
        _check_versions(client)
        yield client


def _here(distributed: Any, place: Place, folder: Path, stack: ExitStack) -> Any:
    security = distributed.Security.temporary()
    sys.warnoptions.append(_OF_A_KILL)  # for the process that multiprocessing starts for itself,
    resource_tracker.ensure_running()  # now: it lets Ctrl-C through to the thread that starts it
    scratch = folder / ".dask"
    try:
        with _without_ctrl_c():
            cluster = distributed.LocalCluster(
                n_workers=place.workers,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                protocol="tls://",
                security=security,
                silence_logs=False,
                dashboard_address="127.0.0.1:0",
                scheduler_kwargs={"dashboard": False},
                memory_limit=place.memory,
                local_directory=str(scratch),
                death_timeout=START_S,
                preload=[worker_start.__name__],
                env={worker_start.LOG: str((folder / LOG).resolve())},
            )
    except ValueError as error:
        raise ScenarioError(f"--memory {place.memory}: {error}") from error
    except (OSError, RuntimeError) as error:
        raise InfrastructureError(f"can't start workers: {error}") from error
    stack.callback(_remove, scratch)
    stack.callback(_close, cluster)
    client = distributed.Client(cluster, timeout=ANSWER_S, set_as_default=False)
    stack.callback(_close, client)
    return client


@contextmanager
def _without_ctrl_c() -> Iterator[None]:
    """Threads and processes that begin meanwhile never get Ctrl-C; this thread gets it later."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _check_versions(client: Any) -> None:
    """Refuse workers of another program.

    Raises:
        InfrastructureError: it names the first that differs, and how; or who doesn't answer.
    """
    ours = versions_here()
    try:
        scheduler = ask(client, client.scheduler.versions, packages=[])["packages"]
        workers = ask(client, client.scheduler.ncores)
    except (OSError, TimeoutError) as error:
        raise InfrastructureError(f"the scheduler doesn't answer: {why(error)}") from error
    for worker in workers:
        try:
            answers = client.run(
                versions_here, workers=[worker], on_error="return", callback_timeout=ANSWER_S
            )
        except (OSError, TimeoutError) as error:
            raise InfrastructureError(f"worker {worker} doesn't answer: {why(error)}") from error
        found = answers.get(worker)
        if isinstance(found, BaseException):
            raise InfrastructureError(
                f"worker {worker} can't run this program: {type(found).__name__}: {found};"
                " install the same Fleetloop there, with its extra sweep"
            )
        if differs := mismatch(ours, found):
            raise InfrastructureError(
                f"worker {worker} has other versions: {differs}; a dataset is of one program"
            )
    if (found := scheduler.get("distributed")) != ours["distributed"]:
        raise InfrastructureError(
            f"the scheduler has other versions: distributed {found}, here {ours['distributed']}"
        )


class _File(logging.FileHandler):
    """What finds no room, as on a full disk, goes: the study's own writing says so."""

    def handleError(self, record: logging.LogRecord) -> None:
        """Nothing."""

    def close(self) -> None:
        """Close the file; what waits to be written and can't be goes."""
        with suppress(OSError):
            super().close()


@contextmanager
def _logged(path: Path) -> Iterator[None]:
    """Dask's messages go to a file while this lasts, and nowhere afterwards.

    What is said when all is over, as of a worker that was about to start, is of no use to anybody.
    """
    known = [name for name in logging.root.manager.loggerDict if name.split(".")[0] in _LOGGERS]
    for name in {*known, *_LOGGERS}:
        logger = logging.getLogger(name)
        logger.handlers = []
        logger.propagate = name not in _LOGGERS
        logger.setLevel(logging.WARNING if name in _LOGGERS else logging.NOTSET)
    handler = _File(path, delay=True)
    handler.setFormatter(logging.Formatter("%(asctime)s %(name)s %(levelname)s %(message)s"))
    for name in _LOGGERS:
        logging.getLogger(name).handlers = [handler]
    try:
        yield
    finally:
        for name in _LOGGERS:
            logging.getLogger(name).handlers = [logging.NullHandler()]
        handler.close()


def _close(opened: Any) -> None:
    with suppress(Exception):
        opened.close(timeout=CLOSE_S)


def _remove(folder: Path) -> None:
    import shutil

    shutil.rmtree(folder, ignore_errors=True)
