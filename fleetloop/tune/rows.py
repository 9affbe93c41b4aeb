"""The rows of a trial's cases, in a file: whole or not there."""

import os
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

from configs.errors import InfrastructureError
from fleetloop.results import run_folder

if TYPE_CHECKING:
    import pyarrow as pa


def write_rows(path: Path, rows: "pa.Table") -> None:
    """Write rows.

    Raises:
        InfrastructureError: they can't be written, as with a full disk.
    """
    import pyarrow.parquet as pq

    run_folder.make_parents(path)
    unfinished = path.with_name(f".{path.name}.{uuid4().hex[:8]}")
    try:
        try:
            pq.write_table(rows, unfinished)
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else error
        raise InfrastructureError(
            f"can't write {path}: {why}; trials that were done before are kept,"
            f" go on with fleetloop tune --resume {path.parent.parent}"
        ) from error


def rows_kept(path: Path) -> "pa.Table | None":
    """The rows of a file; None if it isn't there, or is damaged: it is made again."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return pq.read_table(path)
    except (OSError, pa.ArrowException):
        return None
