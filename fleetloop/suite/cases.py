"""Runs scenarios in processes of their own, within bounds of time, and takes their outcomes.

A run in one process takes one processor; as many go on side by side as there are, or as are wanted.
A run over processes, as real time and faults of processes need it, goes on alone. A run that takes
too long is asked to end, then killed; what it started ends with it.
"""

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import Stop
from configs.errors import ExitStatus, InfrastructureError, ScenarioError
from configs.loading import load
from configs.overrides import Overrides
from configs.scenario import Scenario
from fleetloop import packages
from fleetloop.results.outcome import Outcome, of_error, unbegun
from fleetloop.signals import limited

GRACE_S = 5.0
"""For a run that was asked to end."""
_LOOK_EVERY_S = 0.2
_MOST_SAID = 2000
"""Characters of what a process without outcome said last."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """Bounds of wall time [s], and of what goes on at a time."""

    each_s: float
    total_s: float
    at_once: int


@dataclass(frozen=True, slots=True)
class Case:
    """A scenario and how it runs."""

    source: str
    folder: Path
    """Of its run."""
    alone: bool = False
    """Over processes, and nothing beside it."""
    refused: ScenarioError | None = None


def case_of(
    source: str, folder: Path, overrides: Overrides, *, processes: bool, within_s: float
) -> Case:
    """A scenario as it will run; `processes`: over processes also where that isn't needed.

    One that takes longer to load, as with a module of the user's own that never ends, is refused.
    """
    try:
        with limited(within_s, f"{source}: to load it"):
            scenario = load(source, overrides)
    except ScenarioError as error:
        return Case(source, folder, refused=error)
    except TimeoutError as error:
        return Case(source, folder, refused=ScenarioError(str(error)))
    return Case(source, folder, alone=processes or needs_processes(scenario))


def needs_processes(scenario: Scenario) -> bool:
    """Whether a scenario has what one process can't do: real time, faults of processes."""
    of_processes = any(fault.PLACE == "process" for fault in scenario.fault)
    return scenario.clock.mode == "realtime" or of_processes


class _Running:
    """A case in its process."""

    def __init__(self, case: Case, overrides: Sequence[str], limit_s: float, clock: Clock) -> None:
        self.case, self._clock = case, clock
        self._said: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `finish`
        self._noted: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115
        where = "processes" if case.alone else "in-process"
        command = [sys.executable, "-P", "-m", "fleetloop.suite.worker", str(os.getpid())]
        try:
            # In a session of its own Ctrl-C reaches the caller alone.
            self._process = subprocess.Popen(
                [*command, case.source, str(case.folder), where, *overrides],
                stdin=subprocess.DEVNULL,
                stdout=self._said,
                stderr=self._noted,
                start_new_session=True,
                env=packages.environment(),
            )
        except OSError as error:
            self._said.close()
            self._noted.close()
            raise InfrastructureError(f"can't start a run: {error.strerror or error}") from error
        self.fd = os.pidfd_open(self._process.pid)
        self.began_s = clock.monotonic_s()
        self.until_s = self.began_s + limit_s
        self._why, self._interrupted = "", False

    @property
    def asked(self) -> bool:
        """Whether it was asked to end."""
        return bool(self._why)

    def ended(self) -> bool:
        """Whether its process has ended."""
        return self._process.poll() is not None

    def end(self, why: str, *, interrupted: bool = False) -> None:
        """Ask it to end, or kill it if it was asked before."""
        self._process.send_signal(signal.SIGKILL if self._why else signal.SIGTERM)
        if not self._why:
            self._why, self._interrupted = why, interrupted
        self.until_s = self._clock.monotonic_s() + GRACE_S

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()
        self._process.wait()
        self.finish()

    def finish(self) -> Outcome:
        """Its outcome; the process has ended."""
        os.close(self.fd)
        took_s = self._clock.monotonic_s() - self.began_s
        said, noted = (_read(stream) for stream in (self._said, self._noted))
        outcome = _parsed(said)
        if outcome is None:
            last = noted.strip()[-_MOST_SAID:] or "it said nothing"
            reason = f"the run ended with status {self._process.returncode}: {last}"
            outcome = unbegun(self.case.source, "aborted", reason, ExitStatus.INFRASTRUCTURE)
        if self._why:
            outcome |= {"reason": self._why, **_ended(interrupted=self._interrupted)}
        return outcome | {"took_s": round(took_s, 3), "processes": self.case.alone}


