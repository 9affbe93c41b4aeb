"""The runs of a comparison: each law with each seed, then what a step of each law costs."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from bridge.network.messages import Progress
from bridge.process.lifecycle import Stop
from configs.scenario import Scenario
from fleetloop.compare.jobs import CostOfSteps, Trial
from fleetloop.compare.results import Row
from fleetloop.jobs import pool
from fleetloop.jobs.job import Told
from fleetloop.terminal import note


class Planned(NamedTuple):
    """One run to come."""

    label: str  # of the law
    seed: int
    scenario: Scenario


def rows_of(
    planned: Sequence[Planned],
    out: Path,
    folder: str,
    stop: Stop,
    on_progress: Callable[[Mapping[int, Progress], Mapping[int, object]], None],
    *,
    keep_records: bool,
) -> list[Row]:
    """Do all runs; a row per law, none if it was told to stop.

    Args:
        planned: the runs, those of a law one after the other.
        out: each run gets a folder in it.
        folder: where modules of the user's own are looked for first.
        stop: ends all of it.
        on_progress: as `pool.work` takes it.
        keep_records: whether the runs' records stay.

    Raises:
        InfrastructureError: a process can't be started.
    """
    names = folders(planned)
    jobs = [
        Trial(Told.of(one.scenario, folder), out / name, keep_records)
        for one, name in zip(planned, names, strict=True)
    ]
    done = pool.work(jobs, stop, on_progress)
    if stop.requested:
        return []
    runs: dict[str, dict[int, Any]] = {}
    scenarios: dict[str, Scenario] = {}
    for number, one in enumerate(planned):
        runs.setdefault(one.label, {})[one.seed] = done[number]
        scenarios.setdefault(one.label, one.scenario)
    rows = [Row(label, scenarios[label], of_law) for label, of_law in runs.items()]
    return _with_costs(rows, folder, stop)


def folders(planned: Sequence[Planned]) -> list[str]:
    """A folder's name for each run, all different."""
    several = len({one.seed for one in planned}) > 1
    names: list[str] = []
    for one in planned:
        text = f"{one.label}-seed-{one.seed}" if several else one.label
        name = first = re.sub(r"[^\w.=-]+", "-", text).strip("-.") or "law"
        number = 2
        while name in names:
            name, number = f"{first}-{number}", number + 1
        names.append(name)
    return names


def _with_costs(rows: list[Row], folder: str, stop: Stop) -> list[Row]:
    through = [row for row in rows if row.sound and row.outcomes]
    if not through:
        return rows
    told = {row.label: Told.of(row.scenario, folder) for row in through}
    found = pool.work([CostOfSteps(told, through[0].outcomes[0].samples)], stop).get(0)
    if not isinstance(found, dict):
        if isinstance(found, pool.Failed):
            note(f"cost of a step: {found}")
        return rows
    return [replace(row, cost=found.get(row.label)) for row in rows]
