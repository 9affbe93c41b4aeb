"""`fleetloop.run`: a scenario to a `Run`, by the core of the command `fleetloop run`.

In process, the run is this thread's work. Over processes, its launcher is a process of its own:
this one opens no network session and keeps its signals and rights, so that a run is possible in
any thread, in a notebook and in a test. The launcher ends all of it when this process ends or
interrupts it, however that happens.
"""

import os
import shutil
import signal
import tempfile
import threading
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import inf
from pathlib import Path
from types import FrameType
from typing import NamedTuple

from bridge.network import messages
from bridge.process.lifecycle import Stop
from configs.errors import InfrastructureError, ScenarioError
from configs.events import Event
from configs.loading import load
from configs.scenario import Scenario
from fleetloop.api.result import Run
from fleetloop.jobs import pool
from fleetloop.jobs.job import Tell, Told
from fleetloop.launch.conclusion import conclude
from fleetloop.launch.conduct import (
    Listener,
    Manner,
    Words,
    carry_out,
    deployment_of,
    prepare,
)

END_S = 20.0
"""Longest time of an orderly end over processes, from Ctrl-C on."""
WORDS = Words(
    in_process="in_process=True",
    lockstep='in_process=False, or with_(clock={"mode": "lockstep"})',
    speed="speed =",
    deployment="deployment =",
    force="force=True",
    notes_are_told=False,
)


class Progress(NamedTuple):
    """How far a run is."""

    t_s: float
    """Scenario time [s]; below 0 in the countdown."""
    ends_at_s: float
    """Scenario time of the end [s]."""
    wall_s: float
    """Wall time since t = 0 [s]."""

    @property
    def share(self) -> float:
        """The part that is done, 0 to 1."""
        return min(max(self.t_s / self.ends_at_s, 0.0), 1.0)


def run(
    scenario: Scenario | str | os.PathLike[str],
    in_process: bool = True,
    *,
    out: str | os.PathLike[str] | None = None,
    speed: float = 0.0,
    deployment: str | os.PathLike[str] | None = None,
    force: bool = False,
    on_progress: Callable[[Progress], None] | None = None,
    on_event: Callable[[Event], None] | None = None,
) -> Run:
    """Run a scenario; return what it came to.

    The record is the same, bit for bit, in process and over processes.

    Args:
        scenario: a scenario, or the file or the name of a shipped one.
        in_process: all roles in this thread, without network and buses, or over processes as
            `fleetloop run` does; what real time or a fault of a process needs.
        out: the folder of the run, new or empty. None: a temporary one, gone with the `Run`;
            `Run.save` keeps a copy.
        speed: over processes, multiple of real time to hold a lockstep run to; 0: as fast as the
            machine allows.
        deployment: file that says where roles and buses are; over processes.
        force: run it despite errors that `fleetloop check` finds.
        on_progress: called about ten times a second and at the end, in this thread.
        on_event: called when something happens, in this thread.

    Raises:
        ScenarioError: the scenario or an argument is wrong; nothing was started.
        InfrastructureError: the run could not start, or left no record.
        KeyboardInterrupt: Ctrl-C; what was started is gone, a folder `out` has the record up to
            then.
    """
    loaded = scenario if isinstance(scenario, Scenario) else load(os.fspath(scenario))
    origin = loaded.origin
    source = loaded.name if origin is None else origin.source
    place = None if deployment is None else Path(deployment)
    manner = Manner(in_process=in_process, speed=_speed(speed), deployment=place, force=force)
    notes: list[str] = []
    prepare(source, loaded, manner, notes.append, words=WORDS)
    job = Launch(Told.of(loaded, "" if origin is None else origin.folder), _out(out), manner)
    far, happened = on_progress or (lambda _: None), on_event or (lambda _: None)

    def tell(said: object) -> None:
        match said:
            case messages.Progress(t_ns=t_ns, wall_ns=wall_ns):
                far(Progress(t_ns * 1e-9, loaded.ends_at_s, wall_ns * 1e-9))
            case Event():
                happened(said)

    with _kept(out, job.out), stop_on_interrupt() as stop:
        if in_process:
            job.carry_out(loaded, tell, stop)
        else:
            _over_processes(job, tell, stop)
        if stop.requested:
            raise KeyboardInterrupt(stop.reason)
        made = Run(job.out, partial=True, notes=notes)
    if on_progress is not None:
        done_s = made.summary.ticks * loaded.clock.control_period_s
        on_progress(Progress(done_s, loaded.ends_at_s, made.summary.wall_s))
    if out is None:
        weakref.finalize(made, shutil.rmtree, job.out, ignore_errors=True)
    return made


