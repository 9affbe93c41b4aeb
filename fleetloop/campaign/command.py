"""`fleetloop campaign`: faults by times by seeds on one scenario, from its file to a matrix."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from bridge.process.clock import SYSTEM_CLOCK
from bridge.process.lifecycle import Stop, keep_to_itself
from configs.errors import ExitStatus, ScenarioError
from configs.faults.base import Fault
from configs.faults.kinds import KINDS
from configs.loading import folder_of, load
from configs.scenario import Scenario
from fleetloop.campaign.branches import Baseline, Branches
from fleetloop.campaign.folder import Folder, write_tables
from fleetloop.campaign.junit import write_junit
from fleetloop.campaign.matrix import Cell, Kinds, cells_of, kinds_of, windows
from fleetloop.campaign.page import page
from fleetloop.campaign.plan import MOST_CELLS, Plan
from fleetloop.campaign.progress import Meter
from fleetloop.campaign.tables import described, print_matrix, summary_line
from fleetloop.campaign.verdicts import Result, Verdict
from fleetloop.campaign.whole import WholeRun
from fleetloop.jobs import pool
from fleetloop.jobs.job import Told
from fleetloop.json_lines import JsonLines
from fleetloop.results import run_folder
from fleetloop.results.summary import finite, to_json
from fleetloop.signals import stop_on_signals
from fleetloop.terminal import note, say, say_json

PAGE, NUMBERS = "campaign.html", "campaign.json"
_WHOLE_LIMIT_S = 60.0


@dataclass(frozen=True, slots=True)
class Ways:
    """How a campaign is carried out and told; none changes a verdict."""

    at_once: int | None = None
    as_json: bool = False
    junit: Path | None = None
    allowed: frozenset[Verdict] = frozenset({Verdict.HELD, Verdict.RECOVERED})
    json_lines: bool = False

    @property
    def quiet(self) -> bool:
        """Whether standard output is JSON."""
        return self.as_json or self.json_lines


def begin(plan: Plan, scenario: Scenario, out: Path | None, ways: Ways) -> int:
    """Begin a campaign; return its exit status.

    Raises:
        ScenarioError: the scenario, a kind or an option is wrong; nothing was started.
        InfrastructureError: a file or a process can't be had.
    """
    kinds = _checked(plan, scenario)
    created = run_folder.create(f"{scenario.name}-faults", out, SYSTEM_CLOCK.wall_ns())
    return _go(Folder.create(created.path, plan), scenario, kinds, ways)


def resume(path: Path, ways: Ways) -> int:
    """Go on with a campaign of a folder; return its exit status.

    Raises:
        ScenarioError: there is none, or its scenario is wrong.
        InfrastructureError: a file or a process can't be had.
    """
    folder = Folder.resume(path)
    scenario = load(folder.plan.source, folder.plan.given)
    return _go(folder, scenario, _checked(folder.plan, scenario), ways)


def _checked(plan: Plan, scenario: Scenario) -> Kinds:
    """The kinds that can act.

    Raises:
        ScenarioError: no campaign can be made of the scenario.
    """
    if scenario.clock.mode == "realtime":
        raise ScenarioError(
            f'{plan.source}: clock.mode = "realtime" would judge the machine, too; add'
            " --set clock.mode=lockstep"
        )
    if not scenario.expect:
        raise ScenarioError(f"{plan.source}: expects nothing, so nothing can fail: add [[expect]]")
    count = len(plan.kinds) * len(plan.times_s) * len(plan.seeds)
    if count > MOST_CELLS:
        raise ScenarioError(f"{count} cells: must be at most {MOST_CELLS}")
    found = kinds_of(
        scenario, plan.kinds, plan.times_s[0], plan.conditions, folder=folder_of(plan.source)
    )
    if not plan.in_process:
        return found
    needs = "needs processes: leave out --in-process"
    over = {kind: needs for kind, fault in found.faults.items() if fault.PLACE == "process"}
    faults = {kind: fault for kind, fault in found.faults.items() if kind not in over}
    return Kinds(faults, {**found.refused, **over})


def _go(folder: Folder, scenario: Scenario, kinds: Kinds, ways: Ways) -> int:
    plan, began_s = folder.plan, SYSTEM_CLOCK.monotonic_s()
    cells = list(cells_of(plan.kinds, plan.times_s, plan.seeds))
    left = [cell for cell in cells if cell not in folder.results]
    for cell in left:
        if cell.kind in kinds.refused:
            folder.add(Result(cell, Verdict.REFUSED, kinds.refused[cell.kind]))
    left = [cell for cell in left if cell not in folder.results]
    lines = JsonLines() if ways.json_lines else None
    if lines is not None:
        told = {"scenario": scenario.name, "folder": str(folder.path), "cells": len(cells)}
        lines.say("started", command="campaign", **told, left=len(left))
    with (
        stop_on_signals() as stop,
        Meter(scenario.name, len(cells), len(cells) - len(left), quiet=ways.quiet) as meter,
    ):
        _Work(folder, scenario, kinds.faults, left, stop, meter, ways, lines).do()
    if stop.requested:
        note(f"{stop.reason}: go on with fleetloop campaign --resume {folder.path}")
        if lines is not None:
            _say_end(lines, folder, ExitStatus.INTERRUPTED, None)
        return ExitStatus.INTERRUPTED
    return _finish(folder, scenario, cells, SYSTEM_CLOCK.monotonic_s() - began_s, ways, lines)


def _say_end(lines: JsonLines, folder: Folder, status: int, numbers: Any) -> None:
    """The last line; no numbers of a campaign that was interrupted."""
    lines.say("ended", exit_status=int(status), folder=str(folder.path), campaign=finite(numbers))
    lines.end()


@dataclass(frozen=True, slots=True)
class _Work:
    """The cells that are left, done."""

    folder: Folder
    scenario: Scenario
    faults: Mapping[str, Fault]
    left: list[Cell]
    stop: Stop
    meter: Meter
    ways: Ways
    lines: JsonLines | None = None

    def do(self) -> None:
        """First those of one process, seed by seed, then those over processes, one by one."""
        folder, plan = self.folder, self.folder.plan
        told = Told.of(self.scenario, folder_of(plan.source))
        whole = [cell for cell in self.left if KINDS[cell.kind].PLACE == "process"]
        branching = [cell for cell in self.left if KINDS[cell.kind].PLACE != "process"]
        seeds = {cell.seed for cell in self.left}
        longest_s = self._longest_s()
        branches = [
            Branches(
                told,
                plan.source,
                plan.given,
                seed,
                tuple((cell, self._fault(cell)) for cell in branching if cell.seed == seed),
                plan.conditions,
                longest_s,
                folder.baselines.get(seed),
                self.ways.at_once or pool.processors(),
                plan.limit_s,
            )
            for seed in plan.seeds
            if seed in seeds
        ]
        self._work([(job, [c for c, _ in job.cells]) for job in branches], plan.limit_s)
        if whole and not self.stop.requested:
            keep_to_itself()
            runs = [
                WholeRun(
                    told,
                    plan.source,
                    plan.given,
                    cell,
                    self._fault(cell),
                    folder.baselines[cell.seed].kept_from_s,
                    plan.conditions,
                    folder.path / "run",
                )
                for cell in whole
                if cell.seed in folder.baselines
            ]
            self._work([(job, [job.cell]) for job in runs], _WHOLE_LIMIT_S)

    def _longest_s(self) -> float:
        """End of the longest cell, if nothing is kept before the scenario expects it."""
        scenario, plan = self.scenario, self.folder.plan
        latest_s = [expect.from_s for expect in scenario.expect]
        ends_s = [
            windows(scenario, latest_s, replace(fault, at_s=at_s), plan.conditions).ends_at_s
            for fault in self.faults.values()
            for at_s in plan.times_s
        ]
        return max(ends_s, default=0.0)

    def _fault(self, cell: Cell) -> Fault:
        return replace(self.faults[cell.kind], at_s=cell.at_s)

    def _work(self, jobs: Sequence[tuple[Any, Sequence[Cell]]], silence_s: float) -> None:
        """Do jobs one after the other; cells of which a job brings nothing are errors."""

        def keep(said: object) -> None:
            if isinstance(said, Baseline | Result):
                self.folder.add(said)
                self.meter.advance(said)
                self._say(said)

        done = pool.work(
            [job for job, _ in jobs],
            self.stop,
            lambda *_: self.meter.show(),
            lambda _, said: keep(said),
            at_once=1,
            silence_s=silence_s,
        )
        for number, brought in done.items():
            keep(brought)
            for cell in jobs[number][1]:
                if cell not in self.folder.results and not self.stop.requested:
                    keep(Result(cell, Verdict.ERROR, str(brought)))

    def _say(self, said: Baseline | Result) -> None:
        match said:
            case _ if self.lines is None:
                return
            case Baseline():
                self.lines.say("baseline", baseline=finite(asdict(said)))
            case Result():
                self.lines.say("cell", cell=finite(said.as_table()))


def _finish(
    folder: Folder,
    scenario: Scenario,
    cells: Sequence[Cell],
    wall_s: float,
    ways: Ways,
    lines: JsonLines | None,
) -> int:
    results = [folder.results[cell] for cell in cells if cell in folder.results]
    numbers = described(folder, scenario, results, wall_s)
    if ways.as_json:
        say_json(numbers | {"folder": str(folder.path)})
    elif lines is None:
        print_matrix(folder, scenario, results)
        say(summary_line(results, wall_s))
    run_folder.write(folder.path / NUMBERS, to_json(numbers))
    run_folder.write(folder.path / PAGE, page(folder, scenario, results, wall_s))
    write_tables(folder.path, results)
    if ways.junit is not None:
        write_junit(ways.junit, scenario.name, folder.baselines.values(), results, ways.allowed)
    if not ways.quiet:
        say(f"page     {folder.path / PAGE}")
    sound = all(one.verdict == "held" for one in folder.baselines.values())
    bad = [result for result in results if result.verdict not in ways.allowed]
    status = ExitStatus.FAILED if bad or not sound else ExitStatus.OK
    if lines is not None:
        _say_end(lines, folder, status, numbers)
    return status
