"""`fleetloop diff`: compares two runs bit for bit."""

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from configs.errors import ExitStatus
from fleetloop.record.reader import Record
from fleetloop.results.run_folder import read_record
from fleetloop.terminal import say


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
    """The first difference, None if all values have the same bits.

    What a record that isn't all there lacks at its end is no difference.
    """
    if a.robots != b.robots:
        return Difference(0, "(all)", "record", "robots", a.robots, b.robots)
    first: Difference | None = None
    for robot in a.robots:
        for source in ("plant", "controller"):
            rows_a, rows_b = getattr(a, source)[robot], getattr(b, source)[robot]
            found = _first(robot, source, rows_a, rows_b)
            if found is None and len(rows_a) != len(rows_b):
                shorter = a if len(rows_a) < len(rows_b) else b
                if not shorter.lost:
                    found = _ended(robot, source, len(rows_a), len(rows_b))
            if found is not None and (first is None or found.tick < first.tick):
                first = found
    return first


def print_comparison(a: Path, b: Path, *, as_json: bool, partial: bool = False) -> int:
    """Compare two runs, print the result, return the exit status.

    Raises:
        ScenarioError: one of them has no record.
        IncompleteError: one isn't all there, and `partial` wasn't asked for.
    """
    record_a, record_b = read_record(a, partial=partial), read_record(b, partial=partial)
    difference = compare(record_a, record_b)
    if as_json:
        first = difference._asdict() if difference is not None else None
        lost = [record_a.lost, record_b.lost]
        say(json.dumps({"identical": not difference, "first_difference": first, "lost": lost}))
    elif difference is None:
        whole = "every signal, bit for bit"
        if record_a.lost or record_b.lost:
            whole = "every signal that both have, bit for bit"
        say(f"identical: {_common(record_a, record_b)}, {whole}")
    else:
        say(f"different from {difference}")
    return ExitStatus.OK if difference is None else ExitStatus.FAILED


def _first(robot: str, source: str, a: np.ndarray, b: np.ndarray) -> Difference | None:
    both = min(len(a), len(b))
    if a.dtype != b.dtype:
        return Difference(0, robot, source, "signals", *_unlike(a, b))
    bits_a = np.ascontiguousarray(a[:both]).view("<u8").reshape(both, len(a.dtype.names or ()))
    bits_b = np.ascontiguousarray(b[:both]).view("<u8").reshape(both, len(b.dtype.names or ()))
    rows, columns = np.nonzero(bits_a != bits_b)
    if len(rows):
        row = int(rows[0])
        name = (a.dtype.names or ())[int(columns[0])]
        tick = int(a["tick"][row])
        return Difference(tick, robot, source, name, a[name][row].item(), b[name][row].item())
    return None


def _unlike(a: np.ndarray, b: np.ndarray) -> tuple[str, str]:
    """The signals that only one of both has; their order if that is all."""
    of_a, of_b = a.dtype.names or (), b.dtype.names or ()
    only_a, only_b = (
        [name for name in one if name not in other] for one, other in ((of_a, of_b), (of_b, of_a))
    )
    return ", ".join(only_a or of_a), ", ".join(only_b or of_b)


def _ended(robot: str, source: str, a: int, b: int) -> Difference:
    return Difference(min(a, b), robot, source, "number of ticks", a, b)


def _common(a: Record, b: Record) -> str:
    """Number of compared ticks."""
    ticks = {robot: min(len(a.plant[robot]), len(b.plant[robot])) for robot in a.robots}
    if len(set(ticks.values())) == 1:
        return f"{ticks[a.robots[0]]} ticks of {len(ticks)} robots"
    return ", ".join(f"{count} ticks of {robot}" for robot, count in ticks.items())
