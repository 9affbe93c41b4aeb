"""`fleetloop compare`: several laws on one scenario, from its file to one page.

<out>/compare.html, compare.json, figures/    and a run's folder per law and seed
"""

import shutil
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from bridge.process.clock import SYSTEM_CLOCK
from configs.errors import ExitStatus, InfrastructureError, ScenarioError
from configs.faults.plan import process_fault_problem
from configs.loading import folder_of, load
from configs.overrides import Overrides
from configs.scenario import Scenario
from fleetloop.compare.claims import Verdict, claims
from fleetloop.compare.contenders import contenders, scenario_under
from fleetloop.compare.figures import all_figures
from fleetloop.compare.page import page
from fleetloop.compare.progress import RunBars
from fleetloop.compare.results import Row, described
from fleetloop.compare.runs import Planned, rows_of
from fleetloop.compare.tables import print_tables
from fleetloop.results import run_folder
from fleetloop.results.publication import write_figures
from fleetloop.results.summary import finite, to_json
from fleetloop.signals import stop_on_signals
from fleetloop.terminal import note, say, say_json

PAGE, NUMBERS = "compare.html", "compare.json"


@dataclass(frozen=True, slots=True)
class CompareOptions:
    """Options of the command line for a comparison."""

    laws: str
    seeds: tuple[int, ...] = ()
    overrides: Overrides = ()
    out: Path | None = None
    as_json: bool = False
    keep_records: bool = False


def compare(source: str, options: CompareOptions) -> int:
    """Run each law with each seed, save and print what came of it; return the exit status.

    Raises:
        ScenarioError: the scenario, a law or an option is wrong; nothing was started.
        InfrastructureError: a file or a process can't be had.
    """
    scenario = load(source, options.overrides)
    if problem := process_fault_problem(scenario):
        raise ScenarioError(f"{source}: {problem}; compare runs in one process: leave them out")
    if scenario.clock.mode == "realtime":
        raise ScenarioError(
            f'{source}: clock.mode = "realtime" would compare the machine, too; add'
            " --clock lockstep"
        )
    folder = folder_of(source)
    seeds = options.seeds or (scenario.seed,)
    planned = [
        Planned(one.label, seed, scenario_under(scenario, one, folder=folder, seed=seed))
        for one in contenders(options.laws)
        for seed in seeds
    ]
    created = run_folder.create(f"{scenario.name}-laws", options.out, SYSTEM_CLOCK.wall_ns())
    labels = [f"{p.label}, seed {p.seed}" if len(seeds) > 1 else p.label for p in planned]
    try:
        with (
            stop_on_signals() as stop,
            RunBars(labels, scenario.ends_at_s, quiet=options.as_json) as bars,
        ):
            keep = options.keep_records
            rows = rows_of(planned, created.path, folder, stop, bars.show, keep_records=keep)
    except InfrastructureError:
        _discard(created)
        raise
    if stop.requested:
        _discard(created)
        note(f"{stop.reason}: nothing was kept")
        return ExitStatus.INTERRUPTED
    _finish(scenario, rows, seeds, created.path, options)
    return ExitStatus.OK


def _finish(
    scenario: Scenario,
    rows: Sequence[Row],
    seeds: Sequence[int],
    out: Path,
    options: CompareOptions,
) -> None:
    found = claims(rows)
    numbers = finite(
        {
            "scenario": scenario.name,
            "seeds": list(seeds),
            "laws": described(rows),
            "claims": [one._asdict() | {"verdict": one.verdict.value} for one in found],
        }
    )
    if options.as_json:
        say_json(numbers | {"folder": str(out)})
    else:
        print_tables(scenario.name, rows, seeds)
        for one in found:
            if one.verdict is not Verdict.NOT_TESTABLE:
                say(f"{one.verdict.value:<13}  {one.claim} ({one.where}): {one.measured}")
    run_folder.write(out / NUMBERS, to_json(numbers))
    figures = write_figures(out, all_figures(rows, seeds[0]))
    run_folder.write(out / PAGE, page(scenario, rows, seeds, found, figures))
    if not options.as_json:
        say(f"page     {out / PAGE}")
        if _alike(rows):
            note("all seeds give the same: nothing in this scenario is random")


def _alike(rows: Sequence[Row]) -> bool:
    """Whether several seeds made no difference to any law."""
    several = [[run.measures for run in row.outcomes] for row in rows if len(row.outcomes) > 1]
    return bool(several) and all(one == each[0] for each in several for one in each)


def _discard(created: run_folder.Created) -> None:
    """Remove what an interrupted comparison has made."""
    for path in list(created.path.iterdir()):
        shutil.rmtree(path, ignore_errors=True)
    with suppress(OSError):
        for folder in created.new:
            folder.rmdir()
