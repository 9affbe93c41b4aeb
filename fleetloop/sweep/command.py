"""`fleetloop sweep`: a study, from its file to its dataset.

study.toml, base.toml, base.json   the study as it was begun
parts/part-*.parquet               a row per case, as they come
worst/case-*/                      whole runs of the worst cases
sweep.json                         counts, failure rate and its interval, how long it took
"""

import shutil
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bridge.process.clock import SYSTEM_CLOCK
from bridge.process.lifecycle import Stop
from configs.errors import ExitStatus, FleetloopError, InfrastructureError, ScenarioError
from fleetloop.results import run_folder
from fleetloop.results.summary import finite, to_json
from fleetloop.signals import stop_on_signals
from fleetloop.sweep import study as studies
from fleetloop.sweep import theory
from fleetloop.sweep.cases import Cases
from fleetloop.sweep.cluster import client_of
from fleetloop.sweep.dataset import PARTS, Columns, Dataset, read
from fleetloop.sweep.engine import Engine, Pace
from fleetloop.sweep.extra import PACKAGES, require
from fleetloop.sweep.options import Ways
from fleetloop.sweep.plan import STUDY, Plan
from fleetloop.sweep.progress import Meter
from fleetloop.sweep.stopping import Tally, decided
from fleetloop.sweep.worst import FOLDER, keep_worst, missing_of, worst_of
from fleetloop.terminal import note, say, say_json

NUMBERS = "sweep.json"


def begin(source: str, cases: int | None, seed: int | None, out: Path | None, ways: Ways) -> int:
    """Begin a study; return its exit status.

    Raises:
        ScenarioError: the study, its base or an option is wrong; nothing was started.
        InfrastructureError: a file, a process or a cluster can't be had.
    """
    require(*PACKAGES)
    plan = Plan.of(source, cases=cases, seed=seed)
    checked = Cases(plan, source)
    name = f"{Path(source).stem}-sweep"
    created = run_folder.create(name, out, SYSTEM_CLOCK.wall_ns())
    plan.save(created.path)
    try:
        return _go(created.path, checked, ways)
    except FleetloopError:
        _discard_if_empty(created)
        raise


def _discard_if_empty(created: run_folder.Created) -> None:
    """Remove the folder of a study that has no row."""
    if not any((created.path / PARTS).glob("part-*")):
        for path in list(created.path.iterdir()):
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        with suppress(OSError):
            for folder in created.new:
                folder.rmdir()


def resume(folder: Path, cases: int | None, seed: int | None, ways: Ways) -> int:
    """Go on with the study of a folder; return its exit status.

    Args:
        folder: of the study.
        cases: more cases than it was begun with, of a design that can grow.
        seed: none may be given: it would be another study.
        ways: how.

    Raises:
        ScenarioError: there is none, or an option doesn't go with it.
        InfrastructureError: a file, a process or a cluster can't be had.
    """
    require(*PACKAGES)
    plan = Plan.resume(folder)
    if seed is not None and seed != plan.study.seed:
        raise ScenarioError(f"--seed {seed}: this study was begun with seed {plan.study.seed}")
    if cases is not None and cases != plan.study.total:
        plan = _grown(plan, cases)
        plan.save(folder)
    return _go(folder, Cases(plan, str(folder / STUDY)), ways)


def _grown(plan: Plan, cases: int) -> Plan:
    study = plan.study
    if study.design not in ("random", "sobol"):
        raise ScenarioError(
            f"--cases {cases}: this {study.design} was begun with {study.total} cases; only"
            " designs random and sobol can grow"
        )
    if cases < study.total:
        raise ScenarioError(f"--cases {cases}: this study was begun with {study.total}")
    grown = studies.loads(STUDY, plan.text, {"cases": cases})
    return Plan(grown.to_toml(), plan.base)


# --- the work -------------------------------------------------------------------------------------


