"""The dataset of a study: one row per case, in Parquet files that are written as rows come.

    parts/part-*.parquet   some rows each, whole or not there
    columns                case; a factor each; a quantity each; verdict, reason, margin; engine,
                           engine_reason; seed; wall_s; command; version
    metadata               `fleetloop`, JSON: what the columns are

Any reader of Parquet opens the folder `parts` as one table. A case has one row: what was done is
never done again, and of what two commands have done the first row counts.
"""

import fcntl
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np

from configs.errors import InfrastructureError, ScenarioError
from fleetloop.sweep.cases import Cases
from fleetloop.sweep.draws import Graphs, Value
from fleetloop.sweep.extra import require
from fleetloop.terminal import note

if TYPE_CHECKING:
    import pyarrow as pa

PARTS, LOCK = "parts", ".lock"
FORMAT = 1
KEY = b"fleetloop"
VERDICTS = ("held", "failed", "not checked", "invalid", "error")


@dataclass(frozen=True, slots=True)
class Row:
    """What came of one case."""

    case: int
    factors: Mapping[str, Value]
    values: Mapping[str, float | None]
    """Its quantities."""
    verdict: str
    reason: str
    margin: float | None
    engine: str
    """"kernel", "in process"; "" if it wasn't run."""
    engine_reason: str
    """Why not by the kernel."""
    seed: int | None
    wall_s: float
    command: str


class Columns:
    """The columns of a study's dataset.

    Raises:
        ScenarioError: pyarrow isn't there.
    """

    def __init__(self, cases: Cases) -> None:
        pa = _arrow()
        quantities = cases.quantities
        self._factors = [one.name for one in cases.factors if one.name != "seed"]
        self._quantities = list(quantities.names)
        types = {one.name: _type(one.draw) for one in cases.factors}
        text, number, whole = pa.string(), pa.float64(), pa.int64()
        fields = [("case", whole), *((name, types[name]) for name in self._factors)]
        fields += [(name, number) for name in self._quantities]
        fields += [("verdict", text), ("reason", text), ("margin", number), ("engine", text)]
        fields += [("engine_reason", text), ("seed", whole), ("wall_s", number)]
        fields += [("command", text), ("version", text)]
        self.schema = pa.schema(fields, {KEY: json.dumps(_about(cases)).encode()})
        self._version = version("fleetloop")

    def batch(self, rows: Sequence[Row]) -> "pa.RecordBatch":
        """Rows as pyarrow has them."""
        pa = _arrow()
        columns: dict[str, list[Any]] = {"case": [row.case for row in rows]}
        for name in self._factors:
            columns[name] = [row.factors[name] for row in rows]
        for name in self._quantities:
            columns[name] = [_number(row.values.get(name)) for row in rows]
        for name in ("verdict", "engine", "seed", "wall_s", "command"):
            columns[name] = [getattr(row, name) for row in rows]
        for name in ("reason", "engine_reason"):  # which are anybody's, and may be no UTF-8
            texts = [getattr(row, name) for row in rows]
            columns[name] = [text.encode("utf-8", "backslashreplace").decode() for text in texts]
        columns["margin"] = [_number(row.margin) for row in rows]
        columns["version"] = [self._version] * len(rows)
        arrays = [
            pa.array(_told(columns[field.name], field.type), field.type) for field in self.schema
        ]
        return pa.RecordBatch.from_arrays(arrays, schema=self.schema)


class Dataset:
    """The dataset of a study's folder, open for adding; one process at a time has it so.

    Args:
        folder: of the study.
        total: how many cases it has.
        schema: of its columns.

    Raises:
        ScenarioError: another process has it.
        InfrastructureError: the folder can't be read or written.
    """

    def __init__(self, folder: Path, total: int, schema: "pa.Schema") -> None:
        self.parts = folder / PARTS
        self._folder = folder
        self.done = np.zeros(total, dtype=bool)
        """By number, whether a case has its row."""
        try:
            self.parts.mkdir(exist_ok=True)
            self._lock = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise InfrastructureError(f"can't write {folder}: {error.strerror or error}") from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(self._lock)
            raise ScenarioError(f"{folder}: another command is at work on this study") from None
        for left in self.parts.glob(".part-*"):  # of a command that was killed
            left.unlink(missing_ok=True)
        for path, numbers, flaw in _numbers(self.parts, total, schema):
            if flaw:
                note(f"{path}: {flaw}; its cases are computed again")
                with suppress(OSError):
                    path.replace(path.with_suffix(".damaged"))
            else:
                self.done[numbers] = True

    def add(self, batch: "pa.RecordBatch") -> None:
        """Keep rows; those of cases that have one already go.

        Raises:
            InfrastructureError: they can't be written, as with a full disk; nothing else is lost.
        """
        pa = _arrow()
        import pyarrow.parquet as pq

        numbers = batch.column("case").to_numpy()
        fresh = ~self.done[numbers]
        if not fresh.any():
            return
        if not fresh.all():
            batch = batch.filter(pa.array(fresh))
            numbers = numbers[fresh]
        name = f"part-{int(numbers.min()):08d}-{uuid4().hex[:8]}.parquet"
        unfinished = self.parts / f".{name}"
        try:
            try:
                pq.write_table(pa.Table.from_batches([batch]), unfinished)
                unfinished.replace(self.parts / name)
            finally:
                unfinished.unlink(missing_ok=True)
        except OSError as error:
            why = os.strerror(error.errno) if error.errno else error
            raise InfrastructureError(
                f"can't write {self.parts / name}: {why}; what was done before is kept,"
                f" go on with fleetloop sweep --resume {self._folder}"
            ) from error
        self.done[numbers] = True

    def close(self) -> None:
        """Let others have it."""
        os.close(self._lock)


