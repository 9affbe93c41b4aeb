"""The channels of a record, their message layouts and schemas.

    channel                    schema                            one message
    robot/<name>/plant         fleetloop_msgs/msg/Plant          a tick: the truth
    robot/<name>/controller    fleetloop_msgs/msg/Controller     a tick: what was used and commanded
    robot/<name>/pose          geometry_msgs/msg/PoseStamped     every 20 ms
    scene/paths                foxglove_msgs/msg/SceneUpdate     at tick 0: the robots' paths
    scene/robots               foxglove_msgs/msg/SceneUpdate     every 50 ms: the robots
    scene/references           foxglove_msgs/msg/SceneUpdate     every 50 ms: their references
    scene/edges                foxglove_msgs/msg/SceneUpdate     every 50 ms: the graph
    tf                         foxglove_msgs/msg/FrameTransforms every 50 ms: the robots' frames
    fleet                      fleetloop_msgs/msg/Fleet          every 50 ms: differences of s
    log                        foxglove_msgs/msg/Log             an event

Messages are CDR (little endian) with ROS 2 schemas, which Foxglove opens. Those of a robot's
channel are of fixed size, so that a block of them is one numpy array: MCAP's record header, the CDR
header, then the fields; the others are made of these (`fleetloop.record.views`), but for events.
Field names in the schemas are the signals' in lower case, as ROS wants them; the names as they are
and the units stand in the channels' metadata, units and meanings in the schemas. Robots with
different laws have different schemas `Controller`, `Controller2`, ... So a record needs nothing
else to be read. Times are scenario time; nothing in a record knows the wall clock, so equal runs
leave equal files.

Before the messages stand channels and scenario (`fleetloop.record.head`), behind them what is
missing in the file (`fleetloop.record.scan`); every byte is under some check sum.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import NamedTuple

import numpy as np

from configs.signals import PLANT_SIGNALS, SPREAD, Signal
from fleetloop.record.foxglove_schemas import schema_text

SIGNALS, UNITS, ROBOTS = "signals", "units", "robots"
"""Metadata of channels: names of the signals in the order of the fields, and, as JSON, the units by
field; of `fleet` the robots in the order of its arrays."""
_MESSAGE_HEADER = [
    ("opcode", "<u1"),
    ("length", "<u8"),
    ("channel", "<u2"),
    ("sequence", "<u4"),
    ("log_time", "<u8"),
    ("publish_time", "<u8"),
]


class View(IntEnum):
    """Channels of the whole fleet, by their ids: 3-D views, plots and log panels show them."""

    PATHS = 1
    ROBOTS = 2
    REFERENCES = 3
    EDGES = 4
    TRANSFORMS = 5
    FLEET = 6
    LOG = 7


class Kind(IntEnum):
    """Channels of a robot."""

    PLANT = 0
    CONTROLLER = 1
    POSE = 2


_VIEWS, _KINDS = len(View), len(Kind)
VIEW_TOPICS: Mapping[View, str] = {
    View.PATHS: "scene/paths",
    View.ROBOTS: "scene/robots",
    View.REFERENCES: "scene/references",
    View.EDGES: "scene/edges",
    View.TRANSFORMS: "tf",
    View.FLEET: "fleet",
    View.LOG: "log",
}
FLEET_SIGNALS: tuple[Signal, ...] = (
    Signal(SPREAD, "m", "largest s_i minus the smallest"),
    Signal("s_difference", "m", "s_i minus the mean of all s, of the robots in their order"),
)
"""Of the robots whose controllers gave a finite s; the second one of each robot."""


@cache
def row_type(signals: tuple[Signal, ...]) -> np.dtype[np.void]:
    """One row: the tick, then the signals by name."""
    fields = [("tick", "<i8"), *((signal.name, "<f8") for signal in signals)]
    return np.dtype(fields)


def fleet_type(robots: int) -> np.dtype[np.void]:
    """The payload of `fleet`."""
    spread, difference = (signal.name for signal in FLEET_SIGNALS)
    return np.dtype([("tick", "<i8"), (spread, "<f8"), (difference, "<f8", robots)])


@cache
def message_type(payload: np.dtype[np.void]) -> np.dtype[np.void]:
    """One message, as it is in the file: MCAP's header, CDR's, then the fields."""
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
    """MCAP's channel id of a robot's channel; behind those of the views."""
    return _VIEWS + robot_number * _KINDS + kind + 1


def view_of(channel: int) -> View | None:
    """The view that a channel is by its id; None: a robot's channel."""
    return View(channel) if channel <= _VIEWS else None


