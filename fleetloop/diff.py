"""`fleetloop diff`: are two runs the same, bit for bit?"""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fleetloop.record.reader import Record
from fleetloop.run_folder import record_of
from fleetloop.terminal import say

IDENTICAL, DIFFERENT = 0, 1


class Difference(NamedTuple):
    """The first difference of two records, in order of tick, robot, source, signal."""

    tick: int
    robot: str
    source: str
    field: str
    a: object
    b: object

    def __str__(self) -> str:
        return (
            f"tick {self.tick}, robot {self.robot}, {self.source} {self.field}:"
            f" {self.a!r} in A, {self.b!r} in B"
        )


def compare(a: Record, b: Record) -> Difference | None:
    """The first difference, None if all values have the same bits."""
    if a.robots != b.robots:
        return Difference(0, "(all)", "record", "robots", a.robots, b.robots)
    first: Difference | None = None
    for robot in a.robots:
        for source in ("plant", "controller"):
            rows_a, rows_b = getattr(a, source)[robot], getattr(b, source)[robot]
            found = _first(robot, source, rows_a, rows_b)
            if found is not None and (first is None or found.tick < first.tick):
                first = found
    return first


def print_comparison(a: Path, b: Path, *, as_json: bool) -> int:
    """Compare two runs, print the result, return the exit status.

    Raises:
        ScenarioError: one of them has no record.
    """
    record_a, record_b = Record.open(record_of(a)), Record.open(record_of(b))
    difference = compare(record_a, record_b)
    ticks = min((len(rows) for rows in record_a.plant.values()), default=0)
    if as_json:
        first = difference._asdict() if difference is not None else None
        say(json.dumps({"identical": difference is None, "first_difference": first}))
    elif difference is None:
        say(f"identical: {ticks} ticks of {len(record_a.robots)} robots, every signal, bit for bit")
    else:
        say(f"different from {difference}")
    return IDENTICAL if difference is None else DIFFERENT


def _first(robot: str, source: str, a: np.ndarray, b: np.ndarray) -> Difference | None:
    both = min(len(a), len(b))
    bits_a = np.ascontiguousarray(a[:both]).view("<u8").reshape(both, len(a.dtype.names or ()))
    bits_b = np.ascontiguousarray(b[:both]).view("<u8").reshape(both, len(b.dtype.names or ()))
    rows, columns = np.nonzero(bits_a != bits_b)
    if len(rows):
        row = int(rows[0])
        name = (a.dtype.names or ())[int(columns[0])]
        tick = int(a["tick"][row])
        return Difference(tick, robot, source, name, a[name][row].item(), b[name][row].item())
    if len(a) != len(b):
        return Difference(both, robot, source, "number of ticks", len(a), len(b))
    return None
