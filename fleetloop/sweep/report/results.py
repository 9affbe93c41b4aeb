"""What a report reads: the rows of a study's folder, and what is known of the study.

A part that can't be read is named, and the others are used. A study at which another command is at
work, or that was interrupted, is reported as far as it is.
"""

import fcntl
import json
import os
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from configs.errors import FleetloopError, InfrastructureError, ScenarioError
from configs.wording import guess
from fleetloop.sweep import theory
from fleetloop.sweep.cases import Cases
from fleetloop.sweep.dataset import KEY, LOCK, PARTS, about
from fleetloop.sweep.extra import require
from fleetloop.sweep.plan import STUDY, Plan
from fleetloop.sweep.report.columns import Column, Series, of_texts, unit_of
from fleetloop.sweep.study import MEASURED, Condition

if TYPE_CHECKING:
    import pyarrow as pa

SUMMARY = "sweep.json"
"""Of the command that computed the study."""
FAILURE_RATE, UNSTABLE_RATE = "failure_rate", "unstable_rate"
RATES = FAILURE_RATE, UNSTABLE_RATE
"""Results that are 1 or 0 in a case, so that their means are shares of cases."""
MARGIN = "margin"


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """A study's rows and columns."""

    folder: Path
    table: "pa.Table"
    """All rows, by case."""
    told: dict[str, Any]
    """The dataset's metadata."""
    cases: Cases | None
    """None: its study or base can't be loaded, `no_cases` says why."""
    no_cases: str = ""
    damaged: tuple[str, ...] = ()
    """Parts that can't be read, and why."""
    running: bool = False
    """Whether another command is at work on it."""
    ended: str = ""
    """Why it ended, in words of the command that computed it."""
    factors: tuple[Column, ...] = ()
    derived: tuple[Column, ...] = ()
    """What theory makes of the factors."""
    quantities: tuple[Column, ...] = ()
    failed: Series = field(default_factory=lambda: np.empty(0))
    """1 failed, 0 held, NaN neither."""
    verdicts: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Of the study."""
        return str(self.told["study"])

    @property
    def total(self) -> int:
        """Cases of the study, done or not."""
        return int(self.told.get("cases", len(self)))

    def __len__(self) -> int:
        return int(self.table.num_rows)

    @property
    def counts(self) -> Counter[str]:
        """Cases by verdict."""
        return Counter(self.verdicts)

    @property
    def confidence(self) -> float:
        """Of intervals: the study's."""
        return self.cases.study.stop.confidence if self.cases else 0.95

    def texts(self, name: str) -> list[str]:
        """A column of texts; "" where there is none."""
        return [text or "" for text in self.table.column(name).to_pylist()]

    def texts_of(self, name: str) -> list[str]:
        """A column of any kind as texts."""
        return [str(value) for value in self.table.column(name).to_pylist()]

    def axis(self, option: str, name: str) -> Column:
        """The column that an option names for an axis.

        Raises:
            ScenarioError: there is none, or it is none for an axis.
        """
        known = {one.name: one for one in (*self.factors, *self.derived, *self.quantities)}
        fit = [one.name for one in known.values() if one.is_axis]
        if name not in known:
            raise ScenarioError(
                f"{option} {name}: no such column{guess(name, fit)}; there are {', '.join(fit)}"
            )
        column = known[name]
        if not column.varies:
            raise ScenarioError(f"{option} {name}: has one value in all cases; {_choose(fit)}")
        if not column.is_axis:
            raise ScenarioError(
                f"{option} {name}: {len(column.levels)} different texts are no axis; {_choose(fit)}"
            )
        return column

    def result(self, name: str) -> Column:
        """The column that `--color` names.

        Raises:
            ScenarioError: there is none, or it has no value.
        """
        known = {one.name: one for one in (*self.rates, *self.quantities)}
        with_values = [one.name for one in known.values() if np.isfinite(one.values).any()]
        if name not in known:
            raise ScenarioError(
                f"--color {name}: no such result{guess(name, with_values)};"
                f" there are {', '.join(with_values)}"
            )
        if name not in with_values:
            raise ScenarioError(f"--color {name}: has no value in any case; {_choose(with_values)}")
        return known[name]

    @property
    def failure_rate(self) -> Column:
        """As a result: its mean is the rate."""
        return Column(FAILURE_RATE, self.failed, symbol="failure rate")

    @property
    def condition(self) -> Condition | None:
        """Of theory, that each case was held against."""
        found: Condition | None = self.told.get("theory")
        return found

    @property
    def growths(self) -> dict[str, Series]:
        """Of a study that is held against theory: growth of each case by column [1/s]."""
        return theory.of_table(self.table)

    @property
    def rates(self) -> tuple[Column, ...]:
        """All results whose means are rates, the one that tells most first."""
        if self.condition is None:
            return (self.failure_rate,)
        measured = self.growths[MEASURED]
        grows = np.where(np.isnan(measured), np.nan, theory.grows(measured))
        return Column(UNSTABLE_RATE, grows, symbol="share of unstable cases"), self.failure_rate


