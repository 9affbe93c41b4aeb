"""A bus at the hub and the connections of its clients: identity, backlog, counters.

No call blocks. Packets that a client doesn't read are kept up to `BACKLOG`; beyond it the newest
are lost and counted, and a LOST packet tells the client where and how many.
"""

import contextlib
import socket
from collections import deque
from collections.abc import Iterable, Mapping
from typing import Final, Generic, TypeVar

from bridge.can_bus.packet import (
    FRAMES,
    Key,
    Stamped,
    Submitted,
    encode_lost,
    frames_in,
)
from bridge.frame import Frame

BACKLOG: Final = 100_000
TURN: Final = 1024
"""Frames that others than controllers get onto a bus at a time."""

_Item = TypeVar("_Item")


class SubmissionQueue(Generic[_Item]):
    """Frames that the clients of a bus submitted, until they are taken, in order.

    Frames of a controller in lockstep are taken at once. All other clients share `TURN` frames at a
    time, so that a flood delays no other client: no bus carries more in a tick.
    """

    __slots__ = ("_late", "now")

    def __init__(self) -> None:
        self.now: list[_Item] = []  # what will be taken next
        self._late: deque[_Item] = deque()

    def __len__(self) -> int:
        return len(self.now) + len(self._late)

    def put(self, items: Iterable[_Item], *, at_once: bool) -> None:
        """Add frames of a client."""
        if at_once or (len(self.now) < TURN and not self._late):
            self.now += items
        else:
            self._late.extend(items)

    def next_batch(self) -> list[_Item]:
        """Remove the frames whose turn it is, and return them."""
        now, self.now = self.now, []
        if late := self._late:
            self.now = [late.popleft() for _ in range(min(TURN, len(late)))]
        return now


class BusCounters:
    """Frames and packets of one bus that were lost."""

    __slots__ = ("dropped", "garbage")

    def __init__(self) -> None:
        self.dropped = 0  # frames that a client did not take in time
        self.garbage = 0  # packets that are none, and frames that are none of classic CAN


class Bus:
    """A bus with its clients.

    Args:
        name: of the bus.
        listener: its socket.
        queue: frames that may wait at a client; 0: frames take no time.
        controllers: secrets of the clients that may be synchronous, by robot.
    """

    __slots__ = (
        "clients",
        "controllers",
        "counters",
        "departed",
        "held",
        "listener",
        "name",
        "owing",
        "queue",
        "received",
        "stamp_ns",
        "submitted",
        "unidentified",
    )

    def __init__(
        self, name: str, listener: socket.socket, queue: int, controllers: Mapping[str, str]
    ) -> None:
        self.name = name
        self.listener = listener
        self.queue = queue
        self.controllers = controllers
        self.submitted: SubmissionQueue[Submitted] = SubmissionQueue()
        self.departed: list[Key] = []
        self.stamp_ns = -1  # not powered up yet
        self.clients: list[Connection] = []
        self.unidentified: list[Connection] = []  # connected, without a HELLO
        self.held: list[Connection] = []  # not read until received frames are taken
        self.received: SubmissionQueue[Frame] = SubmissionQueue()
        self.owing = 0
        self.counters = BusCounters()

    def joined_controllers(self) -> set[str]:
        """Robots whose controllers are there."""
        return {client.name for client in self.clients if client.synchronous}


class Connection:
    """One client of a bus."""

    __slots__ = (
        "awake",
        "backlog",
        "batched",
        "bus",
        "excused",
        "held",
        "joined",
        "key",
        "mask",
        "missing",
        "name",
        "owes",
        "own",
        "pending",
        "receive",
        "released",
        "send_now",
        "since_ns",
        "sock",
        "synchronous",
    )

    def __init__(self, sock: socket.socket, bus: Bus, mask: int) -> None:
        self.sock = sock
        self.receive, self.send_now = sock.recv, sock.send
        self.bus = bus
        self.mask = mask  # what the hub waits for at its socket
        self.name = ""
        self.key: Key = 0
        self.released = 0  # frames that left its transmit queue
        self.pending: list[Stamped] = []  # what a synchronous client hears with its next question
        self.joined = self.synchronous = self.batched = self.own = self.owes = False
        self.excused = False  # bus time doesn't wait for it
        self.awake = False  # it has answered a question since then
        self.since_ns = -1  # what it says to questions before this bus time is dropped; -1: none
        self.held = False  # not read until the frames of its bus are taken
        self.backlog: deque[bytes] = deque()
        self.missing = 0  # frames that were lost behind the backlog

    def send(self, packet: bytes) -> bool:
        """Send a packet, or keep it; whether nothing is kept."""
        if self.backlog or self.missing:
            self._keep(packet)
            return False
        try:
            self.send_now(packet)
        except BlockingIOError:
            self._keep(packet)
            return False
        except OSError:
            # It has gone; its packets are still to be read, and then the end.
            self.bus.counters.dropped += frames_in(packet)
        return True

    def pend(self, frame: Stamped) -> None:
        """Keep a frame for the next question."""
        if len(self.pending) < BACKLOG:
            self.pending.append(frame)
        else:
            self._lose(1)

    def drain(self) -> bool:
        """Send what was kept; whether nothing is left."""
        backlog = self.backlog
        try:
            while backlog or self.missing:
                if not backlog:
                    self._tell_missing()
                self.send_now(backlog[0])
                backlog.popleft()
        except BlockingIOError:
            return False
        except OSError:
            self.bus.counters.dropped += self._kept_frames()
            backlog.clear()
            self.missing = 0
        return True

    def send_last(self, packet: bytes) -> None:
        """Send a last packet; what is still kept is lost, and the client told how much."""
        self.bus.counters.dropped += self._kept_frames()
        self.missing += sum(map(frames_in, self.backlog))
        self.backlog.clear()
        with contextlib.suppress(OSError):
            # A full socket takes two packets more once it may hold more: the kernel doubles this.
            size = self.sock.getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF)
            self.sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, size)
            if self.missing:
                self.send_now(encode_lost(self.missing))
            self.send_now(packet)

    def _keep(self, packet: bytes) -> None:
        if len(self.backlog) >= BACKLOG:
            self._lose(frames_in(packet))
            return
        self._tell_missing()
        self.backlog.append(packet)

    def _kept_frames(self) -> int:
        return sum(frames_in(kept) for kept in self.backlog if kept[0] == FRAMES)

    def _lose(self, count: int) -> None:
        self.bus.counters.dropped += count
        self.missing += count

    def _tell_missing(self) -> None:
        """The client is told of what is missing before anything newer."""
        if self.missing:
            self.backlog.append(encode_lost(self.missing))
            self.missing = 0