def read(folder: Path, columns: Sequence[str] | None = None) -> "pa.Table":
    """All rows of a study's folder, by case; its metadata is in the schema (`about`).

    Args:
        folder: of the study.
        columns: `case` and others; all if not given.

    Raises:
        ScenarioError: there are none.
        InfrastructureError: a part can't be read.
    """
    pa = _arrow()
    import pyarrow.parquet as pq

    paths = sorted((folder / PARTS).glob("part-*.parquet"))
    if not paths:
        raise ScenarioError(f"{folder}: no rows of a study there ({PARTS}/part-*.parquet)")
    tables: list[Any] = []
    for path in paths:
        try:
            part = pq.read_table(path, columns=columns)
        except (OSError, pa.ArrowException) as error:
            said = f"{path}: {str(error).splitlines()[0]}"
            raise InfrastructureError(
                f"{said}; fleetloop sweep --resume {folder} sets it aside"
            ) from error
        if tables and not part.schema.equals(tables[0].schema):
            raise InfrastructureError(
                f"{path}: not of this study, its columns are others than those of {paths[0].name};"
                f" fleetloop sweep --resume {folder} sets it aside"
            )
        tables.append(part)
    table = pa.concat_tables(tables)
    cases = table.column("case").to_numpy()
    _, first = np.unique(cases, return_index=True)
    return table.take(first)


def about(table: "pa.Table") -> dict[str, Any]:
    """What the columns of a study's table are: format, study, base, factors, quantities."""
    found: dict[str, Any] = json.loads(table.schema.metadata[KEY])
    return found


def _numbers(
    parts: Path, total: int, schema: "pa.Schema"
) -> Sequence[tuple[Path, np.ndarray, str]]:
    """The cases of each part, and what is wrong with it; "" if nothing is."""
    pa = _arrow()
    import pyarrow.parquet as pq

    found: list[tuple[Path, np.ndarray, str]] = []
    for path in sorted(parts.glob("part-*.parquet")):
        numbers, flaw = np.empty(0, dtype=np.int64), ""
        try:
            if pq.read_schema(path).equals(schema):
                column = pq.read_table(path, columns=["case"]).column("case")
                flaw = "has rows without a case" if column.null_count else ""
                numbers = column.to_numpy()
            else:
                flaw = "not of this study: its columns are others"
        except (OSError, pa.ArrowException):
            flaw = "damaged"
        if not flaw and not ((numbers >= 0) & (numbers < total)).all():
            flaw = f"not of this study: its cases aren't within 0 to {total - 1}"
        found.append((path, numbers, flaw))
    return found


def _about(cases: Cases) -> dict[str, Any]:
    study, quantities = cases.study, cases.quantities
    kept = [{"name": one.name, "unit": one.unit} for one in quantities.statistics]
    kept += [{"name": name, "unit": "1/s"} for name in quantities.predicted]
    expected = zip(quantities.expected, quantities.units, quantities.claims, strict=True)
    kept += [{"name": name, "unit": unit, "meaning": said} for name, unit, said in expected]
    return {
        "format": FORMAT,
        "study": study.title,
        "description": study.description,
        "base": cases.plan.base.source,
        "design": study.design,
        "cases": study.total,
        "seed": study.seed,
        "factors": [one.name for one in cases.factors],
        "keys": {one.name: list(one.keys) for one in cases.factors},
        "quantities": kept,
        "theory": quantities.condition,
        "verdicts": list(VERDICTS),
    }


def _type(draw: Any) -> Any:
    """The type of a factor's column: whole numbers, numbers, else texts."""
    pa = _arrow()
    if isinstance(draw, Graphs):
        return pa.string()
    values = getattr(draw, "values", None)
    some = values if values is not None else (draw.at(0.5),)
    if all(isinstance(one, int) and not isinstance(one, bool) for one in some):
        return pa.int64()
    if all(isinstance(one, int | float) and not isinstance(one, bool) for one in some):
        return pa.float64()
    return pa.string()


def _told(values: list[Any], kind: Any) -> list[Any]:
    """Values of one column; texts of what is none, as true and false."""
    if kind != _arrow().string():
        return values
    return [
        one if isinstance(one, str) or one is None else json.dumps(one, ensure_ascii=False)
        for one in values
    ]


def _number(value: float | None) -> float | None:
    return None if value is None or np.isnan(value) else value


def _arrow() -> Any:
    """Of the extra `sweep` (`fleetloop.sweep.extra`).

    Raises:
        ScenarioError: it isn't there.
    """
    require("pyarrow")
    import pyarrow as pa

    return pa
