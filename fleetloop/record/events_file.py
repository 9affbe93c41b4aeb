"""`events.mcap`: the events of a run beside its record, for the log panel of a viewer.

    channel    schema         encoding    one message
    events     foxglove.Log   JSON        an event: source as `name`, kind and text as `message`;
                                          `tick` and `kind` besides

Times are scenario time, of the countdown 0; nothing in it knows the wall clock. The same events are
in summary.json.
"""

import json
from collections.abc import Iterable
from io import BytesIO
from typing import Any

from mcap.writer import CompressionType, Writer

from configs.events import Event

EVENTS = "events.mcap"
_LIBRARY = "fleetloop"
_INFO = 2
_TEXT, _WHOLE = {"type": "string"}, {"type": "integer"}
_SCHEMA: dict[str, Any] = {
    "title": "foxglove.Log",
    "type": "object",
    "properties": {
        "timestamp": {"type": "object", "properties": {"sec": _WHOLE, "nsec": _WHOLE}},
        "level": _WHOLE,
        "message": _TEXT,
        "name": _TEXT,
        "file": _TEXT,
        "line": _WHOLE,
        "tick": _WHOLE,
        "kind": _TEXT,
    },
}


def events_file(events: Iterable[Event], period_ns: int) -> bytes:
    """The file of these events, in their order."""
    stream = BytesIO()
    writer = Writer(stream, compression=CompressionType.NONE)
    writer.start(profile="", library=_LIBRARY)
    schema = writer.register_schema("foxglove.Log", "jsonschema", json.dumps(_SCHEMA).encode())
    channel = writer.register_channel("events", "json", schema)
    for number, event in enumerate(events):
        t_ns = min(max(event.tick * period_ns, 0), (1 << 63) - 1)
        data = json.dumps(_message(event, t_ns), ensure_ascii=False).encode()
        writer.add_message(channel, t_ns, data, t_ns, sequence=number)
    writer.finish()
    return stream.getvalue()


def _message(event: Event, t_ns: int) -> dict[str, Any]:
    text = f": {event.text}" if event.text else ""
    return {
        "timestamp": {"sec": t_ns // 1_000_000_000, "nsec": t_ns % 1_000_000_000},
        "level": _INFO,
        "message": f"{event.kind}{text}",
        "name": event.source,
        "file": "",
        "line": 0,
        "tick": event.tick,
        "kind": event.kind,
    }
