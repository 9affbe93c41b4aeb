"""The recordings of a run: signals in `record.mcap`, buses in `can/`, input logs in `inputs/`."""

import contextlib
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

from configs.brief import NO_DRAWING, Drawing
from configs.errors import InfrastructureError
from configs.signals import Signal
from fleetloop.record import inputs_file
from fleetloop.record.can_log import CanLogWriter
from fleetloop.record.inputs_file import InputsFile
from fleetloop.record.writer import RecordWriter, Source

RECORD = "record.mcap"
CAN_FOLDER = "can"


class RunRecord:
    """Writes one run; a context manager that completes all files.

    Args:
        path: of the record; recordings of the buses go to the folder `can` beside it.
        robots: each with the table of its controller's rows.
        buses: names of the buses that are recorded.
        formats: "blf" and "log": Vector's format and candump's.
        inputs: robots whose controllers log their inputs.
        drawing: for the views of the record.

    Raises:
        InfrastructureError: a file can't be written; so do `add` and `traffic`.
    """

    def __init__(
        self,
        path: Path,
        robots: Mapping[str, Sequence[Signal]],
        scenario_toml: str,
        period_ns: int,
        *,
        buses: Sequence[str] = (),
        formats: Sequence[str] = (),
        inputs: Sequence[str] = (),
        drawing: Drawing = NO_DRAWING,
    ) -> None:
        self._inputs: dict[str, InputsFile] = {}
        self._logs: dict[str, CanLogWriter] = {}
        self._rows = RecordWriter(path, robots, scenario_toml, period_ns, drawing=drawing)
        try:
            if formats and buses:
                self._open_logs(_folder(path.parent / CAN_FOLDER), buses, formats)
            if inputs:
                _folder(path.parent / inputs_file.FOLDER)
            for robot in inputs:
                self._inputs[robot] = InputsFile(inputs_file.path_of(path.parent, robot))
        except InfrastructureError:
            self._discard(path.parent)
            raise

    def _open_logs(self, folder: Path, buses: Sequence[str], formats: Sequence[str]) -> None:
        for number, bus in enumerate(buses, 1):
            blf = folder / f"{bus}.blf" if "blf" in formats else None
            log = folder / f"{bus}.log" if "log" in formats else None
            self._logs[bus] = CanLogWriter(blf, log, channel=number, name=bus)

    def _discard(self, folder: Path) -> None:
        for file in self._beside():
            file.discard()
        self._rows.discard()
        for made in (folder / CAN_FOLDER, folder / inputs_file.FOLDER):
            with contextlib.suppress(OSError):
                made.rmdir()

    def _beside(self) -> tuple[CanLogWriter | InputsFile, ...]:
        return (*self._logs.values(), *self._inputs.values())

    def next_tick(self, robot: str, source: Source) -> int | None:
        """The tick of the row that a source owes next, as `RecordWriter.next_tick`."""
        return self._rows.next_tick(robot, source)

    @property
    def written(self) -> int:
        """Ticks of which every source has delivered, as `RecordWriter.written`."""
        return self._rows.written

    def add(self, robot: str, source: Source, first_tick: int, rows: bytes) -> None:
        """Add rows of consecutive ticks, as `RecordWriter.add`."""
        self._rows.add(robot, source, first_tick, rows)

    def note_lost(self, what: str) -> None:
        """Have the record say that something is missing in it."""
        self._rows.note_lost(what)

    def end(self, robot: str, source: Source) -> None:
        """Take note that no row of this source follows, as `RecordWriter.end`."""
        self._rows.end(robot, source)

    def traffic(self, bus: str, frames: bytes) -> None:
        """Add frames that crossed a bus, in the records of `bridge.network.telemetry.FRAME_ROW`."""
        self._logs[bus].write(frames)

    def next_input(self, robot: str) -> int:
        """Where the input log of a robot's controller goes on."""
        return self._inputs[robot].next_byte

    def inputs(self, robot: str, first: int, block: bytes, final: bool) -> None:
        """Add a block of a controller's input log, as `InputsFile.write`."""
        self._inputs[robot].write(first, block, final=final)

    def check_place(self) -> None:
        """See whether the files are where they were made, as `RecordWriter.check_place`."""
        self._rows.check_place()

    def flush(self) -> None:
        """Put the buses' frames so far into their files."""
        for log in self._logs.values():
            log.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        with ExitStack() as logs:
            for file in self._beside():
                logs.callback(file.close)
            self._rows.__exit__(kind, value, traceback)


def _folder(folder: Path) -> Path:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InfrastructureError(f"can't make {folder}: {error.strerror}") from error
    return folder