@dataclass(slots=True)
class _Work:
    """A study that goes on: its rows as they come."""

    folder: Path
    cases: Cases
    ways: Ways
    dataset: Dataset
    tally: Tally
    began_s: float = field(default_factory=SYSTEM_CLOCK.monotonic_s)
    meter: Meter | None = None
    ended: str = ""
    """Why it ends before all cases are done, in words."""
    invalid: str = ""
    """Why the first case is invalid, where that ends the study."""
    wall_s: float = 0.0
    pace: Pace = field(default_factory=Pace)
    workers: int = 0

    def do(self, stop: Stop) -> None:
        """Compute what is left."""
        left = np.flatnonzero(~self.dataset.done)
        study = self.cases.study
        with Meter(
            study.title, study.total, study.total - len(left), quiet=self.ways.as_json
        ) as self.meter:
            if not len(left):
                return
            self.meter.show()
            with client_of(self.ways.place, self.folder) as client:
                self.meter.begin()
                engine = Engine(
                    client,
                    self.cases,
                    self.take,
                    self.meter.notice,
                    kernel=self.ways.kernel,
                    scheduler=self.ways.place.scheduler,
                )
                began_s = SYSTEM_CLOCK.monotonic_s()
                try:
                    engine.compute(map(int, left), len(left), stop, self.look)
                finally:
                    self.wall_s = SYSTEM_CLOCK.monotonic_s() - began_s
                    self.pace = engine.pace
                    self.workers = engine.most_threads

    def take(self, batch: Any) -> bool:
        """Keep rows that came; whether that's enough."""
        self.dataset.add(batch)
        numbers = batch.column("case").to_pylist()
        verdicts = batch.column("verdict").to_pylist()
        for number, verdict in zip(numbers, verdicts, strict=True):
            self.tally.add(number, verdict)
        if self.meter is not None:
            self.meter.advance(verdicts)
        if self.cases.study.invalid == "stop" and "invalid" in verdicts:
            self.invalid = batch.column("reason")[verdicts.index("invalid")].as_py()
            return True
        return self._is_decided()

    def look(self) -> None:
        """Called a few times a second."""
        if self.meter is not None:
            self.meter.show()

    def _is_decided(self) -> bool:
        passed_s = SYSTEM_CLOCK.monotonic_s() - self.began_s
        self.ended = decided(self.cases.study.stop, self.tally, passed_s)
        return bool(self.ended)


def _go(folder: Path, cases: Cases, ways: Ways) -> int:
    total = cases.study.total
    dataset = Dataset(folder, total, Columns(cases).schema)
    try:
        with stop_on_signals() as stop:
            work = _Work(folder, cases, ways, dataset, _tally_of(folder, total, dataset))
            work.do(stop)
            if work.invalid:
                raise ScenarioError(
                    f'{work.invalid}; invalid = "stop": go on without it with invalid = "go on"'
                )
            finished = work.ended != "" or bool(dataset.done.all())
            if not stop.requested and dataset.done.any():
                _keep_worst(work, stop)
            interrupted = stop.requested and not (finished and not cases.study.keep.worst)
            if interrupted:
                note(f"{stop.reason}: go on with fleetloop sweep --resume {folder}")
    finally:
        dataset.close()
    return _finish(work, interrupted)


def _keep_worst(work: _Work, stop: Stop) -> None:
    numbers = worst_of(work.folder, work.cases.study.keep.worst)
    missing = missing_of(work.folder, numbers)
    if missing and not work.ways.as_json:
        note(f"{work.cases.study.title}: whole runs of the worst cases: {len(missing)}")
    for line in keep_worst(work.cases.plan, work.folder, missing, stop):
        note(line)


def _tally_of(folder: Path, total: int, dataset: Dataset) -> Tally:
    """The verdicts that are there already."""
    tally = Tally(total)
    if dataset.done.any():
        table = read(folder, ["case", "verdict"])
        for number, verdict in zip(*(table.column(n).to_pylist() for n in (0, 1)), strict=True):
            if number < total:
                tally.add(number, verdict)
    return tally


