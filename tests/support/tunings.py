"""Tunings for tests: a tiny scenario, and evaluations whose rows follow from a formula."""

from collections.abc import Callable, Mapping
from pathlib import Path

import pyarrow as pa

from bridge.process.lifecycle import Stop
from fleetloop.sweep.cases import Cases
from fleetloop.sweep.dataset import Columns, Row
from fleetloop.sweep.draws import Value
from fleetloop.sweep.plan import Base
from fleetloop.tune.plan import TuningPlan
from fleetloop.tune.tuning import Tuning, loads

HEAD = """
schema = 1
title = "tiny"
base = "two_robots"
set = [
    "until_s=0.1",
    "expect.0.from_s=0.05", "expect.0.max_abs=9.0",
    "expect.1.from_s=0.05", "expect.1.max_abs=9.0",
]
design = "grid"
trials = 12
"""
SEEDS = '[[factor]]\nkey = "seed"\nintegers = [1, 2]\n'
P = '[[parameter]]\nkey = "coordination.p"\nuniform = [0.5, 4.0]\nbaseline = 3.0\n'
Q = '[[parameter]]\nkey = "coordination.q"\nlog_uniform = [0.01, 10.0]\nbaseline = 1.0\n'
PEAK = '[objective]\nquantity = "peak_x_e_m"\n'
TINY = HEAD + SEEDS + P + Q + PEAK
"""Two parameters, two cases a trial."""

Formula = Callable[[Mapping[str, Value], int], tuple[float | None, str]]
"""From the values of factors and parameters, and the number of a case: a value and a verdict."""


def bowl(values: Mapping[str, Value], number: int) -> tuple[float | None, str]:
    """Least, 0, at p = 2, q = 0.5."""
    return (float(values["p"]) - 2.0) ** 2 + (float(values["q"]) - 0.5) ** 2 + 0.0 * number, "held"


class Told:
    """An evaluation that computes nothing: rows by a formula, a stop after some trials."""

    def __init__(self, formula: Formula, stops_after: int | None = None) -> None:
        self.formula = formula
        self.left = stops_after
        self.asked: list[Mapping[str, Value]] = []

    def __call__(self, cases: Cases, stop: Stop) -> pa.Table | None:
        if self.left is not None:
            if self.left == 0:
                stop.request("told to stop")
                return None
            self.left -= 1
        rows = []
        for number in range(cases.study.total):
            case = cases.case(number)
            value, verdict = self.formula(cases.shown(case), number)
            quantities = dict.fromkeys(cases.quantities.names, value)
            shown = cases.shown(case)
            rows.append(Row(number, shown, quantities, verdict, "", 0.0, "told", "", None, 0.0, ""))
        self.asked.append(rows[0].factors)
        return pa.Table.from_batches([Columns(cases).batch(rows)])


def tuning_of(text: str) -> Tuning:
    """The tuning of a text."""
    return loads("tuning.toml", text)


def plan_of(text: str) -> TuningPlan:
    """The plan of a text whose base is a shipped scenario."""
    tuning = tuning_of(text)
    return TuningPlan(tuning, Base.beside("tuning.toml", tuning.base))


def written(folder: Path, text: str) -> Path:
    """A file of this text."""
    path = folder / "tuning.toml"
    path.write_text(text, "utf-8")
    return path
