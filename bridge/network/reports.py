"""Reports: what the processes of a run say at their end, on @report/<process>.

A report is a message like those in `bridge.network.messages`: an array of the version and the
fields below, in this order. The process decides the layout, so that no process can send the report
of another role.

    process        layout
    every role     [1, failure, left_early, events, remarks, flooders, missing_privileges, cpu_ns,
                    durations_ns, profile_ns]
    plant          the same, then [overruns, frames, stopped_robots, bus_troubles, stalls,
                    nodes]
    agent/<robot>  the same, then [stop_reason, stop_tick, deadlines, messages]
    launcher       [1, reason]

Encoding cuts texts that are too long; decoding refuses them, as it refuses wrong types and numbers
that aren't finite.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple, Self

from bridge.network.messages import event_of
from bridge.network.packing import finite, ints, pack, printable, unpack
from bridge.process.awake import MAX_STALLS, Stall
from configs.events import MAX_EVENT_TEXT, MAX_EVENTS, Event
from configs.roles import AGENT, PLANT

MAX_TEXT = 1 << 15
"""Characters of a text, and of all texts of a list."""
MAX_ENTRIES = 4096
"""Of a list or a mapping."""
MAX_NAME = 128


class Deadlines(NamedTuple):
    """How well a controller kept its time, in real time."""

    misses: int  # no feedback of its torques before the next tick was due
    skipped: int  # computed after the next tick was due, and not sent


Events = tuple[Event, ...]
Texts = tuple[str, ...]
TextByName = Mapping[str, str]
NumberByName = Mapping[str, int]
CountsByName = Mapping[str, Mapping[str, int]]
Stalls = tuple[Stall, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What every role reports."""

    failure: str = ""
    """The error that ended it; empty if none did."""
    left_early: str = ""
    """Why it left before the end of the run; empty if it did not."""
    events: Events = ()
    """Events of its run, in their order."""
    remarks: Texts = ()
    """Remarks on its whole run, in words."""
    flooders: Texts = ()
    """Senders of so many refused messages that it had no time for others."""
    missing_privileges: Texts = ()
    """What the kernel refused of what real time needs."""
    cpu_ns: int = 0
    """Processor time of all threads, from the first tick on."""
    durations_ns: NumberByName = field(default_factory=dict)
    """Wall time, by what it was spent on."""
    profile_ns: NumberByName = field(default_factory=dict)
    """Sampled processor time, by part of the code (`bridge.process.profile`)."""

    def encode(self) -> bytes:
        """Bytes for the wire; texts that are too long lose their end."""
        return pack(*(_cut(getattr(self, it.name)) for it in fields(self)))

    @classmethod
    def decode(cls, payload: bytes) -> Self | None:
        """The report in the bytes, None if there is none."""
        layout = fields(cls)
        values = unpack(payload, len(layout) + 1)
        if values is None:
            return None
        try:
            read = [_READERS[it.type](v) for it, v in zip(layout, values[1:], strict=True)]
        except _MalformedError:
            return None
        return cls(**{it.name: value for it, value in zip(layout, read, strict=True)})


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantReport(Report):
    """What the plant reports."""

    overruns: int = 0
    """Ticks that were due before the plant could begin them."""
    frames: NumberByName = field(default_factory=dict)
    """Frames that crossed each bus."""
    stopped_robots: TextByName = field(default_factory=dict)
    """Robots whose motion diverged, and how."""
    bus_troubles: TextByName = field(default_factory=dict)
    """Buses that failed, and how."""
    stalls: Stalls = ()
    """In real time, when the plant or its machine stood still."""
    nodes: CountsByName = field(default_factory=dict)
    """Frames of the nodes of buses with bit timing, by bus/node and by their fate."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentReport(Report):
    """What a controller reports."""

    stop_reason: str = ""
    """Why the robot stopped itself; empty if it did not."""
    stop_tick: int = 0
    deadlines: Deadlines | None = None
    """In real time only."""
    messages: CountsByName = field(default_factory=dict)
    """Messages on the emulated edges to it, by source and by their fate."""


class LauncherReport(NamedTuple):
    """Why the launcher ended the run before its time, to roles on other machines."""

    reason: str

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(self.reason[:MAX_TEXT])

    @classmethod
    def decode(cls, payload: bytes) -> "LauncherReport | None":
        """The message in the bytes, None if there is none."""
        values = unpack(payload, 2)
        try:
            return None if values is None else cls(_text(values[1]))
        except _MalformedError:
            return None


_TYPES: Mapping[str, type[Report]] = {PLANT.name: PlantReport, AGENT.name: AgentReport}


def decode_report(process: str, payload: bytes) -> Report | None:
    """The report of a process, None if the bytes are none of its role."""
    return _TYPES.get(process.partition("/")[0], Report).decode(payload)


class _MalformedError(ValueError):
    """A field isn't what its place in the layout says."""


