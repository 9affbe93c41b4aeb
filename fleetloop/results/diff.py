"""`fleetloop diff`: compares two runs, bit for bit or with a tolerance, and ranks what differs."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from configs.errors import ExitStatus, ScenarioError
from configs.signals import PLANT_SIGNALS, Signal
from fleetloop.record.reader import Record
from fleetloop.results.divergence import (
    EXACT,
    SHOWN,
    Divergence,
    Pair,
    Tolerance,
    divergence_table,
    divergences,
)
from fleetloop.results.run_folder import read_record
from fleetloop.terminal import ResultConsole, say, say_json

SOURCES = ("plant", "controller")
MOST_UNLIKE = 8
"""Lines about robots, signals and ticks that only one run has."""


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


@dataclass(frozen=True, slots=True)
class Comparison:
    """How two records differ."""

    divergences: Sequence[Divergence]
    """Of the signals, robots and ticks that both have."""
    unlike: Sequence[Difference]
    """Robots, signals and ticks that only one has."""

    @property
    def first(self) -> Difference | None:
        """The first difference, None if there is none."""
        if self.divergences:
            one = self.divergences[0]
            place = one.first
            first = Difference(
                place.tick, place.robot, one.source, one.signal.name, place.a, place.b
            )
            return min((*self.unlike, first), key=lambda it: it.tick)
        return min(self.unlike, key=lambda it: it.tick, default=None)


def compare(a: Record, b: Record, tolerance: Tolerance = EXACT) -> Comparison:
    """Compare two records.

    What a record that isn't all there lacks at its end is no difference.

    Raises:
        ScenarioError: the tolerance is of a signal that neither has, or no robot is in both.
    """
    tables: dict[str, Sequence[Signal]] = {
        "plant": PLANT_SIGNALS,
        "controller": [one for r in (a, b) for table in r.signals.values() for one in table],
    }
    _check_tolerance(tolerance, {one.name for table in tables.values() for one in table})
    common = [robot for robot in a.robots if robot in b.robots]
    if not common:
        raise ScenarioError(
            f"no robot is in both: {', '.join(a.robots)} in A, {', '.join(b.robots)} in B"
        )
    unlike = []
    if a.robots != b.robots:
        unlike.append(Difference(0, "(all)", "record", "robots", *_only(a.robots, b.robots)))
    pairs = []
    for robot in common:
        for source in SOURCES:
            rows_a, rows_b = getattr(a, source)[robot], getattr(b, source)[robot]
            unlike += _unlike(robot, source, rows_a, rows_b)
            both = min(len(rows_a), len(rows_b))
            if len(rows_a) != len(rows_b) and not (a if len(rows_a) == both else b).lost:
                ended = (robot, source, "number of ticks", len(rows_a), len(rows_b))
                unlike.append(Difference(both, *ended))
            pairs.append(Pair(robot, source, rows_a[:both], rows_b[:both]))
    return Comparison(divergences(pairs, tables, tolerance), unlike)


def print_comparison(
    a: Path,
    b: Path,
    *,
    as_json: bool,
    partial: bool = False,
    tolerance: Tolerance = EXACT,
    size_first: bool = False,
    whole: bool = False,
) -> int:
    """Compare two runs, print the result, return the exit status.

    Args:
        a: a run.
        b: the other one.
        as_json: print it for programs.
        partial: take records that aren't all there.
        tolerance: up to which values are alike.
        size_first: rank signals by size, not by first divergence.
        whole: show every signal that differs.

    Raises:
        ScenarioError: one of them has no record, no robot is in both, or the tolerance is wrong.
        IncompleteError: one isn't all there, and `partial` wasn't asked for.
    """
    record_a, record_b = read_record(a, partial=partial), read_record(b, partial=partial)
    found = compare(record_a, record_b, tolerance)
    lost = [record_a.lost, record_b.lost]
    if as_json:
        say_json(_as_json(found, lost))
    elif found.first is None:
        kept = "every signal that both have" if any(lost) else "every signal"
        what = "within the tolerance" if tolerance else "identical"
        how = "" if tolerance else ", bit for bit"
        say(f"{what}: {_common(record_a, record_b)}, {kept}{how}")
    else:
        say(f"different from {found.first}")
        others = [one for one in found.unlike if one != found.first]
        for one in others[:MOST_UNLIKE]:
            say(f"also unlike: {one}")
        if len(others) > MOST_UNLIKE:
            say(f"also unlike: {len(others) - MOST_UNLIKE} more, in --json")
        if any(one.signal.name == "t_s" for one in found.divergences):
            say("tick k of A and tick k of B are at different times; compared tick by tick")
        print_divergences(found.divergences, ("A", "B"), size_first=size_first, whole=whole)
    return ExitStatus.OK if found.first is None else ExitStatus.FAILED


def print_divergences(
    found: Sequence[Divergence],
    labels: tuple[str, str],
    *,
    size_first: bool = False,
    whole: bool = False,
    of_one: bool = False,
) -> None:
    """Print the ranking of signals that differ, as `divergence_table`, and how many more."""
    if not found:
        return
    console = ResultConsole(file=sys.stdout, highlight=False)
    most = None if whole else SHOWN
    table = divergence_table(found, labels=labels, size_first=size_first, most=most, of_one=of_one)
    console.print_whole(table)
    if table.row_count < len(found):
        say(f"{len(found) - table.row_count} signals more differ; --all shows them")


def _as_json(found: Comparison, lost: Sequence[str]) -> dict[str, Any]:
    first = found.first
    return {
        "identical": first is None,
        "first_difference": None if first is None else first._asdict(),
        "unlike": [one._asdict() for one in found.unlike],
        "signals": [one.as_dict() for one in found.divergences],
        "lost": list(lost),
    }


def _check_tolerance(tolerance: Tolerance, recorded: set[str]) -> None:
    unknown = [name for name in tolerance.of_signal if name not in recorded]
    if unknown:
        raise ScenarioError(
            f"--tolerance {unknown[0]}={tolerance.of_signal[unknown[0]]:g}: no such signal; there"
            f" are {', '.join(sorted(recorded))}"
        )


def _unlike(robot: str, source: str, a: np.ndarray, b: np.ndarray) -> list[Difference]:
    """The signals that only one of both has; their order if that is all."""
    of_a, of_b = a.dtype.names or (), b.dtype.names or ()
    if of_a == of_b:
        return []
    return [Difference(0, robot, source, "signals", *_only(of_a, of_b))]


def _only(a: Sequence[str], b: Sequence[str]) -> tuple[str, str]:
    """Names that only one of both has, or all if they have the same in another order."""
    only_a, only_b = (
        [name for name in one if name not in other] for one, other in ((a, b), (b, a))
    )
    if not (only_a or only_b):
        return ", ".join(a), ", ".join(b)
    return ", ".join(only_a) or "none more", ", ".join(only_b) or "none more"


def _common(a: Record, b: Record) -> str:
    """Number of compared ticks."""
    ticks = {robot: min(len(a.plant[robot]), len(b.plant[robot])) for robot in a.robots}
    if len(set(ticks.values())) == 1:
        return f"{ticks[a.robots[0]]} ticks of {len(ticks)} robots"
    return ", ".join(f"{count} ticks of {robot}" for robot, count in ticks.items())
