"""Finished runs that tests of the operator's tools look at."""

from pathlib import Path

import pytest
from support.controller_rows import SIGNALS
from support.record_rows import packed

from fleetloop.launch.run import RunOptions, run_scenario
from fleetloop.record.reader import Record
from fleetloop.record.writer import RecordWriter


@pytest.fixture(scope="package")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "done"
    assert run_scenario("two_robots", RunOptions(in_process=True, out=folder, as_json=True)) == 0
    return folder


@pytest.fixture(scope="package")
def uneven_run(finished_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same run without its summary, but r2's controller ended after 1200 of the 2000 ticks."""
    folder = tmp_path_factory.mktemp("runs") / "uneven"
    folder.mkdir()
    whole = Record.open(finished_run / "record.mcap")
    with RecordWriter(
        folder / "record.mcap", dict.fromkeys(whole.robots, SIGNALS), whole.scenario_toml, 2_000_000
    ) as writer:
        for robot in whole.robots:
            writer.add(robot, "plant", 0, packed(whole.plant[robot]))
        writer.add("r1", "controller", 0, packed(whole.controller["r1"]))
        writer.add("r2", "controller", 0, packed(whole.controller["r2"][:1200]))
    return folder
