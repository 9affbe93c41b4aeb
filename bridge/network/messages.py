"""Messages over Zenoh and their encoding.

A message is a msgpack array that begins with the version of its layout. Decoding is bounded: too
long, the wrong types, a wrong length, an unknown version or a number that isn't finite give None,
never an exception; the caller counts it. Text is for people: what doesn't print, such as a
terminal's escapes, is replaced. Times are scenario time in ns. A message may be well formed and
still be impossible: readers that know the run check that. The status of a progress message is nil
or one of `bridge.network.status`.

    message        layout                                        key
    PathState      [1, tick, t_ns, s, v_hat]                     robot/<name>/path
    Silence        [1, tick]                                     robot/<name>/silence, path
    PoseFix        [1, tick, t_ns, x_m, y_m, theta_rad]          robot/<name>/pose
    LeaderSpeed    [1, [[from_t_ns, speed_m_s, ramp_ns], ...]]   leader/speed
    Rows           [1, first_tick, length, rows, final]          robot/<name>/truth, telemetry;
                                                                 robot/<name>/inputs: bytes
    Progress       [1, tick, t_ns, wall_ns, status]              @progress/<process>
    Notice         [1, tick, source, kind, text]                 @notice/<process>
    Go             [1, epoch_ns, ticks]                          @clock/go
    ClockPing      [1, sent_ns]                                  @clock/ping
    ClockPong      [1, sent_ns, received_ns, answered_ns]        @pong/<process>
"""

from typing import Any, Final, NamedTuple

from bridge.network.packing import MAX_BYTES, finite, ints, pack, printable, unpack
from bridge.network.status import Status, status_of
from configs.events import KINDS, MAX_EVENT_TEXT, Event
from configs.leader_speed import SpeedChange, in_order

MOST_BYTES: Final = {
    "path": 128,
    "silence": 128,
    "pose": 128,
    "progress": 1 << 16,
    "pong": 128,
    "notice": 1 << 12,
    "order": MAX_BYTES,
    "answer": 1 << 12,
    "truth": 1 << 16,
    "telemetry": 1 << 16,
    "inputs": 1 << 16,
    "traffic": 1 << 16,
    "report": MAX_BYTES,
    "up": 1 << 16,
}
"""Of what others than the launcher say, by `bridge.network.keys.kind`: several times what they
need."""
PROGRESS_EVERY_S: Final = 0.2
"""Longest time from one progress message of a process to the next: its signs of life [wall s]."""
_MAX_CHANGES: Final = 10_000


class PathState(NamedTuple):
    """What a robot says to its out-neighbours."""

    tick: int
    t_ns: int
    s: float  # [m]
    v_hat: float  # [m/s]

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(*self)

    @classmethod
    def decode(cls, payload: bytes) -> "PathState | None":
        """The message in the bytes, None if there is none."""
        fields = unpack(payload, 5)
        if fields is None or not (ints(fields[1:3]) and finite(fields[3:])):
            return None
        return cls(fields[1], fields[2], fields[3], fields[4])


class Silence(NamedTuple):
    """In lockstep: a robot has no path state at this tick; its out-neighbours don't wait for it.

    The plant says it of robots whose controllers are absent, a controller until it has re-joined.
    """

    tick: int

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(*self)

    @classmethod
    def decode(cls, payload: bytes) -> "Silence | None":
        """The message in the bytes, None if there is none."""
        fields = unpack(payload, 2)
        return cls(*fields[1:]) if fields is not None and ints(fields[1:]) else None


class PoseFix(NamedTuple):
    """What the localisation system says to a robot."""

    tick: int
    t_ns: int
    x_m: float
    y_m: float
    theta_rad: float

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(*self)

    @classmethod
    def decode(cls, payload: bytes) -> "PoseFix | None":
        """The message in the bytes, None if there is none."""
        fields = unpack(payload, 6)
        if fields is None or not (ints(fields[1:3]) and finite(fields[3:])):
            return None
        return cls(*fields[1:])


class LeaderSpeed(NamedTuple):
    """The virtual leader's speed v_r: see `configs.leader_speed`."""

    changes: tuple[SpeedChange, ...]

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(self.changes)

    @classmethod
    def decode(cls, payload: bytes) -> "LeaderSpeed | None":
        """The message in the bytes, None if there is none."""
        fields = unpack(payload, 2)
        if fields is None or not isinstance(fields[1], list):
            return None
        if not 1 <= len(fields[1]) <= _MAX_CHANGES:
            return None
        for change in fields[1]:
            if not (isinstance(change, list) and len(change) == 3):
                return None
            if not (ints(change[::2]) and finite(change[1:2]) and change[2] >= 0):
                return None
        changes = tuple(SpeedChange(*change) for change in fields[1])
        return cls(changes) if in_order(changes) else None


