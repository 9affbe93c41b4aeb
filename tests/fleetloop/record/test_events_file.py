"""Events as any MCAP reader has them."""

import json
from io import BytesIO

from mcap.reader import make_reader

from configs.events import Event
from fleetloop.record.events_file import events_file

EVENTS = [
    Event(-50, "r1", "armed"),
    Event(1500, "r2", "stopped", "left drive dropped out"),
    Event(1500, "bus/r2", "bus_trouble", "went down"),
]


def test_a_reader_has_every_event_at_its_scenario_time_in_their_order() -> None:
    reader = make_reader(BytesIO(events_file(EVENTS, 2_000_000)))
    found = []
    for schema, channel, message in reader.iter_messages(log_time_order=False):
        assert schema is not None
        assert (schema.name, channel.topic, channel.message_encoding) == (
            "foxglove.Log",
            "events",
            "json",
        )
        said = json.loads(message.data)
        stamp = said["timestamp"]
        assert message.log_time == stamp["sec"] * 10**9 + stamp["nsec"]
        found.append((message.log_time, said["tick"], said["name"], said["kind"], said["message"]))
    assert found == [
        (0, -50, "r1", "armed", "armed"),
        (3 * 10**9, 1500, "r2", "stopped", "stopped: left drive dropped out"),
        (3 * 10**9, 1500, "bus/r2", "bus_trouble", "bus_trouble: went down"),
    ]


def test_equal_events_make_equal_files_and_none_make_a_file_too() -> None:
    assert events_file(EVENTS, 1_000_000) == events_file(iter(EVENTS), 1_000_000)
    assert list(make_reader(BytesIO(events_file([], 1_000_000))).iter_messages()) == []
