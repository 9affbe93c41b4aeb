"""The channels of a record, their message layouts and schemas.

    channel                    schema                          one message
    robot/<name>/plant         fleetloop_msgs/msg/Plant        a tick: the truth
    robot/<name>/controller    fleetloop_msgs/msg/Controller   a tick: what was used and commanded
    robot/<name>/pose          geometry_msgs/msg/PoseStamped   every 20 ms: for 3-D views

Messages are CDR (little endian) with ROS 2 schemas, which Foxglove opens, and of fixed size, so
that a block of them is one numpy array: MCAP's record header, the CDR header, then the fields.
Field names in the schemas are the signals' in lower case, as ROS wants them; the names as they are
stand in the channels' metadata, units and meanings in the schemas. Robots with different laws have
different schemas `Controller`, `Controller2`, ... So a record needs nothing else to be read. Times
are scenario time; nothing in a record knows the wall clock, so equal runs leave equal files.

Before the messages stand channels and scenario (`fleetloop.record.head`), behind them what is
missing in the file (`fleetloop.record.scan`); every byte is under some check sum.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import NamedTuple

import numpy as np

from configs.signals import PLANT_SIGNALS, Signal

POSE_PERIOD_NS = 20_000_000
_MESSAGE = 0x05  # MCAP's opcode
_MESSAGE_HEADER = [
    ("opcode", "<u1"),
    ("length", "<u8"),
    ("channel", "<u2"),
    ("sequence", "<u4"),
    ("log_time", "<u8"),
    ("publish_time", "<u8"),
]
_HEADER_BYTES = 9
_CDR_LITTLE_ENDIAN = 0x0000_0100


class Kind(IntEnum):
    """Channels of a robot."""

    PLANT = 0
    CONTROLLER = 1
    POSE = 2


@cache
def row_type(signals: tuple[Signal, ...]) -> np.dtype[np.void]:
    """One row: the tick, then the signals by name."""
    fields = [("tick", "<i8"), *((signal.name, "<f8") for signal in signals)]
    return np.dtype(fields)


@cache
def _message_type(payload: np.dtype[np.void]) -> np.dtype[np.void]:
    return np.dtype([*_MESSAGE_HEADER, ("cdr", "<u4"), ("payload", payload)])


POSE_TYPE = np.dtype(
    [
        ("sec", "<i4"),
        ("nanosec", "<u4"),
        ("frame_length", "<u4"),
        ("frame", "S6"),
        ("padding", "V6"),
        ("position", "<f8", 3),
        ("orientation", "<f8", 4),
    ]
)


def channel_id(robot_number: int, kind: Kind) -> int:
    """MCAP's channel id of a robot's channel; from 1."""
    return robot_number * len(Kind) + kind + 1


def kind_of(channel: int) -> Kind:
    """The kind of a channel by its id."""
    return Kind((channel - 1) % len(Kind))


def robot_number_of(channel: int) -> int:
    """The robot of a channel by its id."""
    return (channel - 1) // len(Kind)


def topic(robot: str, kind: Kind) -> str:
    """The topic of a robot's channel."""
    return f"robot/{robot}/{kind.name.lower()}"


class SchemaText(NamedTuple):
    """A schema of a record."""

    number: int
    name: str
    text: str


@dataclass(frozen=True, slots=True)
class Layout:
    """The robots of a record, and the tables of their controllers' rows."""

    robots: tuple[str, ...]
    controllers: tuple[tuple[Signal, ...], ...]

    @classmethod
    def of(cls, robots: Mapping[str, Sequence[Signal]]) -> "Layout":
        """The layout for robots with these tables."""
        return cls(tuple(robots), tuple(map(tuple, robots.values())))

    def signals(self, channel: int) -> tuple[Signal, ...]:
        """The table of a channel of rows."""
        if kind_of(channel) is Kind.PLANT:
            return PLANT_SIGNALS
        return self.controllers[robot_number_of(channel)]

    def row_type(self, channel: int) -> np.dtype[np.void]:
        """One row of a channel."""
        return row_type(self.signals(channel))

    def message_type(self, channel: int) -> np.dtype[np.void]:
        """One message of a channel, as it is in the file."""
        if kind_of(channel) is Kind.POSE:
            return _message_type(POSE_TYPE)
        return _message_type(self.row_type(channel))

    def schemas(self) -> Iterator[SchemaText]:
        """Every schema once."""
        yield SchemaText(1, "fleetloop_msgs/msg/Plant", _row_schema(PLANT_SIGNALS))
        yield SchemaText(2, "geometry_msgs/msg/PoseStamped", _POSE_SCHEMA)
        for n, signals in enumerate(dict.fromkeys(self.controllers)):
            name = f"fleetloop_msgs/msg/Controller{n + 1 if n else ''}"
            yield SchemaText(3 + n, name, _row_schema(signals))

    def schema_number(self, channel: int) -> int:
        """The schema of a channel."""
        match kind_of(channel):
            case Kind.PLANT:
                return 1
            case Kind.POSE:
                return 2
        return 3 + list(dict.fromkeys(self.controllers)).index(self.signals(channel))


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
    messages = _blank(_message_type(POSE_TYPE), channel, ticks[chosen], period_ns)
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


def _row_schema(signals: Sequence[Signal]) -> str:
    lines = [f"float64 {s.name.lower()}  # [{s.unit}] {s.meaning}" for s in signals]
    return "\n".join(["int64 tick  # control tick", *lines]) + "\n"


def signals_of(names: str, text: str) -> tuple[Signal, ...]:
    """The table of a channel: names from its metadata, units and meanings from its schema."""
    signals = []
    for name, line in zip(names.split(), text.splitlines()[1:], strict=False):
        unit, _, meaning = line.partition("  # [")[2].partition("] ")
        signals.append(Signal(name, unit, meaning))
    return tuple(signals)


_POSE_SCHEMA = """std_msgs/Header header
geometry_msgs/Pose pose
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""
