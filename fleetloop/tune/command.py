"""`fleetloop tune`: from a tuning's file to its best gains.

tuning.toml, base.toml, base.json    the tuning as it was begun
trials.journal                       Optuna's storage
trials/trial-*.parquet               the rows of each trial's cases, as a study has them
check/trial-*.parquet                those of the other cases, of baseline and best
best.toml, best_study.toml, tune.json, tune.html, figures/
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bridge.process.clock import SYSTEM_CLOCK
from bridge.process.lifecycle import Stop
from configs.errors import ExitStatus, ScenarioError
from fleetloop.results import run_folder
from fleetloop.results.publication import write_figures
from fleetloop.results.summary import finite, to_json
from fleetloop.signals import stop_on_signals
from fleetloop.sweep.cases import Cases
from fleetloop.sweep.extra import require
from fleetloop.sweep.options import Ways
from fleetloop.terminal import note, say, say_json
from fleetloop.tune import results, scores
from fleetloop.tune.evaluation import Evaluation, evaluation_of, is_here
from fleetloop.tune.figures import all_figures
from fleetloop.tune.page import page
from fleetloop.tune.plan import TUNING, TuningPlan
from fleetloop.tune.progress import Meter
from fleetloop.tune.results import BASELINE_NAME, BEST_NAME
from fleetloop.tune.rows import rows_kept, write_rows
from fleetloop.tune.scores import Trial
from fleetloop.tune.storage import Asked, Storage, alone, optuna_here, storage_of
from fleetloop.tune.tables import Judged, print_table
from fleetloop.tune.tuning import Tuning, differences

TRIALS, CHECK, PAGE = "trials", "check", "tune.html"


def begin(source: str, trials: int | None, seed: int | None, out: Path | None, ways: Ways) -> int:
    """Begin a tuning; return its exit status.

    Raises:
        ScenarioError: the file, its base or an option is wrong; nothing was started.
        InfrastructureError: a file or a process can't be had.
    """
    _require(ways)
    plan = TuningPlan.of(source, trials=trials, seed=seed)
    cases = plan.check(source)
    created = run_folder.create(f"{Path(source).stem}-tune", out, SYSTEM_CLOCK.wall_ns())
    plan.save(created.path)
    return _go(created.path, plan, cases, ways)


def resume(
    folder: Path, source: str | None, trials: int | None, seed: int | None, ways: Ways
) -> int:
    """Go on with the tuning of a folder; return its exit status.

    Args:
        folder: of the tuning.
        source: its file again; another one is refused.
        trials: more than it was begun with.
        seed: none may be given: it would be another tuning.
        ways: how.

    Raises:
        ScenarioError: there is none, or it is another one.
        InfrastructureError: a file or a process can't be had.
    """
    _require(ways)
    plan = TuningPlan.resume(folder)
    if seed is not None and seed != plan.tuning.seed:
        raise ScenarioError(f"--seed {seed}: this tuning was begun with seed {plan.tuning.seed}")
    if source is not None:
        given = TuningPlan.of(source, seed=seed)
        found = differences(plan.tuning, given.tuning)
        if given.base.text != plan.base.text:
            found.append(f"the base {given.base.source} has changed")
        if found:
            raise ScenarioError(
                f"{source}: not the tuning of {folder}: {'; '.join(found)}; begin a new one"
            )
        trials = given.tuning.trials if trials is None else trials
    if trials is not None and trials != plan.tuning.trials:
        if trials < plan.tuning.trials:
            raise ScenarioError(f"--trials {trials}: it was begun with {plan.tuning.trials}")
        plan = TuningPlan.resume(folder, trials=trials)
        plan.save(folder)
    return _go(folder, plan, plan.check(str(folder / TUNING)), ways)


def _require(ways: Ways) -> None:
    """Refuse to go on without the packages of the extra.

    Raises:
        ScenarioError: one isn't installed.
    """
    optuna_here()
    dask = () if is_here(ways.place) else ("distributed",)
    require("pyarrow", "scipy", *dask, verb="tune")


# --- the work -------------------------------------------------------------------------------------


@dataclass(slots=True)
class Search:
    """The trials of a tuning, one after the other."""

    folder: Path
    plan: TuningPlan
    storage: Storage
    trials: list[Trial] = field(default_factory=list)
    """That are done."""
    meter: Meter | None = None
    ended: str = "all trials are done"
    workers: int = 1

    @property
    def tuning(self) -> Tuning:
        """What is asked."""
        return self.plan.tuning

    @property
    def best(self) -> Trial | None:
        """Of the trials that are done."""
        return scores.best(self.tuning, self.trials)

    def go(self, evaluation: Evaluation, stop: Stop) -> None:
        """Do trials until there are enough, or told to stop."""
        budget_s = self.tuning.stop.budget_s
        began_s = SYSTEM_CLOCK.monotonic_s()
        while len(self.trials) < self.tuning.trials and not stop.requested:
            if budget_s is not None and SYSTEM_CLOCK.monotonic_s() - began_s >= budget_s:
                self.ended = f"budget_s = {budget_s:g} s is over"
                break
            self._one(self.storage.ask(len(self.trials)), evaluation, stop)
        if stop.requested:
            self.ended = "interrupted"

    def _one(self, asked: Asked, evaluation: Evaluation, stop: Stop) -> None:
        known = next((one.score for one in self.trials if one.values == asked.values), None)
        if known is None:
            rows = evaluation(self.plan.cases(asked.values), stop)
            if rows is None:
                self.storage.drop(asked)
                return
            write_rows(_path(self.folder, TRIALS, asked.number), rows)
            known = scores.score(self.tuning, rows)
            if self.tuning.invalid == "stop" and "invalid" in known.verdicts:
                self.storage.drop(asked)
                raise ScenarioError(
                    f'trial {asked.number}: {known.reason}; invalid = "stop": go on without such'
                    ' cases with invalid = "go on"'
                )
        self.trials.append(self.storage.tell(asked, known))
        if self.meter is not None:
            self.meter.advance(len(self.trials), self.best)
            self.meter.show()

    def judged(self) -> list[Judged]:
        """Baseline, if there is one, and best."""
        best = self.best
        if best is None:
            return []
        found = [Judged(BASELINE_NAME, self.trials[0])] if self.tuning.baseline else []
        return [*found, Judged(BEST_NAME, best)]

    def checked(self, evaluation: Evaluation, stop: Stop) -> list[Judged]:
        """The same, judged on the other cases."""
        found = []
        for one in self.judged():
            number = one.trial.number
            path = _path(self.folder, CHECK, number)
            rows = rows_kept(path)
            if rows is None and not stop.requested:
                rows = evaluation(self.plan.cases(one.trial.values, check=True), stop)
                if rows is not None:
                    write_rows(path, rows)
            if rows is None:
                return self.judged()
            found.append(one._replace(checked=scores.score(self.tuning, rows)))
        return found


def _path(folder: Path, kind: str, number: int) -> Path:
    return folder / kind / f"trial-{number:05d}.parquet"


def _go(folder: Path, plan: TuningPlan, cases: Cases, ways: Ways) -> int:
    tuning, place = plan.tuning, ways.place
    with alone(folder), stop_on_signals() as stop, storage_of(folder, tuning) as storage:
        search = Search(folder, plan, storage, storage.done())
        began_s = SYSTEM_CLOCK.monotonic_s()
        with (
            Meter(tuning.title, tuning.trials, len(search.trials), quiet=ways.as_json) as meter,
            evaluation_of(place, folder, meter.notice, meter.show, kernel=ways.kernel) as evaluate,
        ):
            search.meter = meter
            meter.advance(len(search.trials), search.best)
            meter.begin()
            search.go(evaluate, stop)
            judged = search.judged()
            if tuning.check_cases is not None and not stop.requested:
                meter.check()
                judged = search.checked(evaluate, stop)
            search.workers = evaluate.workers
        if stop.requested:
            search.ended = "interrupted"
            note(f"{stop.reason}: go on with fleetloop tune --resume {folder}")
        wall_s = SYSTEM_CLOCK.monotonic_s() - began_s
        _finish(search, judged, cases, ways, wall_s)
    if stop.requested:
        return ExitStatus.INTERRUPTED
    best = search.best
    return ExitStatus.OK if best is not None and best.score.feasible else ExitStatus.FAILED


# --- the end --------------------------------------------------------------------------------------


def _finish(
    search: Search, judged: Sequence[Judged], cases: Cases, ways: Ways, wall_s: float
) -> None:
    folder, plan, best = search.folder, search.plan, search.best
    if best is None:
        note(f"no trial is done ({search.ended}): go on with fleetloop tune --resume {folder}")
        return
    importances = search.storage.importances()
    said = results.sentences(plan, best, judged)
    command = results.command(plan, best.values, cases.base.names)
    numbers = results.numbers(
        plan,
        search.trials,
        judged,
        ended=search.ended,
        said=said,
        importances=importances,
        command=command,
        wall_s=round(wall_s, 3),
        workers=search.workers,
    )
    told = finite(numbers)
    run_folder.write(folder / results.NUMBERS, to_json(numbers))
    text = _best(search, best, cases)
    if ways.as_json:
        say_json(told | {"folder": str(folder)})
    else:
        _say(search, judged, said, command, wall_s)
    if search.ended != "interrupted":
        values = _of_cases(search, judged)
        figures = all_figures(search.tuning, search.trials, best, importances, values)
        drawn = write_figures(folder, figures)
        html = page(search.tuning, search.trials, judged, said, text, drawn)
        run_folder.write(folder / PAGE, html)
        if not ways.as_json:
            say(f"page     {folder / PAGE}")


def _best(search: Search, best: Trial, cases: Cases) -> str:
    """Write the best gains; without a feasible trial none are there to be taken for good."""
    folder, plan = search.folder, search.plan
    paths = (folder / results.BEST, folder / results.STUDY)
    if not best.score.feasible:
        for path in paths:
            path.unlink(missing_ok=True)
        return "There are none: no trial meets every constraint."
    text = results.best_toml(plan, best, cases.base.names, folder)
    for path, content in zip(paths, (text, results.best_study(plan, best)), strict=True):
        run_folder.write(path, content)
    return text


def _say(
    search: Search, judged: Sequence[Judged], said: Sequence[str], command: str, wall_s: float
) -> None:
    tuning, folder, best = search.tuning, search.folder, search.best
    print_table(tuning, judged)
    for text in said:
        say(text)
    done = len(search.trials)
    feasible = sum(trial.score.feasible for trial in search.trials)
    say(
        f"trials   {done} of {tuning.trials}, {feasible} feasible, {tuning.total} cases each;"
        f" {search.ended}; {wall_s:.1f} s"
    )
    engines = sorted({name for trial in search.trials for name in trial.score.engines})
    say(f"engine   {', '.join(engines)}")
    say(f"run      {command}")
    if best is not None and best.score.feasible:
        say(f"gains    {folder / results.BEST}, cases {folder / results.STUDY}")


def _of_cases(search: Search, judged: Sequence[Judged]) -> dict[str, list[float | None]]:
    """The objective's quantity in each case, of trials whose rows are there."""
    found = {}
    for one in judged:
        rows = rows_kept(_path(search.folder, TRIALS, one.trial.number))
        if rows is not None:
            found[one.name] = scores.column(rows, search.tuning.objective)
    return found