def _choose(names: list[str]) -> str:
    return f"choose one of {', '.join(names)}" if names else "there is none: all cases are alike"


def results_of(folder: Path) -> Results:
    """The results of a study's folder.

    Raises:
        ScenarioError: it is none, or has no rows.
        InfrastructureError: no part of it can be read.
    """
    if not folder.is_dir():
        what = "is no folder" if folder.exists() else "no such folder"
        raise ScenarioError(f"{folder}: {what}; name the folder of a study")
    table, damaged = _read(folder)
    cases, why_not = None, ""
    try:
        cases = Cases(Plan.resume(folder), str(folder / STUDY))
    except FleetloopError as error:
        why_not = "; ".join(str(error).splitlines())
    told = about_of(table)
    verdicts = tuple(text or "" for text in table.column("verdict").to_pylist())
    return Results(
        folder,
        table,
        told,
        cases,
        why_not,
        damaged,
        running=_is_at_work(folder),
        ended=_ended(folder),
        factors=tuple(_factor(name, table, told, cases) for name in told["factors"]),
        quantities=tuple(_quantities(table, told)),
        failed=np.array([{"held": 0.0, "failed": 1.0}.get(one, np.nan) for one in verdicts]),
        verdicts=verdicts,
    )


def _read(folder: Path) -> tuple["pa.Table", tuple[str, ...]]:
    """All rows by case, one per case, and what is wrong with parts."""
    require("pyarrow")
    import pyarrow as pa
    import pyarrow.parquet as pq

    paths = sorted((folder / PARTS).glob("part-*.parquet"))
    if not paths:
        raise ScenarioError(
            f"{folder}: no study's folder, or none of its cases is done: no {PARTS}/part-*.parquet"
        )
    tables: list[pa.Table] = []
    damaged: list[str] = []
    for path in paths:
        try:
            table = pq.read_table(path)
            about_of(table)
            if tables and not table.schema.equals(tables[0].schema):
                raise ValueError(f"its columns aren't those of {paths[0].name}")  # noqa: TRY301
            tables.append(table)
        except FileNotFoundError:
            continue  # a command at work has replaced it
        except (OSError, pa.ArrowException, ValueError, TypeError, KeyError) as error:
            damaged.append(f"{path}: {' '.join(str(error).split())}")
    if not tables:
        raise InfrastructureError(f"no part can be read: {'; '.join(damaged)}")
    # Of a study that has grown the parts of later have more cases in their metadata.
    latest = max(tables, key=lambda table: about_of(table).get("cases", 0))
    whole = pa.concat_tables(tables).replace_schema_metadata(latest.schema.metadata)
    _, first = np.unique(whole.column("case").to_numpy(), return_index=True)
    if not len(first):
        raise ScenarioError(f"{folder}: its parts have no rows")
    return whole.take(first), tuple(damaged)


def about_of(table: "pa.Table") -> dict[str, Any]:
    """What the columns of a table are.

    Raises:
        ValueError: it is none of a study.
    """
    if KEY not in (table.schema.metadata or {}):
        raise ValueError("not of a study: no metadata `fleetloop`")
    return about(table)


def _is_at_work(folder: Path) -> bool:
    """Whether another process has the dataset open for adding."""
    try:
        lock = os.open(folder / LOCK, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(lock)
    return False


def _ended(folder: Path) -> str:
    try:
        told = json.loads((folder / SUMMARY).read_text("utf-8"))
        return str(told["ended"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _factor(name: str, table: "pa.Table", told: dict[str, Any], cases: Cases | None) -> Column:
    keys = told.get("keys", {}).get(name, [])
    column = table.column(name)
    if str(column.type) == "string":
        return of_texts(name, column.to_pylist())
    sections = cases.study.factor if cases else ()
    section = next((one for one in sections if one.column == name), None)
    log = section is not None and bool(section.log_uniform or (section.range and section.range.log))
    exact = told.get("design") == "grid"
    return Column(name, _numbers(column), unit_of(name, keys), log=log, exact=exact)


def _quantities(table: "pa.Table", told: dict[str, Any]) -> list[Column]:
    found = []
    for one in told["quantities"]:
        symbol = one.get("meaning") and f"margin of: {one['meaning']}"
        symbol = symbol or theory.LABELS.get(one["name"], "")
        values = _numbers(table.column(one["name"]))
        found.append(Column(one["name"], values, one["unit"], symbol=symbol or ""))
    units = {one["unit"] for one in told["quantities"] if one.get("meaning")}
    symbol = "least margin of the expectations"
    if told.get("theory"):
        units.add("1/s")
        symbol = "margin of theory" if units == {"1/s"} else symbol
    unit = units.pop() if len(units) == 1 else ""
    return [*found, Column(MARGIN, _numbers(table.column(MARGIN)), unit, symbol=symbol)]


def _numbers(column: Any) -> Series:
    """Numbers; what is none, or infinite, is NaN."""
    values = np.array(column.to_numpy(), dtype=np.float64)
    return np.where(np.isfinite(values), values, np.nan)