@dataclass(frozen=True, slots=True)
class Launch:
    """A run as a job: it tells `Progress` and `Event`."""

    told: Told
    out: Path
    manner: Manner

    def work(self, tell: Tell, stop: Stop) -> bool:
        """Run it over processes."""

        def tell_if_heard(said: object) -> None:
            with suppress(BrokenPipeError):  # it was interrupted, and ends in order
                tell(said)

        self.carry_out(self.told.scenario(), tell_if_heard, stop)
        return True

    def carry_out(self, scenario: Scenario, tell: Tell, stop: Stop) -> None:
        """Run it, leave its folder.

        Raises:
            ScenarioError: the folder isn't empty.
            InfrastructureError: it could not start, or left no record.
        """

        def on_progress(said: messages.Progress) -> None:
            tell(said)

        deployment = deployment_of(scenario, self.manner)
        listener = Listener(on_progress, tell, lambda *_: None)
        carried = carry_out(scenario, self.out, self.manner, deployment, listener, stop)
        stats = carried.stats
        if stats.began:
            if (unsaved := conclude(scenario, carried).unsaved) is not None:
                raise unsaved
        elif not stop.requested:
            raise InfrastructureError(f"{stats.ended}: {stats.reason}; the run did not begin")


def _over_processes(job: Launch, tell: Tell, stop: Stop) -> None:
    """Do the job in a process; its launcher bounds every wait of a run, so here is no bound.

    Raises:
        InfrastructureError: it could not start, or left no record.
    """

    def on_told(_: int, said: object) -> None:
        tell(said)

    def on_progress(far: dict[int, messages.Progress], _: object) -> None:
        if (said := far.pop(0, None)) is not None:
            tell(said)

    done = pool.work([job], stop, on_progress, on_told, silence_s=inf, grace_s=END_S)
    if isinstance(failed := done.get(0), pool.Failed):
        raise InfrastructureError(failed)


def _speed(speed: float) -> float:
    if not 0.0 <= speed < inf:
        raise ScenarioError(f"speed = {speed}: 0 (as fast as it goes) or a multiple of real time")
    return float(speed)


def _out(out: str | os.PathLike[str] | None) -> Path:
    return Path(tempfile.mkdtemp(prefix="fleetloop-") if out is None else out)


@contextmanager
def _kept(out: object, folder: Path) -> Iterator[None]:
    """Remove a temporary folder whose run comes to nothing."""
    try:
        yield
    except BaseException:
        if out is None:
            shutil.rmtree(folder, ignore_errors=True)
        raise


@contextmanager
def stop_on_interrupt() -> Iterator[Stop]:
    """In the main thread, Ctrl-C asks for an orderly stop while this lasts; again, it interrupts.

    A handler of the program's own stays: what it raises ends the run.
    """
    stop = Stop()
    main = threading.current_thread() is threading.main_thread()
    ours = main and signal.getsignal(signal.SIGINT) is signal.default_int_handler

    def request(_: int, __: FrameType | None) -> None:
        if stop.requested:
            raise KeyboardInterrupt
        stop.request("interrupted by SIGINT")

    if ours:
        signal.signal(signal.SIGINT, request)
    try:
        yield stop
    finally:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        for fd in (stop.wake_fd, stop.release_fd):
            with suppress(OSError):
                os.close(fd)
