"""Runs of `fleetloop` as a process, for tests that look at them from outside."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import can
import psutil
from support.command_line import fleetloop

WAIT_S = 120.0


class Run:
    """A `fleetloop run` that is going on."""

    program: tuple[str, ...] = ("-m", "fleetloop")
    before: Sequence[str] = ()
    """Words before the command, as `ip netns exec HOST`."""

    def __init__(self, folder: Path, *args: str) -> None:
        self.folder = folder
        self._process = subprocess.Popen(
            [
                *self.before,
                sys.executable,
                *self.program,
                "run",
                *args,
                "--no-report",
                "--out",
                str(folder),
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"COLUMNS": "200"},
        )
        self.launcher = psutil.Process(self._process.pid)
        self._family: dict[int, psutil.Process] = {}
        self._texts = {"stdout": "", "stderr": ""}
        self._more = threading.Condition()
        self._readers = [
            threading.Thread(target=self._read, args=(name,), daemon=True) for name in self._texts
        ]
        for reader in self._readers:
            reader.start()

    def _read(self, name: str) -> None:
        for line in getattr(self._process, name):
            with self._more:
                self._texts[name] += line
                self._more.notify_all()

    def await_line(self, pattern: str, within_s: float) -> re.Match[str]:
        """Return when it has said a line like this on standard error."""
        line = re.compile(f"^{pattern}$", re.MULTILINE)
        with self._more:
            said = self._more.wait_for(lambda: line.search(self._texts["stderr"]), within_s)
        assert said is not None, self._texts
        return said

    def await_bus(self) -> can.BusABC:
        """Return the bus of r1 as soon as it is there."""
        deadline = time.monotonic() + WAIT_S
        while True:
            assert self._process.poll() is None, self.end()
            assert time.monotonic() < deadline
            try:
                return can.Bus(interface="fleetloop", channel="r1")
            except can.CanInitializationError:
                self.wait(0.02)

    def await_bus_time(self, seconds: float) -> None:
        """Return when the bus of r1 has reached this time: the countdown is over, rows flow."""
        with self.await_bus() as bus:
            while (message := bus.recv(WAIT_S)) is not None and message.timestamp < seconds:
                pass
        for child in self.launcher.children(recursive=True):
            self._family[child.pid] = child

    def wait(self, seconds: float) -> None:
        """Let it run, or stand still, for so long, or until it ends."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(seconds)

    def child(self, name: str) -> psutil.Process:
        """Its process of that name: plant, recorder, or a robot's controller."""
        return next(child for child in self._family.values() if _name(child) == name)

    def names(self) -> list[str]:
        """Names of all its processes but the launcher, sorted."""
        return sorted(_name(child) for child in self._family.values())

    def send(self, number: signal.Signals) -> None:
        """Send the launcher a signal."""
        self._process.send_signal(number)

    def end(self, within_s: float = WAIT_S) -> tuple[int, str]:
        """(exit status, all it printed), at most after `within_s`."""
        self._process.wait(within_s)
        # Children hold its standard error too; those of a killed launcher end a little later.
        for reader in self._readers:
            reader.join(10.0)
        return self._process.returncode, "".join(self._texts.values())

    def survivors(self, within_s: float = WAIT_S) -> list[psutil.Process]:
        """Processes of the run that still live."""
        _, alive = psutil.wait_procs(list(self._family.values()), timeout=within_s)
        return alive

    def summary(self) -> dict[str, Any]:
        """Its summary.json."""
        loaded: dict[str, Any] = json.loads((self.folder / "summary.json").read_text())
        return loaded

    def kill(self) -> None:
        """End everything that may be left, whatever happened."""
        for process in (self.launcher, *self._family.values()):
            if process.is_running():
                process.kill()
        if self._process.poll() is None:
            self._process.wait(WAIT_S)
        for reader in self._readers:
            reader.join(WAIT_S)
        for stream in (self._process.stdout, self._process.stderr):
            if stream is not None:
                stream.close()


def _name(process: psutil.Process) -> str:
    """The last word of what `ps` shows: "fleetloop plant", "fleetloop agent r1"."""
    return process.cmdline()[0].split()[-1]


@contextmanager
def running(folder: Path, *args: str, bus_time_s: float = 1.3) -> Iterator[Run]:
    """A run that has reached a bus time, and that is gone afterwards."""
    run = Run(folder, *args)
    try:
        run.await_bus_time(bus_time_s)
        yield run
    except BaseException as error:
        with suppress(subprocess.TimeoutExpired):
            error.add_note("the run: {}, {}".format(*run.end(5.0)))
        raise
    finally:
        run.kill()


def await_from(
    process: "subprocess.Popen[bytes]", reached: Callable[[], object], within_s: float = WAIT_S
) -> None:
    """Return as soon as something is reached, while this process lives."""
    deadline = time.monotonic() + within_s
    while not reached():
        assert process.poll() is None
        assert time.monotonic() < deadline
        with suppress(subprocess.TimeoutExpired):
            process.wait(0.05)


def completed(folder: Path, *args: str) -> tuple[int, str]:
    """Run to the end: (exit status, all it printed); one in process is one in this process."""
    if "--in-process" in args:
        done = fleetloop(folder.parent, "run", *args, "--no-report", "--out", str(folder))
        return done.returncode, done.stdout + done.stderr
    run = Run(folder, *args)
    try:
        return run.end()
    finally:
        run.kill()
