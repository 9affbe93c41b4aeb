"""The matrix in the terminal: kinds as rows, times as columns, the worst of all seeds in a cell."""

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from rich.markup import escape
from rich.table import Table

from configs.scenario import Scenario
from fleetloop.campaign.folder import Folder
from fleetloop.campaign.verdicts import Result, Verdict
from fleetloop.results.tables import table_box
from fleetloop.terminal import ResultConsole

LETTERS = {
    Verdict.REFUSED: "-",
    Verdict.HELD: "H",
    Verdict.RECOVERED: "R",
    Verdict.STOPPED: "S",
    Verdict.FAILED: "F",
    Verdict.DIVERGED: "D",
    Verdict.ERROR: "E",
}
_STYLES = {
    Verdict.REFUSED: "dim",
    Verdict.RECOVERED: "cyan",
    Verdict.STOPPED: "yellow",
    Verdict.FAILED: "bold red",
    Verdict.DIVERGED: "bold red",
    Verdict.ERROR: "bold magenta",
}
LEGEND = (
    "H held; R recovered, after so many seconds; S stopped: a robot stopped itself; F failed;"
    " D diverged; - refused: can't act here; E error"
)


def worst(results: Sequence[Result]) -> Result:
    """The worst of several seeds: by verdict, then by the time that it took to recover."""
    return max(results, key=lambda one: (one.verdict.rank, one.settle_s or 0.0, one.peak_m or 0.0))


def by_kind_and_time(results: Sequence[Result]) -> dict[str, dict[float, list[Result]]]:
    """Results of all seeds, by kind and time."""
    found: dict[str, dict[float, list[Result]]] = {}
    for result in results:
        cell = result.cell
        found.setdefault(cell.kind, {}).setdefault(cell.at_s, []).append(result)
    return found


def text_of(result: Result) -> str:
    """A cell: its letter, and of one that recovered the time."""
    letter = LETTERS[result.verdict]
    return letter if result.settle_s is None else f"{letter} {result.settle_s:.3g}"


def print_matrix(folder: Folder, scenario: Scenario, results: Sequence[Result]) -> None:
    """Print the matrix, its legend, and why cells are refused or in error."""
    console = ResultConsole(file=sys.stdout, highlight=False)
    console.print(title(folder, scenario), soft_wrap=True, markup=False)
    table = Table(box=table_box(), padding=(0, 1, 0, 0))
    table.add_column("fault", no_wrap=True)
    for at_s in folder.plan.times_s:
        table.add_column(f"{at_s:g} s", no_wrap=True)
    for kind, by_time in by_kind_and_time(results).items():
        cells = [kind]
        for at_s in folder.plan.times_s:
            one = worst(by_time[at_s]) if at_s in by_time else None
            text = "" if one is None else escape(text_of(one))
            style = None if one is None else _STYLES.get(one.verdict)
            cells.append(f"[{style}]{text}[/]" if style and text else text)
        table.add_row(*cells)
    console.print_whole(table)
    for line in (LEGEND, *notes(folder, results)):
        console.print(line, soft_wrap=True, markup=False)


def title(folder: Folder, scenario: Scenario) -> str:
    """The campaign in a line."""
    shared = folder.plan.conditions
    seeds = folder.plan.seeds
    worst_of = f", the worst of {len(seeds)} seeds" if len(seeds) > 1 else ""
    return f"{scenario.name}: faults of {', '.join(shared.robots)}{worst_of}"


def notes(folder: Folder, results: Sequence[Result]) -> Iterator[str]:
    """What isn't in the matrix: conditions, baselines that don't hold, reasons of refusals."""
    shared = folder.plan.conditions
    yield (
        f"faults last {shared.for_s:g} s, but for instants; within {shared.recover_s:g} s of their"
        " end all expectations must hold again"
    )
    for one in folder.baselines.values():
        if one.verdict != "held":
            yield f"WITHOUT A FAULT, seed {one.seed}: {one.verdict}: {one.reason}"
    said: dict[str, list[str]] = {}
    for result in results:
        if result.verdict in (Verdict.REFUSED, Verdict.ERROR):
            kinds = said.setdefault(f"{result.verdict}: {result.reason}", [])
            if result.cell.kind not in kinds:
                kinds.append(result.cell.kind)
    for reason, kinds in said.items():
        yield f"{', '.join(kinds)} {reason}"


def summary_line(results: Sequence[Result], wall_s: float) -> str:
    """Counts and the time that it took."""
    counts = Counter(result.verdict for result in results)
    listed = ", ".join(f"{counts[one]} {one}" for one in Verdict if counts[one])
    return f"{len(results)} cells: {listed}; {wall_s:.1f} s"


def described(
    folder: Folder, scenario: Scenario, results: Sequence[Result], wall_s: float
) -> dict[str, Any]:
    """campaign.json."""
    counts = Counter(result.verdict for result in results)
    return {
        "scenario": scenario.name,
        "plan": folder.plan.as_table(),
        "baselines": [asdict(one) for one in folder.baselines.values()],
        "counts": {one.value: counts[one] for one in Verdict},
        "cells": [result.as_table() for result in results],
        "wall_s": round(wall_s, 3),
    }