def _ended(*, interrupted: bool) -> dict[str, Any]:
    """How a run counts that was ended, or not begun."""
    if interrupted:
        return {"verdict": "interrupted", "exit_status": int(ExitStatus.INTERRUPTED)}
    return {"verdict": "aborted", "exit_status": int(ExitStatus.INFRASTRUCTURE)}


def _read(stream: IO[bytes]) -> str:
    stream.seek(0)
    with stream:
        return stream.read().decode("utf-8", "replace")


def _parsed(said: str) -> Outcome | None:
    with contextlib.suppress(ValueError):
        outcome: Any = json.loads(said)
        if isinstance(outcome, dict) and "verdict" in outcome:
            return outcome
    return None


def run_cases(
    cases: Sequence[Case],
    overrides: Sequence[str],
    bounds: Bounds,
    stop: Stop,
    on_done: Callable[[Case, Outcome], None] = lambda *_: None,
    *,
    clock: Clock = SYSTEM_CLOCK,
) -> dict[str, Outcome]:
    """Run cases; their outcomes by source, in the order of the cases.

    Args:
        cases: one of each source.
        overrides: as `--set` takes them, of each.
        bounds: of time, and of runs at a time.
        stop: once requested, what runs is ended, and what waits isn't begun.
        on_done: told each outcome as it comes.
        clock: of the caller.

    Raises:
        InfrastructureError: a process can't be started.
    """
    done: dict[str, Outcome] = {}
    waiting = list(cases)
    running: list[_Running] = []
    over_s = clock.monotonic_s() + bounds.total_s
    over = f"--total {bounds.total_s:g} s was over"

    def take(case: Case, outcome: Outcome) -> None:
        done[case.source] = outcome
        on_done(case, outcome)

    try:
        while waiting or running:
            now_s = clock.monotonic_s()
            gone = stop.reason if stop.requested else (over if now_s >= over_s else "")
            if gone:
                how = _ended(interrupted=stop.requested)
                for case in waiting:
                    take(case, unbegun(case.source, reason=f"not run: {gone}", **how))
                waiting = []
            while waiting and _has_room(waiting[0], running, bounds.at_once):
                case = waiting.pop(0)
                if case.refused is not None:
                    take(case, of_error(case.source, case.refused))
                    continue
                running.append(_Running(case, overrides, bounds.each_s, clock))
            _await_one(running, _LOOK_EVERY_S)
            for one in list(running):
                if one.ended():
                    running.remove(one)
                    take(one.case, one.finish())
            _end_the_late(running, bounds, clock.monotonic_s())
            for one in running if gone else ():
                if not one.asked:
                    one.end(gone, interrupted=stop.requested)
    finally:
        for one in running:
            one.kill()
    return {case.source: done[case.source] for case in cases}


def _has_room(case: Case, running: Sequence[_Running], at_once: int) -> bool:
    if case.refused is not None:
        return True
    if case.alone or any(one.case.alone for one in running):
        return not running
    return len(running) < at_once


def _await_one(running: Sequence[_Running], within_s: float) -> None:
    """Wait until one has ended, at most so long."""
    poller = select.poll()
    for one in running:
        poller.register(one.fd, select.POLLIN)
    if running:
        poller.poll(within_s * 1e3)


def _end_the_late(running: Sequence[_Running], bounds: Bounds, now_s: float) -> None:
    """End those that have had their time."""
    for one in running:
        if now_s >= one.until_s:
            one.end(f"took longer than --timeout {bounds.each_s:g} s")