def _text(value: Any) -> str:
    if type(value) is not str or len(value) > MAX_TEXT:
        raise _MalformedError
    return printable(value)


def _number(value: Any) -> int:
    if not ints([value]):
        raise _MalformedError
    number: int = value
    return number


def _texts(value: Any) -> Texts:
    if type(value) is not list or len(value) > MAX_ENTRIES:
        raise _MalformedError
    texts = tuple(_text(text) for text in value)
    if sum(map(len, texts)) > MAX_TEXT:
        raise _MalformedError
    return texts


def _events(value: Any) -> Events:
    if type(value) is not list or len(value) > MAX_EVENTS:
        raise _MalformedError
    events = [event_of(it) if type(it) is list else None for it in value]
    read = tuple(event for event in events if event is not None)
    if len(read) < len(events) or sum(len(event.text) for event in read) > MAX_TEXT:
        raise _MalformedError
    return read


def _by_name(value: Any, read: Callable[[Any], Any]) -> dict[str, Any]:
    if type(value) is not dict or len(value) > MAX_ENTRIES:
        raise _MalformedError
    if any(type(name) is not str or len(name) > MAX_NAME for name in value):
        raise _MalformedError
    return {printable(name): read(item) for name, item in value.items()}


def _stalls(value: Any) -> Stalls:
    if type(value) is not list or len(value) > MAX_STALLS:
        raise _MalformedError
    for stall in value:
        if type(stall) is not list or len(stall) != 2 or not finite(stall[1:]):
            raise _MalformedError
    return tuple(Stall(_number(tick), lasted_s) for tick, lasted_s in value)


def _deadlines(value: Any) -> Deadlines | None:
    if value is None:
        return None
    if type(value) is not list or len(value) != 2:
        raise _MalformedError
    return Deadlines(*map(_number, value))


_READERS: Mapping[Any, Callable[[Any], Any]] = {
    str: _text,
    int: _number,
    Events: _events,
    Texts: _texts,
    NumberByName: lambda value: _by_name(value, _number),
    CountsByName: lambda value: _by_name(value, lambda inner: _by_name(inner, _number)),
    TextByName: lambda value: _by_name(value, _text),
    Stalls: _stalls,
    Deadlines | None: _deadlines,
}
"""By the annotation of a field."""


def _cut(value: Any) -> Any:
    if isinstance(value, str):
        return value[:MAX_TEXT]
    if isinstance(value, tuple) and value and isinstance(value[0], Event):
        return _cut_events(value)
    if isinstance(value, tuple) and value and isinstance(value[0], str):
        return _cut_texts(value)
    if isinstance(value, Mapping):
        return {name[:MAX_NAME]: _cut(item) for name, item in [*value.items()][:MAX_ENTRIES]}
    return value


def _cut_events(events: Events) -> Events:
    """As many as there may be, their texts as long as there is room for."""
    kept, left = [], MAX_TEXT
    for event in events[:MAX_EVENTS]:
        text = event.text[: min(left, MAX_EVENT_TEXT)]
        kept.append(event._replace(text=text))
        left -= len(text)
    return tuple(kept)


def _cut_texts(texts: Texts) -> Texts:
    """As many as there is room for, the last one perhaps without its end."""
    kept, left = [], MAX_TEXT
    for text in texts[:MAX_ENTRIES]:
        if left <= 0:
            break
        kept.append(text[:left])
        left -= len(text)
    return tuple(kept)
