"""The tables of a tuning: baseline and best side by side, in the terminal and on the page."""

import sys
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from rich.markup import escape
from rich.table import Table

from fleetloop.results.tables import table_box
from fleetloop.sweep.draws import Value
from fleetloop.terminal import ResultConsole
from fleetloop.tune.scores import Score, Trial
from fleetloop.tune.tuning import Tuning

NONE = "none"


class Judged(NamedTuple):
    """A trial, and how it does on the other cases."""

    name: str
    trial: Trial
    checked: Score | None = None


def shown(value: Value | None) -> str:
    """A number with as many digits as matter."""
    if value is None:
        return NONE
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def told(trial: Trial) -> str:
    """The objective of a trial in words."""
    missed = "" if trial.score.feasible else ", not feasible"
    return f"{shown(trial.score.objective)} (trial {trial.number}{missed})"


def header(judged: Sequence[Judged]) -> list[str]:
    """Headers."""
    return ["", *(f"{one.name} (trial {one.trial.number})" for one in judged)]


def rows(tuning: Tuning, judged: Sequence[Judged]) -> Iterator[list[str]]:
    """Parameters, the objective, constraints, how cases ended; then the same of other cases."""
    for parameter in tuning.parameter:
        name = parameter.column
        yield [name, *(shown(one.trial.values[name]) for one in judged)]
    yield from _scores(tuning, [one.trial.score for one in judged], "")
    checked = [one.checked for one in judged if one.checked is not None]
    if len(checked) == len(judged):
        yield from _scores(tuning, checked, "other cases: ")


def _scores(tuning: Tuning, scores: Sequence[Score], prefix: str) -> Iterator[list[str]]:
    objective = tuning.objective
    label = f"{prefix}{objective.label}, {objective.direction}d"
    yield [label, *(shown(one.objective) for one in scores)]
    for demand in tuning.demands:
        cells = [
            f"{shown(one.constraints[demand.label])}"
            f"{'' if one.missed[demand.label] == 0.0 else ' missed'}"
            for one in scores
        ]
        yield [prefix + demand.label, *cells]
    yield [f"{prefix}cases that failed", *(f"{one.bad} of {one.cases}" for one in scores)]


def print_table(tuning: Tuning, judged: Sequence[Judged]) -> None:
    """Print baseline and best."""
    console = ResultConsole(file=sys.stdout, highlight=False)
    table = Table(title=tuning.title, box=table_box(), padding=(0, 1, 0, 0), pad_edge=False)
    first, *others = header(judged)
    table.add_column(first, no_wrap=True)
    for text in others:
        table.add_column(escape(text), justify="right", no_wrap=True)
    for cells in rows(tuning, judged):
        table.add_row(*map(escape, cells))
    console.print_whole(table)