def kind_of(channel: int) -> Kind:
    """The kind of a robot's channel by its id."""
    return Kind((channel - _VIEWS - 1) % _KINDS)


def robot_number_of(channel: int) -> int:
    """The robot of a robot's channel by its id."""
    return (channel - _VIEWS - 1) // _KINDS


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
            return message_type(POSE_TYPE)
        return message_type(self.row_type(channel))

    @property
    def channels(self) -> range:
        """The ids of all channels."""
        return range(1, _VIEWS + len(self.robots) * _KINDS + 1)

    def topic(self, channel: int) -> str:
        """The topic of a channel."""
        view = view_of(channel)
        if view is not None:
            return VIEW_TOPICS[view]
        return topic(self.robots[robot_number_of(channel)], kind_of(channel))

    def metadata(self, channel: int) -> dict[str, str]:
        """What a channel says of its fields: signals by name, and units by field."""
        if view_of(channel) is View.FLEET:
            return {ROBOTS: " ".join(self.robots), UNITS: _units(FLEET_SIGNALS)}
        if view_of(channel) is not None or kind_of(channel) is Kind.POSE:
            return {}
        signals = self.signals(channel)
        return {SIGNALS: " ".join(signal.name for signal in signals), UNITS: _units(signals)}

    def schemas(self) -> Iterator[SchemaText]:
        """Every schema once."""
        yield SchemaText(1, "fleetloop_msgs/msg/Plant", _row_schema(PLANT_SIGNALS))
        yield _published(2, "geometry_msgs/PoseStamped")
        yield _published(3, "foxglove_msgs/SceneUpdate")
        yield _published(4, "foxglove_msgs/FrameTransforms")
        yield _published(5, "foxglove_msgs/Log")
        yield SchemaText(6, "fleetloop_msgs/msg/Fleet", _fleet_schema(len(self.robots)))
        for n, signals in enumerate(dict.fromkeys(self.controllers)):
            name = f"fleetloop_msgs/msg/Controller{n + 1 if n else ''}"
            yield SchemaText(7 + n, name, _row_schema(signals))

    def schema_number(self, channel: int) -> int:
        """The schema of a channel."""
        match view_of(channel):
            case None:
                pass
            case View.TRANSFORMS:
                return 4
            case View.LOG:
                return 5
            case View.FLEET:
                return 6
            case _:
                return 3
        match kind_of(channel):
            case Kind.PLANT:
                return 1
            case Kind.POSE:
                return 2
        return 7 + list(dict.fromkeys(self.controllers)).index(self.signals(channel))


def _published(number: int, name: str) -> SchemaText:
    return SchemaText(number, name.replace("/", "/msg/"), schema_text(name))


def _units(signals: Sequence[Signal]) -> str:
    return json.dumps({s.name.lower(): s.unit for s in signals}, ensure_ascii=False)


def _fleet_schema(robots: int) -> str:
    spread, difference = FLEET_SIGNALS
    lines = (
        "int64 tick  # control tick",
        f"float64 {spread.name}  # [{spread.unit}] {spread.meaning}",
        f"float64[{robots}] {difference.name}  # [{difference.unit}] {difference.meaning}",
    )
    return "\n".join(lines) + "\n"


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
