"""The background writer: the same file as the writer alone, and no failure is lost."""

from pathlib import Path
from threading import Event

import pytest
from support.clocks import ManualClock
from support.controller_rows import ROW, SIGNALS

from bridge.network.telemetry import PLANT_ROW
from configs.errors import InfrastructureError
from fleetloop.record.background import LOOK_EVERY_S, BackgroundWriter
from fleetloop.record.run_record import RunRecord
from fleetloop.record.writer import Source

BLOCKS: list[tuple[Source, int, bytes]] = [
    (source, first, bytes(row.size * 100))
    for first in range(0, 1000, 100)
    for source, row in (("plant", PLANT_ROW), ("controller", ROW))
]


def writer(path: Path) -> RunRecord:
    return RunRecord(path, {"r1": SIGNALS}, "schema = 1\n", 1_000_000)


def test_the_file_is_the_same_as_without_it(tmp_path: Path) -> None:
    with writer(tmp_path / "a.mcap") as alone:
        for source, first, rows in BLOCKS:
            alone.add("r1", source, first, rows)
    with writer(tmp_path / "b.mcap") as file, BackgroundWriter(file) as behind:
        for source, first, rows in BLOCKS:
            behind.add("r1", source, first, rows)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_what_fails_in_the_background_is_raised(tmp_path: Path) -> None:
    with writer(tmp_path / "a.mcap") as file:
        behind = BackgroundWriter(file)
        behind.add("r1", "plant", 7, bytes(PLANT_ROW.size))
        with pytest.raises(InfrastructureError, match="begin at tick 7, expected 0"):
            behind.close()


def test_a_record_that_is_moved_away_is_found_at_the_next_look(tmp_path: Path) -> None:
    clock, rows, path = ManualClock(), bytes(PLANT_ROW.size), tmp_path / "a.mcap"
    with writer(path) as file:
        behind = BackgroundWriter(file, clock=clock)

        def written(tick: int) -> None:
            done = Event()
            behind.add("r1", "plant", tick, rows)
            behind._blocks.put(done.set)
            assert done.wait(5.0)

        written(0)  # with the first look
        path.rename(tmp_path / "b.mcap")
        written(1)
        clock.passes(LOOK_EVERY_S)
        behind.add("r1", "plant", 2, rows)
        with pytest.raises(InfrastructureError, match=r"a\.mcap"):
            behind.close()
