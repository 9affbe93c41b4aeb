"""The conclusion of a run: its summary and events, from the record, whoever asks for it."""

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from configs.errors import InfrastructureError
from configs.events import KINDS, Event, in_order
from configs.loading import to_toml
from configs.resolve import schedule
from configs.scenario import Scenario
from fleetloop.launch.conduct import Carried
from fleetloop.record.events import add_events
from fleetloop.record.reader import Record
from fleetloop.results import run_folder
from fleetloop.results.summary import RunStats, Summary, summarise, to_json


class Concluded(NamedTuple):
    """What a run came to."""

    record: Record
    summary: Summary
    unsaved: InfrastructureError | None
    """Why the summary, the scenario, or the events of the record could not be written."""


def conclude(scenario: Scenario, carried: Carried) -> Concluded:
    """Make the summary of a run that began, and write it into its folder, events into its record.

    A scenario whose leader's speed was ordered is written again, with the steps that repeat it.

    Raises:
        RecordError: the record can't be read.
        InfrastructureError: the record is gone.
    """
    with contextlib.closing(carried):
        return _concluded(scenario, carried.folder, carried.stats)


def _concluded(scenario: Scenario, folder: Path, stats: RunStats) -> Concluded:
    path = folder / run_folder.RECORD
    if not path.exists():
        gone = stats.reason or f"{path} is not there: the run's folder was removed or moved"
        raise InfrastructureError(gone)
    record = Record.open(path)
    if stats.steered is not None:
        scenario = stats.steered
    summary = summarise(record, scenario, stats)
    unsaved: InfrastructureError | None = None
    try:
        run_folder.write(folder / run_folder.SUMMARY, to_json(summary))
        if stats.steered is not None:
            run_folder.write(folder / run_folder.SCENARIO, to_toml(scenario))
        add_events(record, _recorded(scenario, stats.events), schedule(scenario).period_ns)
    except InfrastructureError as error:
        unsaved = error
    return Concluded(record, summary, unsaved)


def _recorded(scenario: Scenario, events: Sequence[Event]) -> list[Event]:
    """The events of a run that its record has: in lockstep those that equal runs have alike."""
    realtime = scenario.clock.mode == "realtime"
    return [it for it in in_order(events, scenario.names) if realtime or KINDS[it.kind].exact]
