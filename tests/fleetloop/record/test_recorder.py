"""The recorder's judgement of what it hears; its process is tested with whole runs."""

from pathlib import Path

import numpy as np
import pytest
from support.controller_rows import ROW, SIGNALS

from bridge.network.link import Arrival
from bridge.network.messages import Rows
from bridge.network.telemetry import PLANT_ROW
from configs.brief import RecorderBrief
from configs.connections import NetworkLink
from fleetloop.record.inputs_file import InputLog, path_of, read_inputs
from fleetloop.record.reader import Record
from fleetloop.record.recorder import _Recorder
from fleetloop.record.run_record import RunRecord


def rows(tag: str, first: int, count: int, *, final: bool = False) -> Arrival:
    size = PLANT_ROW.size if tag.startswith("plant") else ROW.size
    block = np.full((count, size // 8), 1.5).tobytes()
    return Arrival(tag, "", Rows(first, count, block, final).encode())


def record(
    path: Path, *arrivals: Arrival, fills_gaps: bool = False, inputs: bool = False
) -> tuple[_Recorder, Record]:
    """What comes of these messages."""
    network = NetworkLink("x", "", "", "")
    brief = RecorderBrief(
        str(path),
        ("r1", "r2"),
        (SIGNALS, SIGNALS),
        (),
        (),
        "",
        1_000_000,
        1.0,
        0.1,
        network,
        "",
        300,
        0,
        fills_gaps,
        inputs,
    )
    logging = brief.robots if inputs else ()
    tables = dict.fromkeys(brief.robots, SIGNALS)
    with RunRecord(path, tables, "", brief.period_ns, inputs=logging) as file:
        recorder = _Recorder(brief, file)
        for arrival in arrivals:
            recorder.process(arrival)
        recorder.end_absences()
    return recorder, Record.open(path)


SOURCES = [f"{kind}/{robot}" for robot in ("r1", "r2") for kind in ("plant", "controller")]


def whole(*sources: str) -> list[Arrival]:
    """All 300 rows of these sources."""
    blocks = ((0, 128, False), (128, 128, False), (256, 44, True))
    return [rows(source, *block[:2], final=block[2]) for source in sources for block in blocks]


def test_a_run_whose_sources_all_said_their_last_is_whole(tmp_path: Path) -> None:
    recorder, found = record(tmp_path / "a.mcap", *whole(*SOURCES))
    assert not recorder.unfinished
    assert not recorder.refusals.lines()
    assert all(len(r) == 300 for r in (*found.plant.values(), *found.controller.values()))


@pytest.mark.parametrize("wrong", [0, 99, -1])
def test_rows_that_come_twice_are_refused_and_the_right_ones_taken(
    tmp_path: Path, wrong: int
) -> None:
    recorder, found = record(
        tmp_path / "a.mcap",
        rows("controller/r1", 0, 100),
        rows("controller/r1", wrong, 100),
        rows("controller/r1", 100, 100),
        rows("controller/r1", 200, 100, final=True),
        *whole("plant/r1", "plant/r2", "controller/r2"),
    )
    assert not recorder.unfinished
    assert recorder.refusals.lines() == [
        f"refused 1 row block of r1's controller: begins at tick {wrong}, expected 100"
    ]
    assert len(found.controller["r1"]) == len(found.controller["r2"]) == 300


def test_a_gap_costs_its_source_the_rest_and_nobody_else(tmp_path: Path) -> None:
    recorder, found = record(
        tmp_path / "a.mcap",
        rows("controller/r1", 0, 100),
        rows("controller/r1", 101, 100),
        rows("controller/r1", 201, 99, final=True),
        *whole("plant/r1", "plant/r2", "controller/r2"),
    )
    assert not recorder.unfinished
    assert "begins at tick 101, expected 100" in recorder.refusals.lines()[0]
    assert len(found.controller["r1"]) == 100
    assert len(found.plant["r1"]) == len(found.controller["r2"]) == 300


def test_rows_of_a_source_that_was_cut_off_are_not_a_number_but_at_their_time(
    tmp_path: Path,
) -> None:
    recorder, found = record(
        tmp_path / "a.mcap",
        rows("controller/r1", 0, 100),
        rows("controller/r1", 240, 40),
        rows("controller/r1", 140, 40),  # said before, and late
        rows("controller/r1", 290, 10, final=True),
        *whole("plant/r1", "plant/r2", "controller/r2"),
        fills_gaps=True,
    )
    assert not recorder.unfinished
    assert recorder.gaps() == ["150 rows of r1's controller did not come: not a number"]
    assert recorder.refusals.lines() == [
        "refused 1 row block of r1's controller: begins at tick 140, expected 280"
    ]
    mine = found.controller["r1"]
    assert len(mine) == 300
    values = mine[SIGNALS[1].name]
    known = np.r_[0:100, 240:280, 290:300]
    assert np.flatnonzero(np.isfinite(values)).tolist() == known.tolist()
    assert mine[SIGNALS[0].name][100:240] == pytest.approx(np.arange(100, 240) * 1e-3)


LEAVES = (rows("controller/r1", 0, 100), rows("controller/r1", 300, 0, final=True))


def test_nobody_waits_for_a_controller_that_has_left_and_its_rows_are_no_numbers(
    tmp_path: Path,
) -> None:
    others = whole("plant/r1", "plant/r2", "controller/r2")
    recorder, found = record(tmp_path / "a.mcap", *LEAVES, *others)
    assert not recorder.unfinished
    values = found.controller["r1"][SIGNALS[1].name]
    assert np.flatnonzero(np.isnan(values)).tolist() == list(range(100, 300))
    assert recorder.gaps() == ["200 rows of r1's controller did not come: not a number"]


def test_one_that_comes_again_is_waited_for_and_goes_on_where_it_is(tmp_path: Path) -> None:
    others = whole("plant/r1", "plant/r2", "controller/r2")
    again = rows("controller/r1", 0, 0)  # says so first
    recorder, _ = record(tmp_path / "a.mcap", *LEAVES, again, *others)
    assert recorder.unfinished == {"controller/r1"}
    last = rows("controller/r1", 250, 50, final=True)
    recorder, found = record(tmp_path / "b.mcap", *LEAVES, *others, again, last)
    assert not recorder.unfinished
    assert not recorder.refusals.lines()
    values = found.controller["r1"][SIGNALS[1].name]
    assert np.flatnonzero(np.isnan(values)).tolist() == list(range(100, 250))
    assert len(values) == 300


def test_others_do_not_wait_for_an_absent_one_without_bound(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("fleetloop.record.recorder.ABSENT_BYTES", 0)
    monkeypatch.setattr("fleetloop.record.recorder.ABSENT_TICKS", 50)
    frozen = rows("controller/r1", 100, 100)  # it has all its rows once it is awake
    last = rows("controller/r1", 200, 100, final=True)
    late = (*whole("plant/r1")[:2], frozen, *whole("plant/r1")[2:], last)
    recorder, found = record(
        tmp_path / "a.mcap", *LEAVES, *late, *whole("plant/r2", "controller/r2")
    )
    values = found.controller["r1"][SIGNALS[1].name]
    # The plant was at tick 256 when r1 was awake.
    assert np.flatnonzero(np.isnan(values)).tolist() == list(range(100, 206))
    assert not recorder.refusals.lines()


def test_what_is_no_rows_is_counted(tmp_path: Path) -> None:
    short = Rows(0, 2, bytes(8), final=False).encode()
    junk = (Arrival("plant/r1", "", b"x"), Arrival("plant/r1", "", short))
    recorder, found = record(tmp_path / "a.mcap", *junk, *whole(*SOURCES))
    assert recorder.refusals.lines() == [
        "refused 2 row blocks of the plant for r1: not well formed"
    ]
    assert len(found.plant["r1"]) == 300


def block(robot: str, first: int, content: bytes, *, final: bool = False) -> Arrival:
    return Arrival(f"inputs/{robot}", "", Rows(first, len(content), content, final).encode())


def test_input_logs_are_files_beside_the_record_and_waited_for(tmp_path: Path) -> None:
    blocks = block("r1", 0, b"abc"), block("r1", 3, b"de", final=True), block("r2", 0, b"f")
    recorder, _ = record(tmp_path / "a.mcap", *whole(*SOURCES), *blocks, inputs=True)
    assert recorder.unfinished == {"inputs/r2"}
    assert not recorder.refusals.lines()
    assert read_inputs(path_of(tmp_path, "r1")) == [InputLog(b"abcde", True)]
    assert read_inputs(path_of(tmp_path, "r2")) == [InputLog(b"f", False)]


def test_an_input_log_ends_where_a_block_of_it_is_missing(tmp_path: Path) -> None:
    blocks = block("r1", 0, b"abc"), block("r1", 4, b"e"), block("r1", 5, b"f", final=True)
    recorder, _ = record(tmp_path / "a.mcap", *whole(*SOURCES), *blocks, inputs=True)
    assert read_inputs(path_of(tmp_path, "r1")) == [InputLog(b"abc", False)]
    assert recorder.gaps() == [
        "the inputs of r1's controller are missing from byte 3 of their log on"
    ]
    assert recorder.unfinished == {"inputs/r2"}


@pytest.mark.parametrize("may_restart", [True, False])
def test_only_a_controller_that_may_start_again_begins_a_second_log(
    tmp_path: Path, may_restart: bool
) -> None:
    blocks = block("r1", 0, b"abc"), block("r1", 0, b"again", final=True)
    recorder, _ = record(
        tmp_path / "a.mcap", *whole(*SOURCES), *blocks, inputs=True, fills_gaps=may_restart
    )
    first, *others = read_inputs(path_of(tmp_path, "r1"))
    assert first == InputLog(b"abc", False)
    assert others == ([InputLog(b"again", True)] if may_restart else [])
    refused = "refused 1 block of the inputs of r1's controller: begins at byte 0, expected 3"
    assert recorder.refusals.lines() == ([] if may_restart else [refused])


def test_the_log_of_a_controller_that_has_left_is_followed_by_that_of_the_next(
    tmp_path: Path,
) -> None:
    blocks = (
        *(block("r1", 0, b"abc", final=True), *LEAVES, rows("controller/r1", 0, 0)),
        *(block("r1", 0, b"again", final=True), rows("controller/r1", 200, 100, final=True)),
    )
    recorder, _ = record(tmp_path / "a.mcap", *blocks, inputs=True)
    logs = read_inputs(path_of(tmp_path, "r1"))
    assert logs == [InputLog(b"abc", True), InputLog(b"again", True)]
    assert not recorder.refusals.lines()
    assert "inputs/r1" not in recorder.unfinished
