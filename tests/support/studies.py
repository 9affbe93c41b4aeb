"""Studies for tests: their texts, their plans, and folders with their rows."""

from collections.abc import Sequence
from pathlib import Path

from fleetloop.sweep.batch import Kernel, rows_of
from fleetloop.sweep.cases import Cases
from fleetloop.sweep.dataset import Columns, Dataset
from fleetloop.sweep.plan import Base, Plan
from fleetloop.sweep.study import loads
from fleetloop.sweep.watch import Watch

SHORT = """
schema = 1
title = "short"
base = "two_robots"
set = [
    "until_s=0.1",
    "expect.0.from_s=0.05", "expect.0.max_abs=0.2",
    "expect.1.from_s=0.05", "expect.1.max_abs=0.2",
]
"""
"""The head of a study whose cases are 50 ticks of two robots."""
MASS = """
[[factor]]
name = "mass_kg"
key = "robot_types.etsro.body_mass_kg"
uniform = [1.0, 4.0]
"""
P = """
[[factor]]
key = "coordination.p"
values = [0.5, 1.0, 2.0]
"""
FEW = "[keep]\nquantities = []\n"


def plan_of(text: str) -> Plan:
    """The plan of a study's text, whose base is a shipped scenario."""
    study = loads("study.toml", text)
    return Plan(study.to_toml(), Base.beside("study.toml", study.base))


def cases_of(text: str) -> Cases:
    """The cases of a study's text."""
    return Cases(plan_of(text))


def study_folder(
    folder: Path, text: str, numbers: Sequence[int] | None = None, kernel: Kernel | None = None
) -> Path:
    """A folder with the rows of a study, one case after the other; all if none are named."""
    plan = plan_of(text)
    cases = Cases(plan)
    folder.mkdir(parents=True, exist_ok=True)
    plan.save(folder)
    columns = Columns(cases)
    dataset = Dataset(folder, cases.study.total, columns.schema)
    try:
        chosen = range(cases.study.total) if numbers is None else numbers
        dataset.add(columns.batch(rows_of(cases, chosen, Watch(300.0), kernel)))
    finally:
        dataset.close()
    return folder


def opened(folder: Path) -> Dataset:
    """The dataset of a folder with a study, as a command has it that is at work."""
    cases = Cases(Plan.resume(folder))
    return Dataset(folder, cases.study.total, Columns(cases).schema)
