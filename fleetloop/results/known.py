"""What is known of a run that has ended: its record, its scenario, its summary."""

from pathlib import Path
from typing import NamedTuple

from configs.errors import ScenarioError
from configs.loading import loads
from configs.scenario import Scenario
from fleetloop.record.reader import Record
from fleetloop.results import run_folder
from fleetloop.results.summary import RunStats, Summary, summarise
from fleetloop.results.summary_file import read_summary


class Known(NamedTuple):
    """What is known of a run."""

    record: Record
    scenario: Scenario
    summary: Summary


def known_of(record: Record) -> Known:
    """What a page says of a run.

    Raises:
        ScenarioError: nothing is in its record, or its scenario can't be read.
    """
    path = record.path
    if not any(len(rows) for rows in record.controller.values()):
        raise ScenarioError(f"{path}: not one tick of a controller is in it, nothing to show")
    scenario = loads(f"{path}: {run_folder.SCENARIO}", record.scenario_toml, recorded=True)
    if scenario.names != record.robots:
        raise ScenarioError(f"{path}: rows of {record.robots}, but a scenario of {scenario.names}")
    return Known(record, scenario, _summary(path.parent, record, scenario))


def _summary(folder: Path, record: Record, scenario: Scenario) -> Summary:
    summary = read_summary(folder)
    if summary is None:
        reason = f"the run left no {run_folder.SUMMARY}"
        stats = RunStats("unknown", ended="aborted", reason=reason, events_known=False)
        return summarise(record, scenario, stats)
    return summary
