"""Flood guard of the router: stops controllers that send far more than the schedule allows.

Zenoh limits rates by dropping messages, and in lockstep no honest message may be dropped. So the
guard reads the kernel's counters of each connection several times a second into a leaky bucket, and
stops reading from a controller whose bucket overflows. A controller sends at most one path state
per tick, and its rows in blocks.

    leak        `MESSAGES_PER_TICK`, `BYTES_PER_TICK` for each tick that the run went on
                `MESSAGES_PER_S`, `BYTES_PER_S` for the start and for what isn't known here
    runs over   at `BURST_MESSAGES`, `BURST_BYTES`

The kernel then drops what arrives: a client of Zenoh that is disconnected would reconnect at once.
The same happens at every later login of such a user (`router_refusals`). The socket is Zenoh's,
found by its descriptor. Messages are counted as TCP segments with data: messages that travel
together count once, and cost as little.
"""

import ctypes
import socket
import struct
from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

from bridge.network.connections import Connections

MESSAGES_PER_TICK, BYTES_PER_TICK = 4, 1024
"""Three times a row and a path state."""
MESSAGES_PER_S, BYTES_PER_S = 1000, 1 << 17
BURST_MESSAGES, BURST_BYTES = 2000, 1 << 20
_TCP_INFO = struct.Struct("=128x Q 16x I")
"""Of Linux's tcp_info: bytes received in order, and segments that brought data."""
_SO_ATTACH_FILTER = 26
_NO_DATA = (
    (0x30, 0, 0, 12),  # A = byte 12 of the TCP header, where its length is
    (0x54, 0, 0, 0xF0),
    (0x74, 0, 0, 2),  # A >>= 2: the length in bytes
    (0x07, 0, 0, 0),  # X = A
    (0x80, 0, 0, 0),  # A = length of the packet
    (0x1D, 0, 1, 0),  # nothing behind the header?
    (0x06, 0, 0, 0xFFFF_FFFF),  # take it
    (0x06, 0, 0, 0),  # drop it
)
"""A classic BPF program that passes acknowledgements, awaited by the sender, and drops data."""


class Received(NamedTuple):
    """What came over one connection so far."""

    messages: int
    size: int


@dataclass(slots=True)
class Bucket:
    """How much more than it may one connection has said."""

    seen: Received
    messages: float = 0.0
    size: float = 0.0

    def fill(self, now: Received, ticks: float, seconds: float) -> bool:
        """Add what came since the last time; return whether it runs over."""
        fresh = Received(*(after - before for after, before in zip(now, self.seen, strict=True)))
        self.seen = now
        leaked = MESSAGES_PER_TICK * ticks + MESSAGES_PER_S * seconds
        self.messages = max(self.messages + fresh.messages - leaked, 0.0)
        leaked = BYTES_PER_TICK * ticks + BYTES_PER_S * seconds
        self.size = max(self.size + fresh.size - leaked, 0.0)
        return self.messages > BURST_MESSAGES or self.size > BURST_BYTES


class FloodGuard:
    """Looks at the connections of one router; told the time and the ticks."""

    def __init__(self) -> None:
        self._connections = Connections()
        self._buckets: dict[str, Bucket] = {}  # by peer
        self._before: tuple[int, float] | None = None  # ticks and seconds at the last look

    def look(self, users: Collection[str], ticks: int, now_s: float) -> list[str]:
        """Take nothing more from peers that say too much; return which.

        Args:
            users: where controllers are, as "address:port"; other peers are ignored.
            ticks: how far the run is.
            now_s: seconds on any clock.
        """
        before, self._before = self._before or (ticks, now_s), (ticks, now_s)
        went_on, passed_s = max(ticks - before[0], 0), now_s - before[1]
        buckets, self._buckets = self._buckets, {}
        cut = []
        for peer, connection in self._connections.to(users):
            with connection:
                received = _received(connection)
                bucket = buckets.get(peer) or Bucket(received)
                if bucket.fill(received, went_on, passed_s):
                    _take_nothing(connection)
                    cut.append(peer)
                else:
                    self._buckets[peer] = bucket
        return cut


def deafen(peer: str) -> None:
    """Take nothing more from this peer; after Zenoh's lease the router ends its session."""
    for _, connection in Connections().to({peer}):
        with connection:
            _take_nothing(connection)


def _take_nothing(connection: socket.socket) -> None:
    """Let the kernel drop what comes: the peer isn't told, and so doesn't come again at once."""
    code = b"".join(struct.pack("HBBI", *instruction) for instruction in _NO_DATA)
    kept = ctypes.create_string_buffer(code, len(code))
    program = struct.pack("HL", len(_NO_DATA), ctypes.addressof(kept))
    connection.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, program)


def _received(connection: socket.socket) -> Received:
    info = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _TCP_INFO.size)
    if len(info) < _TCP_INFO.size:  # an older kernel, which counts neither
        return Received(0, 0)
    size, messages = _TCP_INFO.unpack(info)
    return Received(messages, size)
