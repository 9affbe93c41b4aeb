"""The signals of a run as one table, a row per tick and robot, for other libraries."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from configs.errors import InfrastructureError, ScenarioError
from configs.signals import Signal
from fleetloop.record.reader import Record
from fleetloop.results import export

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa


def columns_of(
    record: Record, signals: Sequence[str] | None, robots: Sequence[str] | None
) -> export.Table:
    """Time, robot and the chosen signals.

    Raises:
        ScenarioError: no such signal or robot.
    """
    for what, chosen, known in (
        ("signals", signals, export.signals_of(record)),
        ("robots", robots, record.robots),
    ):
        if isinstance(chosen, str):
            raise ScenarioError(f"{what} = {chosen!r}: a list of names, as [{chosen!r}]")
        if unknown := [name for name in chosen or () if name not in known]:
            raise ScenarioError(
                f"{what} = {list(chosen or ())}: no {', '.join(unknown)} in the record; there are"
                f" {', '.join(known)}"
            )
    names = (export.ALL,) if signals is None else tuple(signals)
    made = export.table(record, export.Selection(names, tuple(robots or ())))
    return made if names else {name: made[name] for name in ("t_s", "robot")}


def to_pandas(
    record: Record,
    units: Mapping[str, str],
    signals: Sequence[str] | None,
    robots: Sequence[str] | None,
) -> "pd.DataFrame":
    """The table of pandas."""
    try:
        import pandas as pd
    except ImportError as error:
        raise ImportError("pandas is not installed: pip install 'fleetloop[pandas]'") from error
    columns = columns_of(record, signals, robots)
    made = pd.DataFrame({name: _filled(column) for name, column in columns.items()})
    made["robot"] = pd.Categorical(made["robot"], categories=list(record.robots), ordered=True)
    made.attrs["units"] = {name: units[name] for name in columns if name in units}
    return made


def to_arrow(
    record: Record,
    about: Mapping[str, Signal],
    signals: Sequence[str] | None,
    robots: Sequence[str] | None,
) -> "pa.Table":
    """The table of Arrow; a signal that a robot doesn't have is null there."""
    try:
        import pyarrow as pa
    except ImportError as error:
        raise ImportError("pyarrow is not installed: pip install 'fleetloop[parquet]'") from error
    columns = columns_of(record, signals, robots)
    fields, arrays = [], []
    for name, column in columns.items():
        array = pa.array(column.data, mask=np.ma.getmaskarray(column))
        if name == "robot":
            array = array.dictionary_encode()
        signal = about.get(name)
        metadata = {"unit": signal.unit, "meaning": signal.meaning} if signal else None
        fields.append(pa.field(name, array.type, metadata=metadata))
        arrays.append(array)
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def write_parquet(table: "pa.Table", path: Path) -> Path:
    """Write a table as a Parquet file.

    Raises:
        InfrastructureError: it can't be written.
    """
    from pyarrow import parquet

    try:
        parquet.write_table(table, path)
    except OSError as error:
        raise InfrastructureError(f"can't write {path}: {error.strerror or error}") from error
    return path


def _filled(column: np.ma.MaskedArray) -> np.ndarray:
    made: np.ndarray = column.filled(np.nan) if column.dtype.kind == "f" else column.data
    return made
