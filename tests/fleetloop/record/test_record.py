"""The record: written once, read by us and by tools that we did not write, cut at any byte."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from support.controller_rows import SIGNALS

from configs.errors import InfrastructureError, ScenarioError
from configs.signals import PLANT_SIGNALS
from fleetloop.record.reader import Record
from fleetloop.record.schema import VIEW_TOPICS
from fleetloop.record.writer import CHUNK_TICKS, RecordWriter, finish_truncated

ROBOTS = ("r1", "r2")
LAYOUT = dict.fromkeys(ROBOTS, SIGNALS)
WIDTHS = {"plant": len(PLANT_SIGNALS), "controller": len(SIGNALS)}
PERIOD_NS = 1_000_000
BEYOND_VIEWS = 5 * CHUNK_TICKS + 5
"""Ticks behind the first chunk of each view."""


def rows(robot: str, source: str, first: int, count: int) -> np.ndarray:
    """Distinct values, the first column the time."""
    ticks = np.arange(first, first + count, dtype=float)
    base = 1000.0 * ROBOTS.index(robot) + 100.0 * (source == "plant")
    table = base + np.arange(WIDTHS[source]) + ticks[:, None] / 1024
    table[:, 0] = ticks * 1e-3
    return table


def write(path: Path, ticks: int, order=None, block: int = 128) -> None:
    sources = [(robot, source) for robot in ROBOTS for source in WIDTHS]
    with RecordWriter(path, LAYOUT, 'name = "x"\n', PERIOD_NS) as writer:
        starts = range(0, ticks, block)
        calls = [(first, *source) for first in starts for source in sources]
        for first, robot, source in order(calls) if order else calls:
            count = min(block, ticks - first)
            writer.add(robot, source, first, rows(robot, source, first, count).tobytes())


@pytest.mark.parametrize("ticks", [0, 1, 127, CHUNK_TICKS, 3 * CHUNK_TICKS + 5])
def test_what_was_written_is_read(tmp_path: Path, ticks: int) -> None:
    write(tmp_path / "a.mcap", ticks)
    record = Record.open(tmp_path / "a.mcap")
    assert record.robots == ROBOTS
    assert not record.lost
    assert record.scenario_toml == 'name = "x"\n'
    for robot in ROBOTS:
        for source, table in (("plant", record.plant), ("controller", record.controller)):
            found = table[robot]
            assert found["tick"].tolist() == list(range(ticks))
            expected = rows(robot, source, 0, ticks)
            for column, name in enumerate(found.dtype.names[1:]):
                assert np.array_equal(found[name], expected[:, column])


def test_the_file_does_not_depend_on_the_order_of_arrival(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", BEYOND_VIEWS)
    # All of one source first, then all of the next: as late as blocks can be.
    write(
        tmp_path / "b.mcap", BEYOND_VIEWS, lambda calls: sorted(calls, key=lambda c: (c[1:], c[0]))
    )
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_the_file_does_not_depend_on_where_blocks_begin_and_end(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", BEYOND_VIEWS)
    write(tmp_path / "b.mcap", BEYOND_VIEWS, block=17)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_a_source_that_ends_early_holds_nobody_back(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with RecordWriter(path, LAYOUT, "", PERIOD_NS) as writer:
        writer.add("r2", "controller", 0, rows("r2", "controller", 0, 100).tobytes())
        writer.end("r2", "controller")
        sizes = []
        for first in range(0, 4 * CHUNK_TICKS, CHUNK_TICKS):
            for robot, source in (("r1", "plant"), ("r2", "plant"), ("r1", "controller")):
                writer.add(robot, source, first, rows(robot, source, first, CHUNK_TICKS).tobytes())
            sizes.append(path.stat().st_size)
        with pytest.raises(InfrastructureError, match="rows of controller r2 at tick 100, after"):
            writer.add("r2", "controller", 100, rows("r2", "controller", 100, 1).tobytes())
    assert np.all(np.diff(sizes) > 10_000)
    record = Record.open(path)
    assert len(record.controller["r2"]) == 100
    assert all(len(r) == 2048 for r in (*record.plant.values(), record.controller["r1"]))


def test_when_a_source_says_that_it_ended_does_not_show_in_the_file(tmp_path: Path) -> None:
    for name, early in (("a.mcap", True), ("b.mcap", False)):
        with RecordWriter(tmp_path / name, LAYOUT, "", PERIOD_NS) as writer:
            writer.add("r1", "plant", 0, rows("r1", "plant", 0, 700).tobytes())
            if early:
                writer.end("r1", "plant")
            for robot, source in (("r2", "plant"), ("r1", "controller"), ("r2", "controller")):
                writer.add(robot, source, 0, rows(robot, source, 0, 1500).tobytes())
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_the_stock_reader_and_a_ros_2_decoder_open_it(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", 700)
    with (tmp_path / "a.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        topics = {channel.topic for channel in summary.channels.values()}
        robots = {f"robot/{r}/{k}" for r in ROBOTS for k in ("plant", "controller", "pose")}
        assert topics == robots | set(VIEW_TOPICS.values())
        # Every 50 ms robots, references, frames and the fleet; no path and no edge is known.
        assert summary.statistics.message_count == 2 * (700 + 700 + 35) + 4 * 14
        decoded = list(reader.iter_decoded_messages(topics=["robot/r2/plant"]))
        assert len(decoded) == 700
        _, _, message, content = decoded[600]
        assert message.log_time == 600 * PERIOD_NS
        assert content.tick == 600
        assert content.x_m == rows("r2", "plant", 600, 1)[0, 1]
        assert {schema.name for schema in summary.schemas.values()} >= {
            "geometry_msgs/msg/PoseStamped"
        }


def test_poses_are_ros_poses_for_three_dimensional_views(tmp_path: Path) -> None:
    write(tmp_path / "a.mcap", 100)
    with (tmp_path / "a.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        poses = [content for *_, content in reader.iter_decoded_messages(topics="robot/r1/pose")]
    assert len(poses) == 5
    truth = rows("r1", "plant", 60, 1)[0]
    pose = poses[3]
    assert (pose.header.stamp.sec, pose.header.stamp.nanosec) == (0, 60_000_000)
    assert pose.header.frame_id == "world"
    assert (pose.pose.position.x, pose.pose.position.y) == (truth[1], truth[2])
    assert pose.pose.orientation.z == pytest.approx(np.sin(truth[3] / 2))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cut") / "whole.mcap"
    write(path, 2 * CHUNK_TICKS + 100)
    return path


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_file_cut_anywhere_opens_and_is_whole_again_when_finished(
    whole: Path, tmp_path: Path, data
) -> None:
    content = whole.read_bytes()
    header = content.index(b'name = "x"') + 200  # robots and scenario are there
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(content[: data.draw(st.integers(header, len(content) - 1))])
    before = Record.open(cut)
    assert before.lost.startswith("cut at byte")
    finish_truncated(cut)
    after = Record.open(cut)
    assert after.lost == "its recorder ended before it did"
    for robot in ROBOTS:
        ticks = len(before.plant[robot])
        assert np.array_equal(after.plant[robot], before.plant[robot])
        assert np.array_equal(after.plant[robot], Record.open(whole).plant[robot][:ticks])
    with cut.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary.statistics.message_count >= 2 * ticks


def test_missing_and_repeated_rows_are_refused(tmp_path: Path) -> None:
    with RecordWriter(tmp_path / "a.mcap", LAYOUT, "", PERIOD_NS) as writer:
        block = rows("r1", "plant", 0, 10).tobytes()
        writer.add("r1", "plant", 0, block)
        for first in (0, 11):
            with pytest.raises(InfrastructureError, match=f"begin at tick {first}, expected 10"):
                writer.add("r1", "plant", first, block)


def test_a_full_disk_is_named() -> None:
    with (
        pytest.raises(InfrastructureError, match=r"can't write /dev/full: No space left"),
        RecordWriter("/dev/full", LAYOUT, "x" * 100_000, PERIOD_NS),
    ):
        pass


def test_what_is_no_record_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"no such thing")
    with pytest.raises(ScenarioError, match="not an MCAP file"):
        Record.open(tmp_path / "a.mcap")