# --- the end --------------------------------------------------------------------------------------


def _finish(work: _Work, interrupted: bool) -> int:
    numbers = _numbers(work, interrupted)
    try:
        run_folder.write(work.folder / NUMBERS, to_json(numbers))
    except InfrastructureError as error:
        note(str(error))
    if work.ways.as_json:
        say_json(finite(numbers) | {"folder": str(work.folder)})
    else:
        _say(work, numbers)
    if interrupted:
        return ExitStatus.INTERRUPTED
    return ExitStatus.FAILED if numbers["counts"].get("error") else ExitStatus.OK


def _numbers(work: _Work, interrupted: bool) -> dict[str, Any]:
    """sweep.json."""
    study = work.cases.study
    counts: Counter[str] = Counter()
    engines: Counter[str] = Counter()
    if work.dataset.done.any():
        table = read(work.folder, ["case", "verdict", "engine"])
        counts.update(table.column("verdict").to_pylist())
        engines.update(filter(None, table.column("engine").to_pylist()))
    rate = work.tally.rate(study.stop.confidence)
    everything = work.tally.rate_of_all(study.stop.confidence)
    shown = rate if study.stop.failure_rate_within is not None and work.ended else everything
    pace = work.pace
    against = []
    if study.theory is not None and work.dataset.done.any():
        columns = theory.of_table(read(work.folder, ["case", *theory.LABELS]))
        against = theory.agreements(study.theory.stability, columns)
    done = int(work.dataset.done.sum())
    return {
        "study": study.title,
        "base": work.cases.plan.base.source,
        "design": study.design,
        "cases": study.total,
        "done": done,
        "ended": "interrupted" if interrupted else work.ended or "all cases are done",
        "counts": dict(counts),
        "engines": dict(engines),
        "failure_rate": shown.value,
        # The points of a grid are no sample: their rate has no interval.
        "failure_rate_interval": None if study.design == "grid" else list(shown.interval),
        "confidence": study.stop.confidence,
        "judged": shown.judged,
        "theory": [one._asdict() for one in against],
        "computed": pace.cases,
        "wall_s": round(work.wall_s, 3),
        "cases_per_s": round(pace.cases / work.wall_s, 3) if work.wall_s > 0 else None,
        "workers": work.workers,
        "wait_ms_per_case": round(1e3 * pace.idle_s / pace.followed, 3) if pace.followed else None,
    }


def _say(work: _Work, numbers: dict[str, Any]) -> None:
    counts = ", ".join(f"{n} {verdict}" for verdict, n in numbers["counts"].items())
    told = f"{numbers['study']}: {numbers['done']} of {numbers['cases']} cases"
    say(f"{told}: {counts}" if counts else told)
    if work.ended:
        say(f"ended    {work.ended}")
    if numbers["judged"]:
        told = f"{100 * numbers['failure_rate']:.2f} % of {numbers['judged']} that held or failed"
        if numbers["failure_rate_interval"] is not None:
            least, most = numbers["failure_rate_interval"]
            told += f"; {100 * numbers['confidence']:g} % interval"
            told += f" {100 * least:.2f} to {100 * most:.2f} %"
        say(f"failed   {told}")
    for one in numbers["theory"]:
        say(f"theory   {theory.Agreement(**one).words}")
    if engines := ", ".join(f"{n} {engine}" for engine, n in numbers["engines"].items()):
        say(f"engine   {engines}")
    if work.pace.cases:
        say(
            f"took     {numbers['wall_s']:.1f} s with {numbers['workers']} workers:"
            f" {numbers['cases_per_s']:.1f} cases a second"
        )
    worst = sorted((work.folder / FOLDER).glob("case-*"))
    if worst:
        say(f"worst    {', '.join(map(str, worst))}")
    say(f"rows     {work.folder / PARTS}")
