"""The folder of a run's files: `runs/<time>-<scenario>/` or the folder that the user names."""

import contextlib
import os
from pathlib import Path
from typing import NamedTuple

from bridge.process.clock import local_date
from configs.errors import ExitStatus, FleetloopError, InfrastructureError, ScenarioError
from fleetloop.record import inputs_file, run_record
from fleetloop.record.reader import Record
from fleetloop.terminal import note

RECORD = run_record.RECORD
SCENARIO = "scenario.toml"
SUMMARY = "summary.json"
LAYOUT = "layout.json"


class IncompleteError(FleetloopError):
    """A record that isn't all there, where all of it was asked for."""

    exit_status = ExitStatus.FAILED


class Created(NamedTuple):
    """A run's folder."""

    path: Path
    new: tuple[Path, ...]  # it and its parents, innermost first, as far as they weren't there


def create(scenario_name: str, out: Path | None, started_ns: int) -> Created:
    """Make the run's folder; `started_ns` of the wall clock is in its name.

    Raises:
        ScenarioError: `out` exists and holds something already.
        InfrastructureError: the folder can't be made or written.
    """
    date = local_date(started_ns)
    folder = (
        out if out is not None else _fresh(Path("runs"), f"{date:%Y%m%d-%H%M%S}-{scenario_name}")
    )
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise ScenarioError(
                f"the run's folder {folder}: exists and is not an empty folder; name a new one"
            )
        new = tuple(path for path in (folder, *folder.parents) if not path.exists())
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(13, "Permission denied", str(folder))
    except OSError as error:
        why = error.strerror or error
        raise InfrastructureError(f"can't write the run's folder {folder}: {why}") from error
    return Created(folder, new)


def write(path: Path, content: str | bytes) -> None:
    """Write a file of the run: all of it is there, or what was there before.

    Raises:
        InfrastructureError: disk full, no right, ...
    """
    data = content.encode() if isinstance(content, str) else content
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        try:
            part.write_bytes(data)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise InfrastructureError(f"can't write {path}: {error.strerror or error}") from error


def make_parents(path: Path) -> None:
    """Make the folder that a file goes to.

    Raises:
        InfrastructureError: it can't be made.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InfrastructureError(f"can't make {path.parent}: {error.strerror or error}") from error


def discard(created: Created) -> None:
    """Remove the folder of a run that never began, and what was made for it."""
    can, inputs = created.path / run_record.CAN_FOLDER, created.path / inputs_file.FOLDER
    logs = (*can.glob("*.[bl][lo][fg]"), *inputs.glob("*.inputs"))
    with contextlib.suppress(OSError):
        for file in (*(created.path / name for name in (SCENARIO, RECORD, LAYOUT)), *logs):
            file.unlink(missing_ok=True)
    for folder in (can, inputs, *created.new):
        with contextlib.suppress(OSError):
            folder.rmdir()


def record_of(run: Path) -> Path:
    """The record of a run, named by its folder or by the record file itself.

    Raises:
        ScenarioError: there is none.
    """
    try:
        record = run / RECORD if run.is_dir() else run
        if record.is_dir():
            raise ScenarioError(f"{record}: a folder, not a record")
        if not record.is_file():
            raise ScenarioError(f"{run}: no {RECORD} there; name a run's folder or its record")
    except OSError as error:
        raise ScenarioError(f"{run}: {error.strerror or error}") from error
    return record


def read_record(run: Path, *, partial: bool) -> Record:
    """The record of a run; what is missing in it is said on standard error.

    Args:
        run: its folder, or the record file itself.
        partial: whether one that is cut or damaged will do, up to there.

    Raises:
        ScenarioError: there is none, or it is damaged and that won't do.
        IncompleteError: it isn't all there and that won't do.
    """
    record = Record.open(record_of(run), damaged=partial)
    if record.lost:
        text = f"{record.path}: {record.shortage()}"
        if not partial:
            raise IncompleteError(f"{text}; --partial takes that")
        note(text)
    return record


def _fresh(parent: Path, name: str) -> Path:
    folder = parent / name
    number = 2
    while folder.exists():
        folder = parent / f"{name}-{number}"
        number += 1
    return folder
