"""Events in a record as any MCAP reader has them."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from support.controller_rows import SIGNALS

from configs.events import Event
from fleetloop.record.events import add_events
from fleetloop.record.reader import Record
from fleetloop.record.writer import RecordWriter

EVENTS = [
    Event(-50, "r1", "armed"),
    Event(1500, "r2", "stopped", "left drive dropped out"),
    Event(1500, "bus/r2", "bus_trouble", "ging ünter"),
    Event(1501, "r2", "diverged"),
]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    with RecordWriter(tmp_path / "a.mcap", {"r1": SIGNALS}, "", 2_000_000) as writer:
        for source, width in (("plant", 12), ("controller", 35)):
            rows = np.arange(700.0 * width).reshape(700, width)
            writer.add("r1", source, 0, rows.tobytes())
    return tmp_path / "a.mcap"


def test_a_reader_has_every_event_at_its_scenario_time_in_their_order(path: Path) -> None:
    add_events(Record.open(path), EVENTS, 2_000_000)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_summary().statistics.channel_message_counts[7] == len(EVENTS)
        found = []
        for schema, _, message, said in reader.iter_decoded_messages(topics="log"):
            assert schema.name == "foxglove_msgs/msg/Log"
            stamp = said.timestamp
            assert message.log_time == stamp.sec * 10**9 + stamp.nanosec
            found.append((message.log_time, said.level, said.name, said.message))
            assert (said.file, said.line) == ("", 0)
    assert found == [
        (0, 2, "r1", "armed"),
        (3 * 10**9, 3, "r2", "stopped: left drive dropped out"),
        (3 * 10**9, 3, "bus/r2", "bus_trouble: ging ünter"),
        (3_002_000_000, 4, "r2", "diverged"),
    ]


def test_the_rows_of_a_record_with_events_are_what_they_were(path: Path) -> None:
    before = Record.open(path)
    add_events(before, EVENTS, 2_000_000)
    after = Record.open(path)
    assert not after.lost
    for mine, right in ((after.plant, before.plant), (after.controller, before.controller)):
        assert mine["r1"].tobytes() == right["r1"].tobytes()


def test_no_events_leave_the_file_as_it_is(path: Path) -> None:
    before = path.read_bytes()
    add_events(Record.open(path), [], 2_000_000)
    assert path.read_bytes() == before


def test_a_missing_part_is_named_as_before(tmp_path: Path) -> None:
    with RecordWriter(tmp_path / "a.mcap", {"r1": SIGNALS}, "", 2_000_000) as writer:
        writer.note_lost("half of it")
    add_events(Record.open(tmp_path / "a.mcap"), EVENTS, 2_000_000)
    assert Record.open(tmp_path / "a.mcap").lost == "half of it"
