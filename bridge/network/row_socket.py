"""Rows to a recorder on the same machine: a pair of sockets for each process, no network between.

    plant, agent/<robot>  ──►  recorder        tag, NUL, `Rows`: a packet a block

The launcher makes the pairs and gives both ends away; they have no name by which anybody else could
come to one. So a block's sender is known by the socket on which it came, and the recorder takes
from it what is of that process, nothing else. What was sent is the kernel's: it survives a sender
that is killed, and is taken before what a process in its place sends.

Sending waits for nothing. What the recorder hasn't room for yet is kept by the sender, up to
`ROOM_BYTES`, and goes with the next blocks, or with `flush`. A run in lockstep then waits for the
recorder, as long as it takes anything; what finds no room is lost, counted and named. A recorder
that has ended takes nothing: its launcher says so.

The same blocks go to the network, where viewers hear them, if there are any.
"""

import errno
import select
import socket
from collections import Counter, deque
from collections.abc import Iterable, Mapping
from itertools import count
from types import TracebackType
from typing import NamedTuple, Self

from bridge.network.link import Arrival, Publisher, Receiver
from bridge.process.awake import LOOK_S
from bridge.process.clock import SYSTEM_CLOCK, Clock
from configs.brief import Schedule

ROOM_BYTES = 1 << 24
"""Of what one process keeps for a recorder that is behind."""
PATIENCE_S = 0.5
"""A recorder that takes nothing for so long isn't waited for any more."""
MOST_BYTES = 1 << 18
"""Of a packet: several times the longest honest one; the rest of a longer one is cut off."""
TURN = 4
"""Packets that are taken from one socket before it is the others' turn."""
_SEND_BYTES = 1 << 20
"""The kernel's buffer that is asked for; it gives what it may."""
_OVERHEAD_BYTES = 256


def pair() -> tuple[socket.socket, socket.socket]:
    """A process's end and the recorder's.

    Raises:
        OSError: no more files can be opened.
    """
    own, recorders = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    own.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BYTES)
    return own, recorders


class RowSocket:
    """A process's end.

    Args:
        sock: of a `pair`.
        patience_s: how long a block without room waits for a recorder that takes nothing.
    """

    def __init__(
        self, sock: socket.socket, patience_s: float, *, clock: Clock = SYSTEM_CLOCK
    ) -> None:
        sock.setblocking(False)
        self._sock, self._send = sock, sock.sendmsg
        self._patience_s = patience_s
        self._clock = clock
        self._kept: deque[tuple[bytes, bytes]] = deque()
        self._kept_bytes = 0
        self._lost = 0
        self._gave_up = False  # it has taken nothing since it was last waited for
        self._writable = select.poll()
        self._writable.register(sock, select.POLLOUT)

    @classmethod
    def of(cls, descriptor: int | None, schedule: Schedule) -> "RowSocket | None":
        """The end that was inherited, if there is one; no real robot waits for the recorder."""
        if descriptor is None:
            return None
        patience_s = 0.0 if schedule.realtime else PATIENCE_S
        return cls(socket.socket(fileno=descriptor), patience_s)

    def send(self, head: bytes, block: bytes) -> None:
        """Send a block, or keep it until there is room."""
        if self._kept:
            self._drain()
        if not self._kept and self._sent(head, block):
            return
        size = len(block) + _OVERHEAD_BYTES
        if self._kept_bytes + size > ROOM_BYTES:
            self._gave_up = self._gave_up or not self._await_room(size)
            if self._gave_up:
                self._lost += 1
                return
        self._kept.append((head, block))
        self._kept_bytes += size

    def flush(self) -> None:
        """Send what is kept, as long as the recorder takes some."""
        while self._kept:
            if not self._await_taken(PATIENCE_S):
                self._lost += len(self._kept)
                self._kept.clear()
                self._kept_bytes = 0

    def remarks(self) -> list[str]:
        """What was lost, in words."""
        lost = f"{self._lost} blocks for the record are lost: the recorder was too slow for them"
        return [lost] if self._lost else []

    def _await_room(self, size: int) -> bool:
        while self._kept_bytes + size > ROOM_BYTES:
            if not self._await_taken(self._patience_s):
                return False
        return True

    def _await_taken(self, within_s: float) -> bool:
        """Wait until something of what is kept is sent; False if nothing was."""
        before = len(self._kept)
        deadline_s = self._clock.monotonic_s() + within_s
        while True:
            self._drain()
            if len(self._kept) < before:
                return True
            left_s = deadline_s - self._clock.monotonic_s()
            if left_s <= 0.0:
                return False
            self._writable.poll(left_s * 1e3)

    def _drain(self) -> None:
        kept = self._kept
        while kept and self._sent(*kept[0]):
            self._kept_bytes -= len(kept.popleft()[1]) + _OVERHEAD_BYTES
            self._gave_up = False

    def _sent(self, head: bytes, block: bytes) -> bool:
        """Whether it is off one's hands; False if there is no room for it now."""
        try:
            self._send([head, block])
        except BlockingIOError:
            return False
        except OSError as error:
            if error.errno in (errno.ENOBUFS, errno.ENOMEM):
                return False
            if error.errno not in (errno.EPIPE, errno.ECONNRESET):
                self._lost += 1  # longer than any packet may be
        return True


