"""Messages of a record from rows, many at once: each the bytes that are in the file.

A block of messages of one channel and of equal length is one numpy array, of a type of
`fleetloop.record.schema.message_type`.
"""

import numpy as np

from configs.signals import PLANT_SIGNALS
from fleetloop.record.schema import (
    FLEET_SIGNALS,
    POSE_TYPE,
    Layout,
    View,
    fleet_type,
    message_type,
)

POSE_PERIOD_NS = 20_000_000
_MESSAGE = 0x05  # MCAP's opcode
_HEADER_BYTES = 9
_CDR_LITTLE_ENDIAN = 0x0000_0100


def row_messages(
    layout: Layout, channel: int, first_tick: int, rows: np.ndarray, period_ns: int
) -> np.ndarray:
    """Messages of consecutive ticks; `rows` are float64, one line per tick."""
    ticks = np.arange(first_tick, first_tick + len(rows))
    messages = _blank(layout.message_type(channel), channel, ticks, period_ns)
    payload = messages["payload"]
    payload["tick"] = messages["sequence"]
    for column, (name, *_) in enumerate(layout.signals(channel)):
        payload[name] = rows[:, column]
    return messages


def pose_messages(channel: int, first_tick: int, rows: np.ndarray, period_ns: int) -> np.ndarray:
    """Pose messages of those ticks that begin a new pose period; `rows` are the plant's."""
    ticks = np.arange(first_tick, first_tick + len(rows))
    every = max(1, POSE_PERIOD_NS // period_ns)
    chosen = ticks % every == 0
    messages = _blank(message_type(POSE_TYPE), channel, ticks[chosen], period_ns)
    payload = messages["payload"]
    payload["sec"] = messages["log_time"] // 1_000_000_000
    payload["nanosec"] = messages["log_time"] % 1_000_000_000
    payload["frame_length"] = 6
    payload["frame"] = b"world"
    names = [signal.name for signal in PLANT_SIGNALS]
    payload["position"][:, 0] = rows[chosen, names.index("x_m")]
    payload["position"][:, 1] = rows[chosen, names.index("y_m")]
    heading = rows[chosen, names.index("theta_rad")]
    payload["orientation"][:, 2] = np.sin(heading / 2)
    payload["orientation"][:, 3] = np.cos(heading / 2)
    return messages


def framed(
    channel: int, sequences: np.ndarray, times_ns: np.ndarray, bodies: np.ndarray
) -> np.ndarray:
    """Messages of equal length; `bodies`: a row of bytes for each, without the CDR header."""
    layout = message_type(np.dtype(f"V{bodies.shape[1]}"))
    messages = _blank(layout, channel, sequences, 0)
    messages["log_time"] = messages["publish_time"] = times_ns
    messages["payload"] = np.ascontiguousarray(bodies).view(layout["payload"])[:, 0]
    return messages


def unframed(messages: np.ndarray) -> list[tuple[int, bytes]]:
    """Log time [ns] and content (CDR, with its header) of each message."""
    raw, size = messages.tobytes(), messages.itemsize
    begin = size - messages.dtype["cdr"].itemsize - messages.dtype["payload"].itemsize
    times_ns = messages["log_time"].tolist()
    return [(time_ns, raw[n * size + begin : (n + 1) * size]) for n, time_ns in enumerate(times_ns)]


def fleet_messages(
    ticks: np.ndarray, s_spread: np.ndarray, s_difference: np.ndarray, period_ns: int
) -> np.ndarray:
    """Messages of `fleet`; `s_difference`: a row per tick, a column per robot [m]."""
    layout = message_type(fleet_type(s_difference.shape[1]))
    messages = _blank(layout, View.FLEET, ticks, period_ns)
    spread, difference = (signal.name for signal in FLEET_SIGNALS)
    messages["payload"]["tick"] = ticks
    messages["payload"][spread] = s_spread
    messages["payload"][difference] = s_difference
    return messages


def _blank(
    layout: np.dtype[np.void], channel: int, ticks: np.ndarray, period_ns: int
) -> np.ndarray:
    messages = np.zeros(len(ticks), layout)
    messages["opcode"] = _MESSAGE
    messages["length"] = messages.dtype.itemsize - _HEADER_BYTES
    messages["channel"] = channel
    messages["sequence"] = ticks
    messages["log_time"] = messages["publish_time"] = ticks * period_ns
    messages["cdr"] = _CDR_LITTLE_ENDIAN
    return messages
