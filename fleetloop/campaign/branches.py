"""The cells of one seed that need no processes: one run, and a branch of it for each cell.

Up to its fault a cell is the scenario without it. So the scenario runs once in this process, all in
memory; at each time of the campaign it forks, and each child takes a fault as if the scenario had
it and goes on to its cell's end. Its rows are, bit for bit, those of a whole run with that
[[fault]]. Kinds that change more than that, as a fault of links makes all ages a signal, branch
from a run of their own: cells branch from the same one if their briefs are the same but for the
fault and the end.

No child outlives its parent: it looks for it every `PROGRESS_EVERY_TICKS` ticks, and its limit
bounds it in any case.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from bridge.network.messages import Progress
from bridge.process.clock import SYSTEM_CLOCK
from bridge.process.lifecycle import Stop, settled_memory
from configs.brief import AgentBrief, PlantBrief
from configs.connections import NetworkLink
from configs.errors import FleetloopError
from configs.faults.base import Fault
from configs.faults.plan import names_of, plan
from configs.loading import to_toml
from configs.resolve import agent_brief, leader_brief, plant_brief, signals_of
from configs.scenario import Scenario
from fleetloop.campaign.forks import Children
from fleetloop.campaign.matrix import (
    Cell,
    Conditions,
    Windows,
    command,
    may_begin_later,
    under,
    windows,
)
from fleetloop.campaign.verdicts import Outcome, Result, kept_from_s, verdict_of
from fleetloop.in_process.run import InProcessRun
from fleetloop.in_process.whole import run_in_memory
from fleetloop.jobs.job import Tell, Told
from fleetloop.record.memory import MemoryRecord
from fleetloop.record.reader import Record
from fleetloop.results import expectations
from fleetloop.results.expectations import judge
from fleetloop.results.tables import claim

_NETWORK = NetworkLink("in-process", "", "", "")


@dataclass(frozen=True, slots=True)
class Baseline:
    """The scenario without a fault: whether it holds, and from when on each expectation is kept."""

    seed: int
    verdict: str
    reason: str
    kept_from_s: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Branches:
    """A job: the cells of one seed that need no processes. Tells a `Baseline` and `Result`s."""

    told: Told
    source: str
    given: tuple[str, ...]
    seed: int
    cells: tuple[tuple[Cell, Fault], ...]
    conditions: Conditions
    longest_s: float
    """End of the longest cell: the scenario has to hold without a fault for as long."""
    baseline: Baseline | None
    """If it is known."""
    at_once: int
    limit_s: float
    """Longest wall time of a cell."""

    def work(self, tell: Tell, stop: Stop) -> bool:
        """Do all cells, as many at once as `at_once`."""
        scenario = self.told.scenario()
        bus = replace(scenario.bus, record=())
        scenario = scenario.model_copy(update={"seed": self.seed, "bus": bus})
        found = self.baseline
        if found is None:
            until_s = max(scenario.ends_at_s, self.longest_s)
            longest = scenario.model_copy(update={"until_s": until_s})
            found = baseline_of(longest, tell, stop)
            if found is None:
                return True
            tell(found)
        planned = [
            Planned.of(scenario, cell, fault, found.kept_from_s, self.conditions)
            for cell, fault in self.cells
        ]
        for group in groups_of(planned):
            if not stop.requested:
                self._branch(group, tell, stop)
        return True

    def _branch(self, group: "Group", tell: Tell, stop: Stop) -> None:
        trunk = Trunk(group, tell)
        with settled_memory():
            trunk.run.begin()
            for tick, cells in group.by_tick():
                trunk.run.go(tick, stop)
                self._fork(trunk, cells, stop)
                if stop.requested:
                    break
            trunk.children.gather(stop, most=0)

    def _fork(self, trunk: "Trunk", cells: Sequence["Planned"], stop: Stop) -> None:
        for planned in cells:
            trunk.children.gather(stop, most=self.at_once - 1)
            if stop.requested:
                return

            def body(planned: Planned = planned) -> Result:
                made = command(self.source, self.given, planned.scenario, in_process=True)
                return replace(trunk.finish(planned), command=made)

            trunk.children.start(planned.cell, body, self.limit_s)


def baseline_of(scenario: Scenario, tell: Tell, stop: Stop) -> Baseline | None:
    """Run a scenario as it is; None if it was told to stop."""
    try:
        with settled_memory():
            outcome = run_in_memory(scenario, stop, tell)
    except FleetloopError as error:
        latest = tuple(expect.from_s for expect in scenario.expect)
        return Baseline(scenario.seed, "aborted", str(error), latest)
    if stop.requested:
        return None
    record, stopped = outcome.record, outcome.stopped
    expected = [judge(expect, record, scenario, outcome.events) for expect in scenario.expect]
    verdict = expectations.verdict(expected, stopped=bool(stopped), cut_short=False)
    reasons = [claim(one) for one in expected if not one["held"]]
    reasons += [f"{robot}: {reason}" for robot, reason in stopped.items()]
    kept = [
        kept_from_s(replace(expect, from_s=0.0), expect.from_s, record, scenario)
        if may_begin_later(expect)
        else expect.from_s
        for expect in scenario.expect
    ]
    return Baseline(scenario.seed, verdict, "; ".join(reasons), tuple(kept))


# --- what branches from where ---------------------------------------------------------------------


class Briefs(NamedTuple):
    """What decides a run up to its end, without one of its faults."""

    plant: PlantBrief
    agents: tuple[AgentBrief, ...]


class Planned(NamedTuple):
    """A cell, its fault and its run."""

    cell: Cell
    fault: Fault
    name: str
    windows: Windows
    scenario: Scenario
    briefs: Briefs
    from_tick: int
    ticks: int

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        cell: Cell,
        fault: Fault,
        kept_from_s: Sequence[float],
        conditions: Conditions,
    ) -> "Planned":
        """Of a scenario with the cell's seed."""
        asked = windows(scenario, kept_from_s, fault, conditions)
        made = under(scenario, fault, cell.seed, asked)
        name = names_of(made.fault)[-1]
        briefs = _briefs(made, name)
        (first, *_) = plan(fault, name, made)
        ticks = plant_brief(made, network=_NETWORK).schedule.ticks
        return cls(cell, fault, name, asked, made, briefs, first.from_tick, ticks)


