"""Events of a run in its record: the channel `log`, for the log panel of a viewer.

Each is a foxglove_msgs/msg/Log: the event's source as `name`, kind and text as `message`. Times are
scenario time, of the countdown 0. They are added to the record once all processes have ended, as
only then all of them are known and in order.
"""

from collections.abc import Sequence

import numpy as np

from configs.events import KINDS, Event, Gravity
from fleetloop.record.cdr import Layer
from fleetloop.record.chunks import Block
from fleetloop.record.mcap_file import McapFile
from fleetloop.record.messages import framed
from fleetloop.record.reader import Record
from fleetloop.record.schema import View

_LEVELS = {Gravity.INFO: 2, Gravity.WARNING: 3, Gravity.ERROR: 4}
"""Of foxglove_msgs/msg/Log."""
_LAST_NS = ((1 << 31) - 1) * 1_000_000_000
"""Of builtin_interfaces/Time."""


def add_events(record: Record, events: Sequence[Event], period_ns: int) -> None:
    """Add events, in the order of their ticks, to a record that was read; only to a complete one.

    Raises:
        InfrastructureError: they can't be written; the record is as it was.
    """
    found = record.file
    if events and found is not None and found.closed and not found.damaged:
        parts = [log_message(event, n, period_ns) for n, event in enumerate(events)]
        McapFile.reopen(record.path, found).add(Block.of(View.LOG, *parts), found.lost)


def log_message(event: Event, number: int, period_ns: int) -> np.ndarray:
    """The message of an event, as an array of one."""
    layer = Layer()
    layer.stamp()
    layer.uint8(_LEVELS[KINDS[event.kind].gravity])
    layer.string(f"{event.kind}: {event.text}" if event.text else event.kind)
    layer.string(event.source)
    layer.string("")  # file
    layer.uint32(0)  # line
    times_ns = np.array([min(max(event.tick * period_ns, 0), _LAST_NS)])
    body = layer.template().filled(times_ns, np.empty((1, 0)))
    return framed(View.LOG, np.array([number]), times_ns, body)