class Rows(NamedTuple):
    """A block of rows of consecutive ticks, as `bridge.network.telemetry` packs them."""

    first_tick: int
    length: int  # rows in the block
    rows: bytes
    final: bool  # nothing follows

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(*self)

    @classmethod
    def decode(cls, payload: bytes, row_bytes: int) -> "Rows | None":
        """The message in the bytes, None if there is none or its rows aren't `row_bytes` long."""
        fields = unpack(payload, 5)
        if fields is None or not ints(fields[1:3]):
            return None
        _, _, length, rows, final = fields
        if not isinstance(rows, bytes) or not isinstance(final, bool):
            return None
        return cls(*fields[1:]) if len(rows) == length * row_bytes else None


class Progress(NamedTuple):
    """How far a process is, and now and then what is to be seen of it."""

    tick: int
    t_ns: int
    wall_ns: int  # since control began
    status: Status | None = None

    def encode(self) -> bytes:
        """Bytes for the wire; without a status that is too long for it."""
        tick, t_ns, wall_ns, status = self
        payload = pack(tick, t_ns, wall_ns, None if status is None else status.fields())
        return (
            payload
            if len(payload) <= MOST_BYTES["progress"]
            else self._replace(status=None).encode()
        )

    @classmethod
    def decode(cls, payload: bytes) -> "Progress | None":
        """The message in the bytes, None if there is none."""
        if len(payload) > MOST_BYTES["progress"]:
            return None
        fields = unpack(payload, 5)
        if fields is None or not ints(fields[1:4]):
            return None
        _, tick, t_ns, wall_ns, said = fields
        status = None if said is None else status_of(said)
        if said is not None and status is None:
            return None
        return cls(tick, t_ns, wall_ns, status)


class Notice(NamedTuple):
    """An event that has just happened."""

    event: Event

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(*self.event._replace(text=self.event.text[:MAX_EVENT_TEXT]))

    @classmethod
    def decode(cls, payload: bytes) -> "Notice | None":
        """The message in the bytes, None if there is none."""
        fields = unpack(payload, 5)
        event = None if fields is None else event_of(fields[1:])
        return None if event is None else cls(event)


def event_of(fields: list[Any]) -> Event | None:
    """The event in fields of a message, its texts in one line; None if there is none."""
    if len(fields) != len(Event._fields) or not ints(fields[:1]):
        return None
    if any(type(text) is not str or len(text) > MAX_EVENT_TEXT for text in fields[1:]):
        return None
    tick, source, kind, text = fields
    if kind not in KINDS:
        return None
    return Event(tick, *(printable(it.replace("\n", " ")) for it in (source, kind, text)))


class Go(NamedTuple):
    """All processes are ready; in real time, tick 0 is at this reading of the wall clock."""

    epoch_ns: int
    ticks: int  # of the run

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(*self)

    @classmethod
    def decode(cls, payload: bytes) -> "Go | None":
        """The message in the bytes, None if there is none."""
        fields = unpack(payload, 3)
        return cls(*fields[1:]) if fields is not None and ints(fields[1:]) else None


class ClockPing(NamedTuple):
    """The launcher asks for the time, at this reading of its wall clock."""

    sent_ns: int

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(*self)

    @classmethod
    def decode(cls, payload: bytes) -> "ClockPing | None":
        """The message in the bytes, None if there is none."""
        fields = unpack(payload, 2)
        return cls(*fields[1:]) if fields is not None and ints(fields[1:]) else None


class ClockPong(NamedTuple):
    """The answer: when the question was sent, came and was answered, each by its own wall clock."""

    sent_ns: int
    received_ns: int
    answered_ns: int

    def encode(self) -> bytes:
        """Bytes for the wire."""
        return pack(*self)

    @classmethod
    def decode(cls, payload: bytes) -> "ClockPong | None":
        """The message in the bytes, None if there is none."""
        fields = unpack(payload, 4)
        return cls(*fields[1:]) if fields is not None and ints(fields[1:]) else None