class Group(NamedTuple):
    """Cells that branch from the same run."""

    cells: list[Planned]

    def by_tick(self) -> Iterator[tuple[int, list[Planned]]]:
        """The cells by the tick of their fault, the earliest first."""
        for tick in sorted({planned.from_tick for planned in self.cells}):
            yield tick, [planned for planned in self.cells if planned.from_tick == tick]


def groups_of(planned: Sequence[Planned]) -> list[Group]:
    """Cells with those that differ from them in nothing but the fault and the end."""
    groups: list[Group] = []
    for one in planned:
        for group in groups:
            if group.cells[0].briefs == one.briefs:
                group.cells.append(one)
                break
        else:
            groups.append(Group([one]))
    return groups


def _briefs(scenario: Scenario, name: str) -> Briefs:
    """The briefs without the fault of a name, and without an end."""
    plant = plant_brief(scenario, network=_NETWORK)
    schedule = replace(plant.schedule, ticks=0)
    agents = (agent_brief(scenario, r, network=_NETWORK, bus=()) for r in scenario.names)
    return Briefs(
        replace(plant, schedule=schedule, faults=_without(name, plant.faults)),
        tuple(
            replace(
                agent,
                schedule=schedule,
                faults=_without(name, agent.faults),
                logs_inputs=False,
            )
            for agent in agents
        ),
    )


def _without(name: str, faults: Sequence[Any]) -> tuple[Any, ...]:
    return tuple(one for one in faults if one.name != name)


# --- a run and its branches -----------------------------------------------------------------------


def _run_of(
    scenario: Scenario,
    briefs: Briefs,
    longest: Scenario,
    memory: MemoryRecord,
    on_progress: Callable[[Progress], None],
) -> InProcessRun:
    """A run by these briefs that can go on to the end of `longest`."""
    ticks = plant_brief(longest, network=_NETWORK).schedule.ticks
    plant, agents = briefs
    schedule = replace(plant.schedule, ticks=ticks)
    return InProcessRun(
        replace(plant, schedule=schedule),
        [replace(agent, schedule=schedule) for agent in agents],
        leader_brief(scenario),
        memory,
        on_progress,
    )


def _record(memory: MemoryRecord, scenario: Scenario) -> Record:
    signals = {robot.name: signals_of(scenario, robot) for robot in scenario.robot}
    return memory.record(signals, to_toml(scenario))


class Trunk:
    """The run that a group of cells branches from."""

    def __init__(self, group: Group, tell: Tell) -> None:
        self.memory = MemoryRecord()
        longest = max(group.cells, key=lambda planned: planned.ticks)
        self.children = Children(tell)
        self.look: Callable[[Progress], None] = tell
        self.run = _run_of(
            longest.scenario,
            longest.briefs,
            longest.scenario,
            self.memory,
            self._on_progress,
        )

    def _on_progress(self, state: Progress) -> None:
        self.look(state)

    def finish(self, planned: Planned) -> Result:
        """In a child: the cell from here on, and its verdict."""
        began_s = SYSTEM_CLOCK.monotonic_s()
        outcome = self.outcome(planned)
        found = verdict_of(planned.cell, planned.scenario, planned.windows.strict, outcome)
        return replace(found, wall_s=round(SYSTEM_CLOCK.monotonic_s() - began_s, 3))

    def outcome(self, planned: Planned) -> Outcome:
        """In a child: go on with the cell's fault to its end, or until no verdict can change."""
        run, parent = self.run, os.getppid()
        decided = Stop()
        final = not planned.scenario.host.rearm

        def look(_: Progress) -> None:
            if os.getppid() != parent:
                os._exit(1)
            if final and run.stopped_robots:
                decided.request("a robot stopped")

        self.look = look
        for one in plan(planned.fault, planned.name, planned.scenario):
            run.order(one)
        run.go(planned.ticks, decided)
        run.finish()
        record = _record(self.memory, planned.scenario)
        return Outcome(record, run.stopped_robots, run.events)
