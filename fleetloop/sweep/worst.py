"""Whole runs of the worst cases: a run's folder each, as `fleetloop run --in-process` leaves it.

    worst/case-000017/   scenario.toml, record.mcap, summary.json

Worst are the cases that failed, those with the least margin first, and then the others by margin.
"""

import math
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from bridge.network.messages import Progress
from bridge.process.lifecycle import Stop
from configs.loading import to_toml
from fleetloop.jobs import pool
from fleetloop.jobs.job import Tell
from fleetloop.launch.conduct import Listener, run_in_process
from fleetloop.record.reader import Record
from fleetloop.results import run_folder
from fleetloop.results.summary import summarise, to_json
from fleetloop.sweep.cases import cases_of
from fleetloop.sweep.dataset import read
from fleetloop.sweep.plan import Plan

FOLDER = "worst"
_JUDGED = ("failed", "held", "not checked")


@dataclass(frozen=True, slots=True)
class WholeRun:
    """A job: one case again, with all that a run leaves."""

    plan: Plan
    number: int
    folder: Path

    def work(self, tell: Tell, stop: Stop) -> bool:
        """Run, write scenario.toml, record.mcap and summary.json; all are there, or no folder is.

        Raises:
            ScenarioError, InfrastructureError: the run could not start, or ended early.
        """
        cases = cases_of(self.plan)
        scenario = cases.scenario(cases.case(self.number))
        scenario = scenario.model_copy(update={"bus": replace(scenario.bus, record=())})
        unfinished = self.folder.with_name(f".{self.folder.name}")
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir(parents=True)

        def on_progress(progress: Progress) -> None:
            tell(progress)

        run_folder.write(unfinished / run_folder.SCENARIO, to_toml(scenario))
        listener = Listener(on_progress, lambda _: None, lambda *_: None)
        stats = run_in_process(scenario, unfinished, listener, stop)
        if not stop.requested:
            record = Record.open(unfinished / run_folder.RECORD)
            summary = to_json(summarise(record, scenario, stats))
            run_folder.write(unfinished / run_folder.SUMMARY, summary)
            unfinished.rename(self.folder)
        return True


def worst_of(folder: Path, most: int) -> list[int]:
    """Numbers of the worst cases of a study, the worst first."""
    table = read(folder, ["case", "verdict", "margin"])
    columns = [table.column(name).to_pylist() for name in ("case", "verdict", "margin")]
    judged = [row for row in zip(*columns, strict=True) if row[1] in _JUDGED]

    def rank(row: tuple[int, str, float | None]) -> tuple[bool, float, int]:
        number, verdict, margin = row
        return verdict != "failed", math.inf if margin is None else margin, number

    return [number for number, *_ in sorted(judged, key=rank)[:most]]


def missing_of(folder: Path, numbers: Sequence[int]) -> list[int]:
    """Those of these cases whose whole runs aren't there yet."""
    return [number for number in numbers if not _place(folder, number).exists()]


def keep_worst(plan: Plan, folder: Path, numbers: Sequence[int], stop: Stop) -> list[str]:
    """Run cases whole; what went wrong, a line each."""
    jobs = [WholeRun(plan, number, _place(folder, number)) for number in numbers]
    done = pool.work(jobs, stop)
    return [
        f"case {jobs[n].number}: its whole run: {brought}"
        for n, brought in sorted(done.items())
        if isinstance(brought, pool.Failed)
    ]


def _place(folder: Path, number: int) -> Path:
    return folder / FOLDER / f"case-{number:06d}"