class _RowPublisher:
    """Puts blocks on a socket, and on the network for those that listen there."""

    def __init__(self, line: RowSocket, tag: str, network: Publisher) -> None:
        self._send = line.send
        self._head = tag.encode() + b"\0"
        self._network = network

    def put(self, payload: bytes) -> None:
        """Put one block."""
        self._send(self._head, payload)
        self._network.put(payload)


def row_publisher(line: RowSocket | None, tag: str, network: Publisher) -> Publisher:
    """Where a process puts its blocks: without a socket the recorder hears them on the network."""
    return network if line is None else _RowPublisher(line, tag, network)


def hand_over(to: socket.socket, process: str, end: socket.socket) -> None:
    """Give a recorder its end of a process's pair.

    Raises:
        OSError: it has ended, or doesn't take it in time.
    """
    socket.send_fds(to, [process.encode()], [end.fileno()])


class _End(NamedTuple):
    """The recorder's end of a process."""

    process: str
    sock: socket.socket
    tags: Mapping[bytes, str]


class RowSockets:
    """The recorder's ends; with those processes that are elsewhere, on its link.

    Args:
        handed_over: where its ends come, one for each start of a process.
        tags: of the blocks of each process.
        link: where the blocks of others arrive; None: there are no others.
    """

    def __init__(
        self,
        handed_over: socket.socket,
        tags: Mapping[str, Iterable[str]],
        link: Receiver | None = None,
    ) -> None:
        self._link = link
        self._handed_over = handed_over
        self._tags = {process: {tag.encode(): tag for tag in of} for process, of in tags.items()}
        self._ends: dict[int, _End] = {}
        self._arrivals: deque[Arrival] = deque()
        self._buffer = bytearray(MOST_BYTES)
        self._view = memoryview(self._buffer)
        self.refused: Counter[str] = Counter()
        """Packets by processes whose they can't be."""
        self._epoll = select.epoll()
        handed_over.setblocking(False)
        self._epoll.register(handed_over.fileno(), select.EPOLLIN)

    def receive(self, timeout_s: float) -> Arrival | None:
        """The next block, waiting at most `timeout_s`; 0 polls."""
        arrivals = self._arrivals
        if not arrivals:
            self._take(timeout_s)
        return arrivals.popleft() if arrivals else None

    def _take(self, timeout_s: float) -> None:
        """Take some of what is there, of each sender in turn."""
        link = self._link
        if link is not None:
            for _ in range(TURN):
                if (arrival := link.receive(0.0)) is None:
                    break
                self._arrivals.append(arrival)
            # What comes on the link wakes nobody here: it is looked for.
            timeout_s = 0.0 if self._arrivals else min(timeout_s, LOOK_S)
        for descriptor, _ in self._epoll.poll(timeout_s):
            if descriptor == self._handed_over.fileno():
                self._take_ends()
            elif descriptor in self._ends:
                self._read(self._ends[descriptor], TURN)

    def _take_ends(self) -> None:
        """Take the ends that were handed over; before a successor all of its predecessor's."""
        while True:
            try:
                name, descriptors, _, _ = socket.recv_fds(
                    self._handed_over, 256, 1, socket.MSG_CMSG_CLOEXEC
                )
            except BlockingIOError:
                return
            except OSError:
                name = b""
            if not name:  # the launcher has gone
                self._epoll.unregister(self._handed_over.fileno())
                return
            process = name.decode()
            for end in [it for it in self._ends.values() if it.process == process]:
                self._read(end, None)
                self._forget(end)
            for descriptor in descriptors:
                end = _End(process, socket.socket(fileno=descriptor), self._tags[process])
                end.sock.setblocking(False)
                self._ends[descriptor] = end
                self._epoll.register(descriptor, select.EPOLLIN)
                self._read(end, TURN)

    def _forget(self, end: _End) -> None:
        if self._ends.pop(end.sock.fileno(), None) is not None:
            self._epoll.unregister(end.sock.fileno())
            end.sock.close()

    def _read(self, end: _End, most: int | None) -> None:
        """Take what waits on a socket, at most so many packets."""
        buffer, view, refused = self._buffer, self._view, self.refused
        for _ in count() if most is None else range(most):
            try:
                length = end.sock.recv_into(buffer)
            except BlockingIOError:
                return
            except OSError:
                length = 0
            if not length:  # the process has ended
                self._forget(end)
                return
            at = buffer.find(0, 0, length)
            tag = end.tags.get(bytes(view[: max(at, 0)]))
            if tag is None:
                refused[end.process] += 1
            else:
                self._arrivals.append(Arrival(tag, "", bytes(view[at + 1 : length])))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close all: senders find it out with their next block."""
        self._epoll.close()
        self._handed_over.close()
        for end in self._ends.values():
            end.sock.close()
