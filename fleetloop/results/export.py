"""`fleetloop export`: a run as one table, a row per tick and robot.

    t_s      scenario time of the tick [s]
    robot    its name
    ...      signals by their names in the record, units in the names

Every robot has all its own rows, however early another ended; rows go by tick, then robot. Pose and
speeds are the plant's truth (heading not wrapped); the rest is what the controller used and
commanded. Where only one of both has a row (a controller that ended before the plant), the other's
signals are missing, as those of a law that another robot has: empty in .csv, NaN in .npz. In both
files NaN also says that a signal had no value, as `late_s` in lockstep.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from configs.errors import InfrastructureError, ScenarioError
from configs.signals import PLANT_SIGNALS
from fleetloop.record.reader import Record
from fleetloop.results.run_folder import read_record

ALL = "all"
_TRUTH = tuple(signal.name for signal in PLANT_SIGNALS)
DEFAULT = (
    *("x_m", "y_m", "theta_rad", "v_m_s", "omega_rad_s", "s", "s_dot", "v_r_hat"),
    *("x_e_m", "y_e_m", "theta_e_rad", "tau_right_wheel_N_m", "tau_left_wheel_N_m"),
)
_KEYS = ("t_s", "robot")

Table = dict[str, np.ma.MaskedArray]
"""Columns of equal length; masked where a source has no row."""


@dataclass(frozen=True, slots=True)
class Selection:
    """The part of a run to export. Default: the default signals, all robots, all times."""

    signals: Sequence[str] = ()
    robots: Sequence[str] = ()
    from_s: float | None = None
    to_s: float | None = None

    def columns(self, record: Record) -> tuple[str, ...]:
        """Names of the signals, in order, without time and robot.

        Raises:
            ScenarioError: one isn't recorded; it names those that are.
        """
        recorded = signals_of(record)
        unknown = [name for name in self.signals if name not in (*recorded, ALL)]
        if unknown:
            raise ScenarioError(
                f"--signals {','.join(unknown)}: no such signal; there are {', '.join(recorded)}"
            )
        chosen = recorded if ALL in self.signals else tuple(self.signals) or DEFAULT
        return tuple(name for name in dict.fromkeys(chosen) if name not in _KEYS)

    def numbers(self, record: Record) -> list[int]:
        """The chosen robots by their place in the record.

        Raises:
            ScenarioError: one isn't in the record; it names those that are.
        """
        unknown = [name for name in self.robots if name not in record.robots]
        if unknown:
            raise ScenarioError(
                f"--robots {','.join(unknown)}: no such robot in {record.path};"
                f" there are {', '.join(record.robots)}"
            )
        chosen = self.robots or record.robots
        return [n for n, robot in enumerate(record.robots) if robot in chosen]

    def within(self, t_s: np.ndarray) -> np.ndarray:
        """Which of these times are chosen; both ends count.

        Raises:
            ScenarioError: none of them is.
        """
        from_s = 0.0 if self.from_s is None else self.from_s
        to_s = np.inf if self.to_s is None else self.to_s
        if from_s > to_s:
            raise ScenarioError(f"--from {from_s:g}: must not be after --to {to_s:g}")
        chosen: np.ndarray = (t_s >= from_s) & (t_s <= to_s)
        if not chosen.any() and (self.from_s is not None or self.to_s is not None):
            asked = [f"--from {from_s:g}"] if self.from_s is not None else []
            asked += [f"--to {to_s:g}"] if self.to_s is not None else []
            there = (
                f"rows are from {t_s.min():g} to {t_s.max():g} s" if len(t_s) else "no row at all"
            )
            raise ScenarioError(f"{' '.join(asked)}: no row in that time; {there}")
        return chosen


def signals_of(record: Record) -> tuple[str, ...]:
    """Every signal of any robot of a record; `t_s` is in every table."""
    rows = (*record.plant.values(), *record.controller.values())
    return tuple(dict.fromkeys(name for each in rows for name in each.dtype.names or ()))


def table(record: Record, selection: Selection | None = None) -> Table:
    """The chosen columns, rows in order of tick, then robot.

    Raises:
        ScenarioError: something that was asked for isn't there.
    """
    selection = selection or Selection()
    names = selection.columns(record)
    numbers = selection.numbers(record)
    lengths = [_length(record, record.robots[number]) for number in numbers]
    order = np.lexsort(
        (np.repeat(numbers, lengths), np.concatenate([np.arange(n) for n in lengths]))
    )
    robots = np.repeat(np.array([record.robots[number] for number in numbers]), lengths)
    columns = {"t_s": _column(record, numbers, "t_s"), "robot": np.ma.MaskedArray(robots)}
    columns |= {name: _column(record, numbers, name) for name in names}
    order = order[selection.within(columns["t_s"].data[order])]
    return {name: column[order] for name, column in columns.items()}


def _length(record: Record, robot: str) -> int:
    return max(len(record.plant[robot]), len(record.controller[robot]))


def _column(record: Record, numbers: Sequence[int], name: str) -> np.ma.MaskedArray:
    """One signal of these robots, one after the other, each as long as its longer source."""
    values: list[np.ndarray] = []
    missing = []
    for number in numbers:
        robot = record.robots[number]
        rows = record.plant[robot] if name in _TRUTH else record.controller[robot]
        if name in ("t_s", "tick"):
            rows = max(record.plant[robot], record.controller[robot], key=len)
        length = _length(record, robot)
        if name not in (rows.dtype.names or ()):  # another law's
            values.append(np.zeros(length))
            missing.append(np.ones(length, bool))
            continue
        values += [rows[name], np.zeros(length - len(rows), rows.dtype[name])]
        missing.append(np.arange(length) >= len(rows))
    return np.ma.MaskedArray(np.concatenate(values), np.concatenate(missing))


def export(
    run: Path,
    target: Path,
    selection: Selection | None = None,
    *,
    force: bool = False,
    partial: bool = False,
) -> int:
    """Write the table of a run to a .csv or .npz file; return its number of rows.

    Raises:
        ScenarioError: no record there, another ending, an existing file without `force`, or
            something that was asked for isn't in the record.
        IncompleteError: the record isn't all there, and `partial` wasn't asked for.
        InfrastructureError: the file can't be written; an older one is as it was.
    """
    if target.suffix not in (".csv", ".npz"):
        raise ScenarioError(f"{target}: the ending must be .csv or .npz")
    if target.is_dir():
        raise ScenarioError(f"{target}: is a folder; name a file")
    if target.exists() and not force:
        raise ScenarioError(f"{target}: exists already; --force overwrites it")
    columns = table(read_record(run, partial=partial), selection)
    part = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        try:
            (_write_npz if target.suffix == ".npz" else _write_csv)(part, columns)
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise InfrastructureError(f"can't write {target}: {error.strerror or error}") from error
    return len(columns["t_s"])


def _write_npz(target: Path, columns: Table) -> None:
    filled = {
        name: column.filled(np.nan) if column.dtype.kind == "f" else column.data
        for name, column in columns.items()
    }
    with target.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **filled)


def _write_csv(target: Path, columns: Table) -> None:
    texts = [
        column.data if name == "robot" else map(_text, column.tolist())
        for name, column in columns.items()
    ]
    with target.open("w", encoding="ascii", newline="") as stream:
        stream.write(",".join(columns) + "\n")
        stream.writelines(",".join(row) + "\n" for row in zip(*texts, strict=True))


def _text(value: float | None) -> str:
    return "" if value is None else repr(value)
