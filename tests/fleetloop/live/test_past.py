"""A page that comes late shows what one shows that was there from the beginning."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from support.in_process import RanInProcess

from bridge.network.telemetry import PLANT_ROW, row_of
from configs.loading import load, to_toml
from configs.resolve import signals_of
from configs.scenario import Scenario
from fleetloop.live.expected import Source
from fleetloop.live.frame import HEAD, Cursor
from fleetloop.live.past import MOST_KEPT_BYTES, Block, Kept, feed, recorded
from fleetloop.live.state import LiveState
from fleetloop.record.chunks import CHUNK_TICKS
from fleetloop.record.writer import RecordWriter

FROM = 2 * CHUNK_TICKS - 100
SOURCES: tuple[Source, ...] = ("plant", "controller")


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    expected = "expect=[{signal='x_e_m', max_abs=9.0, from_s=0.0, to_s=1.0}]"
    return load("two_robots", ("duration_s=4.0", expected))


@pytest.fixture(scope="module")
def ran(scenario: Scenario) -> RanInProcess:
    return RanInProcess(scenario)


def blocks(scenario: Scenario, ran: RanInProcess, first: int, upto: int) -> Iterator[Block]:
    for begin in range(first, upto, 64):
        for robot in scenario.robot:
            for source in SOURCES:
                plant = source == "plant"
                size = (PLANT_ROW if plant else row_of(signals_of(scenario, robot))).size
                rows = ran.rows[robot.name, source][begin * size : min(begin + 64, upto) * size]
                yield Block(robot.name, source, begin, rows)


def recording(path: Path, scenario: Scenario, ran: RanInProcess, upto: int) -> RecordWriter:
    tables = {robot.name: signals_of(scenario, robot) for robot in scenario.robot}
    writer = RecordWriter(path, tables, to_toml(scenario), 2_000_000)
    for block in blocks(scenario, ran, 0, upto):
        writer.add(*block)
    return writer


def test_record_and_what_was_kept_are_the_whole(
    scenario: Scenario, ran: RanInProcess, tmp_path: Path
) -> None:
    path, end = tmp_path / "record.mcap", 3 * CHUNK_TICKS + 7
    whole, late, kept = LiveState(scenario), LiveState(scenario), Kept()
    feed(whole, blocks(scenario, ran, 0, end))
    for block in blocks(scenario, ran, FROM, end):
        kept.add(block)
        late.hear(*block)
    late.settle()
    late.judge()
    assert late.seen_from_s == pytest.approx(FROM * whole.schedule.period_s, abs=0.01)
    assert late.expectations.judged[0]["held"] is None, "its window isn't seen whole"
    with recording(path, scenario, ran, FROM):
        short = recorded(path, LiveState(scenario))  # a group of ticks is missing
        assert not kept.follow(short)
    path.unlink()
    with recording(path, scenario, ran, end):
        made = LiveState(scenario)
        assert kept.follow(recorded(path, made))
        feed(made, kept.blocks)
    made.judge()
    assert made.seen_from_s == 0.0
    assert made.expectations.judged[0]["held"] is True
    assert made.tick == end - 1
    np.testing.assert_array_equal(made.history.since(0), whole.history.since(0))
    np.testing.assert_array_equal(made.now(), whole.now())


def test_a_browser_gets_another_history_whole(scenario: Scenario, ran: RanInProcess) -> None:
    late, whole, cursor = LiveState(scenario), LiveState(scenario), Cursor()
    feed(late, blocks(scenario, ran, 640, 1280))
    feed(whole, blocks(scenario, ran, 0, 1280))
    cursor.frame(late)
    assert cursor.frame(late)[HEAD.index("whole")] == 0.0
    frame = dict(zip(HEAD, cursor.frame(whole), strict=False))
    assert frame["whole"] == 1.0
    assert frame["rows"] == len(whole.history)


def test_what_is_kept_is_bounded() -> None:
    kept = Kept()
    assert not kept.follow({}), "nothing was heard"
    kept.add(Block("r1", "plant", 64, b"x"))
    assert not kept.follow({("r1", "plant"): 63})
    assert kept.follow({("r1", "plant"): 64})
    kept.add(Block("r1", "plant", 65, bytes(MOST_KEPT_BYTES)))
    assert kept.over
    assert kept.blocks == []
