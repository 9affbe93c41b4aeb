"""`fleetloop sweep` as a process, and Dask clusters beside it, for tests that look from outside."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import distributed
import psutil
import pyarrow.parquet

WAIT_S = 150.0
_LOOK_S = 0.05


class Sweep:
    """A `fleetloop sweep` that is going on."""

    def __init__(self, folder: Path, *words: str, out: str = "out") -> None:
        self.out = folder / out
        where = () if "--resume" in words else ("--out", out)
        self.errors = folder / f"{out}.stderr"
        with self.errors.open("ab") as errors:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "fleetloop", "sweep", *words, *where],
                cwd=folder,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                start_new_session=True,
                env=os.environ | {"COLUMNS": "200"},
            )
        self.main = psutil.Process(self._process.pid)

    def await_rows(self, count: int) -> None:
        """Return when so many cases have their rows."""
        for _ in range(int(WAIT_S / _LOOK_S)):
            if len(cases_in(self.out)) >= count:
                return
            assert self._process.poll() is None, self.errors.read_text()
            self._wait(_LOOK_S)
        raise AssertionError(f"not {count} rows in time: {self.errors.read_text()}")

    def await_workers(self, count: int) -> None:
        """Return when so many workers have begun to start."""
        for _ in range(int(WAIT_S / _LOOK_S)):
            if len(self.workers()) >= count:
                return
            assert self._process.poll() is None, self.errors.read_text()
            self._wait(_LOOK_S)
        raise AssertionError(f"not {count} workers in time: {self.errors.read_text()}")

    def workers(self) -> list[psutil.Process]:
        """Processes that compute, here."""
        return [
            child for child in self.family() if "resource_tracker" not in " ".join(_words(child))
        ]

    def family(self) -> list[psutil.Process]:
        """All its processes but itself."""
        return self.main.children(recursive=True)

    def kill(self) -> None:
        """End it without a chance to clean up."""
        self.main.kill()

    def interrupt(self) -> None:
        """Ctrl-C in its terminal: for all of its processes."""
        os.killpg(self._process.pid, signal.SIGINT)

    def end(self) -> tuple[int, str]:
        """(exit status, what it printed), within a bound."""
        out, _ = self._process.communicate(timeout=WAIT_S)
        return self._process.returncode, out

    def _wait(self, seconds: float) -> None:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(seconds)


@contextmanager
def sweeping(folder: Path, *words: str, out: str = "out") -> Iterator[Sweep]:
    """A sweep that is going on; at the end of the test it is over in any case."""
    sweep = Sweep(folder, *words, out=out)
    family = [sweep.main]
    try:
        yield sweep
    finally:
        with suppress(psutil.Error):
            family += sweep.family()
        for process in family:
            with suppress(psutil.Error):
                process.kill()
        psutil.wait_procs(family, timeout=10)


def cases_in(out: Path) -> list[int]:
    """The cases that have rows, as often as they have."""
    parts = sorted((out / "parts").glob("part-*.parquet"))
    return [
        case
        for part in parts
        for case in pyarrow.parquet.read_table(part, columns=["case"]).column("case").to_pylist()
    ]


@contextmanager
def cluster(
    folder: Path, workers: int, *, tls: tuple[str, ...] = (), **environment: str
) -> Iterator["Cluster"]:
    """A Dask scheduler with workers on loopback, each a process of its own.

    `tls`: files of an authority, a certificate and its key, in the folder.
    """
    made = Cluster(folder, tls)
    try:
        made.start(workers, environment)
        yield made
    finally:
        for process in made.processes:
            process.kill()
        for process in made.processes:
            process.wait(10)


class Cluster:
    """A scheduler and its workers."""

    def __init__(self, folder: Path, tls: tuple[str, ...] = ()) -> None:
        self._tls = [
            word
            for option, file in zip(("--tls-ca-file", "--tls-cert", "--tls-key"), tls, strict=False)
            for word in (option, file)
        ]
        self._file = folder / "scheduler.json"
        self._log = folder / "cluster.log"
        self.processes: list[subprocess.Popen[bytes]] = []

    @property
    def address(self) -> str:
        """Where the scheduler is."""
        address: str = json.loads(self._file.read_text())["address"]
        return address

    def await_workers(self, count: int) -> None:
        """Return when the scheduler has so many."""
        with distributed.Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(count, timeout=WAIT_S)

    def start(self, workers: int, environment: dict[str, str]) -> None:
        """Start it; its workers come as soon as they can."""
        file = ("--scheduler-file", str(self._file), "--no-dashboard", "--host", "127.0.0.1")
        port = ("--port", "0", "--dashboard-address", "127.0.0.1:0")
        protocol = ("--protocol", "tls") if self._tls else ()
        self._begin("scheduler", *file, *port, *protocol)
        for _ in range(int(WAIT_S / _LOOK_S)):
            if self._file.exists() and self._file.read_text().endswith("}"):
                break
            with suppress(subprocess.TimeoutExpired):
                self.processes[0].wait(_LOOK_S)
        for _ in range(workers):
            self._begin("worker", *file, "--nthreads", "1", "--no-nanny", **environment)

    def _begin(self, what: str, *words: str, **environment: str) -> None:
        with self._log.open("ab") as log:
            self.processes.append(
                subprocess.Popen(
                    [sys.executable, "-m", "dask", what, *words, *self._tls],
                    cwd=self._file.parent,
                    stdout=log,
                    stderr=log,
                    env=os.environ | environment,
                )
            )


def _words(process: psutil.Process) -> list[str]:
    try:
        return process.cmdline()
    except psutil.Error:
        return []
