"""The folder of a campaign: what is known so far, line by line, and what is made of it at the end.

    results.jsonl    a line of JSON each, as it comes: the plan, baselines, results of cells
    campaign.html, .json, .csv, .parquet    at the end

A campaign that was killed goes on from the lines that are whole; no cell is computed twice.
"""

import csv
import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from configs.errors import InfrastructureError, ScenarioError
from fleetloop.campaign.branches import Baseline
from fleetloop.campaign.matrix import Cell
from fleetloop.campaign.plan import Plan
from fleetloop.campaign.verdicts import Result
from fleetloop.results import run_folder
from fleetloop.results.summary import finite
from fleetloop.terminal import note

RESULTS = "results.jsonl"
COLUMNS = (
    "kind", "at_s", "seed", "verdict", "reason", "settle_s", "peak_m", "peak_robot", "peak_at_s",
    "notices", "command", "wall_s",
)  # fmt: skip


@dataclass(slots=True)
class Folder:
    """A campaign's folder, and what is known of its cells."""

    path: Path
    plan: Plan
    baselines: dict[int, Baseline] = field(default_factory=dict)
    results: dict[Cell, Result] = field(default_factory=dict)

    @classmethod
    def create(cls, path: Path, plan: Plan) -> "Folder":
        """Of a campaign that begins; the folder is there.

        Raises:
            InfrastructureError: it can't be written.
        """
        folder = cls(path, plan)
        folder._append("plan", plan.as_table())
        return folder

    @classmethod
    def resume(cls, path: Path) -> "Folder":
        """Of a campaign that goes on; a last line that isn't whole is cut off.

        Raises:
            ScenarioError: there is none, or its file is damaged.
            InfrastructureError: it can't be read or cut.
        """
        file = path / RESULTS
        try:
            data = file.read_bytes()
            whole = data[: data.rfind(b"\n") + 1]
            if len(whole) < len(data):
                with file.open("r+b") as opened:
                    opened.truncate(len(whole))
        except FileNotFoundError:
            raise ScenarioError(f"--resume {path}: no {RESULTS} there") from None
        except OSError as error:
            raise InfrastructureError(f"{file}: {error.strerror or error}") from error
        lines = whole.decode("utf-8", "replace").splitlines()
        try:
            first = json.loads(lines[0])
            folder = cls(path, Plan.from_table(first["plan"]))
            for line in lines[1:]:
                folder._take(json.loads(line))
        except (ValueError, KeyError, TypeError, IndexError) as error:
            raise ScenarioError(f"{file}: not a campaign's: {error!r}") from error
        return folder

    def add(self, said: Baseline | Result) -> None:
        """Keep what came.

        Raises:
            InfrastructureError: it can't be written.
        """
        if isinstance(said, Baseline):
            self.baselines[said.seed] = said
            self._append("baseline", asdict(said))
        else:
            self.results[said.cell] = said
            self._append("cell", said.as_table())

    def _take(self, table: dict[str, Any]) -> None:
        if "baseline" in table:
            kept = tuple(table["baseline"]["kept_from_s"])
            found = Baseline(**{**table["baseline"], "kept_from_s": kept})
            self.baselines[found.seed] = found
        else:
            result = Result.from_table(table["cell"])
            self.results[result.cell] = result

    def _append(self, name: str, table: dict[str, Any]) -> None:
        line = json.dumps({name: finite(table)}, ensure_ascii=False, allow_nan=False) + "\n"
        file = self.path / RESULTS
        try:
            with file.open("ab") as opened:
                opened.write(line.encode())
        except OSError as error:
            raise InfrastructureError(f"can't write {file}: {error.strerror or error}") from error


# --- at the end -----------------------------------------------------------------------------------


def write_tables(path: Path, results: Sequence[Result]) -> None:
    """campaign.csv, and campaign.parquet if pyarrow is there.

    Raises:
        InfrastructureError: one can't be written.
    """
    run_folder.write(path / "campaign.csv", _csv(results))
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        note(
            "campaign.parquet: not written, pyarrow isn't installed: pip install fleetloop[parquet]"
        )
        return
    text, number = pa.string(), pa.float64()
    types = dict.fromkeys(COLUMNS, text)
    types |= dict.fromkeys(("at_s", "settle_s", "peak_m", "peak_at_s", "wall_s"), number)
    types["seed"] = pa.int64()
    rows = list(_rows(results))
    table = pa.table(
        {column: pa.array([row[column] for row in rows], types[column]) for column in COLUMNS}
    )
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink)
    run_folder.write(path / "campaign.parquet", sink.getvalue().to_pybytes())


def _rows(results: Sequence[Result]) -> Iterable[dict[str, Any]]:
    for result in results:
        table = finite(result.as_table())
        yield {**table, "notices": "; ".join(result.notices)}


def _csv(results: Sequence[Result]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(_rows(results))
    return text.getvalue()
