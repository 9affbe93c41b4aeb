"""The relay: connects remote clients (guests) to the buses of a run, in the router's process.

    guest ── up ──► router ── credit ──► Unix socket ──► hub
          ◄─ down ─        ◄─ credit ──             ◄──

The relay forwards packets verbatim; to the hub a guest is a client like any other. The router binds
the `user` in a guest's keys to its login; the relay opens only the buses granted to the user. One
thread serves all guests and never blocks. Credit (`flow_control`) bounds the packets under way in
both directions; packets that a guest doesn't read stay with the hub, which keeps and counts them.

A guest leaves with a BYE, confirmed when the hub has all its packets, or with its liveliness token.
At the end of a bus every guest gets the reason and may confirm it for `GOODBYE_S`. Unknown keys
and unexpected packets are dropped, at worst with the connection of their guest. Longer than 350
lines: a guest's state and the loop that moves its packets are one protocol.
"""

import contextlib
import logging
import os
import queue
import select
import socket
import threading
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import zenoh

from bridge.can_bus import sockets
from bridge.can_bus.flow_control import Receiver, Sender
from bridge.can_bus.packet import (
    BYE,
    HELLO,
    MAX_BYTES,
    REFUSED,
    encode_text,
)
from bridge.network import keys
from bridge.network.link import Publisher
from bridge.network.zenoh_link import ZenohLink
from bridge.process.clock import SYSTEM_CLOCK, Clock

READ, WRITE = select.EPOLLIN, select.EPOLLOUT
ALL_BUSES = "*"
GOODBYE_S = 3.0
"""How long guests that are there may take to say that they have heard of the end."""
_JOIN_S = 1.0
_TURN = 64
"""Packets of one guest before the others have their turn."""
_EVENTS = 256
"""Events handled before packets of the hub have their turn."""
MAX_LINES = 32
"""Lines that one user may have open at a time: each costs two descriptors."""
MAX_HELD_BYTES = 16 * 1024 * 1024
"""Bound of the unhandled packets of one user; connections within their credit never reach it."""
_EVENT_BYTES = 256
_BYE = bytes((BYE,))
_HANG_UP = select.EPOLLHUP | select.EPOLLERR
_log = logging.getLogger(__name__)


class _Event(NamedTuple):
    place: str  # of a guest's connection; "": the relay ends
    packet: bytes | None = None
    alive: bool | None = None  # its token came or went


class Guest:
    """A guest after its HELLO. No call blocks."""

    __slots__ = (
        "awaits",
        "down",
        "leaving",
        "place",
        "receiver",
        "sender",
        "sock",
        "told",
        "waiting",
    )

    def __init__(self, place: str, sock: socket.socket, down: Publisher) -> None:
        self.place = place
        self.sock = sock
        self.down = down
        self.sender = Sender()  # of the way down
        self.receiver = Receiver()  # of the way up
        self.waiting: deque[bytes] = deque()  # not accepted by the hub yet
        self.leaving = self.told = False  # it sent a BYE; it got a BYE
        self.awaits = READ

    def push(self) -> bool:
        """Give the hub what waits; whether nothing is left."""
        while self.waiting:
            try:
                self.sock.send(self.waiting[0])
            except BlockingIOError:
                return False
            except OSError:
                self.waiting.clear()  # the hub has gone; its last words are still to be read
                return True
            if (credit := self.receiver.consume(self.waiting.popleft())) is not None:
                self.down.put(credit)
        return True

    def pull(self, most: int | None) -> bool:
        """Forward at most so many packets of the hub, within the credit; False at the end.

        None: all packets, credit or not: at the end of a bus they are as many as a socket holds.
        """
        while most is None or (most > 0 and self.sender.has_credit()):
            try:
                packet = self.sock.recv(MAX_BYTES)
            except BlockingIOError:
                return True
            except ConnectionResetError:
                continue  # the hub left packets unread; its own are still there
            except OSError:
                return False
            if not packet:
                return False
            self.told |= packet[:1] == _BYE
            self.sender.spend(packet)
            self.down.put(packet)
            most = most and most - 1
        return True

    def wants(self) -> int:
        """What to wait for at the hub's socket."""
        read = READ if self.sender.has_credit() and not self.leaving else 0
        return read | (WRITE if self.waiting else 0)


class Relay(contextlib.AbstractContextManager["Relay"]):
    """Joins guests and hub; a context manager.

    Args:
        folder: the run's private folder with the buses' sockets; its name is the run's.
        buses: those that there are.
        granted: for each user its buses, `ALL_BUSES` for all.
    """

    def __init__(
        self,
        link: ZenohLink,
        folder: Path,
        buses: Sequence[str],
        granted: Mapping[str, Sequence[str]],
        *,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._clock = clock
        self._link = link
        self._folder = folder
        self._buses = tuple(buses)
        self._granted = granted
        self._events: queue.SimpleQueue[_Event] = queue.SimpleQueue()
        self._held: Counter[str] = Counter()  # bytes in the queue above, by user
        self._alive: set[str] = set()
        self._guests: dict[str, Guest] = {}
        self._by_fd: dict[int, Guest] = {}
        self._unheard: set[str] = set()  # got a BYE, and have not confirmed it
        self._closing = False
        self._over_at: float | None = None
        self._lock = threading.Lock()  # of the descriptor below
        self._epoll = select.epoll()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._epoll.register(self._wake, READ)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        for user in granted:
            # One by one: guests must learn of the subscriber, and may see no wider key.
            link.each_keyed(keys.guest_lines("up", user), self._on_packet)
            link.each_live(keys.guest_lines("alive", user), self._on_token)
            link.declare_live(keys.guest_relay(user))
        self._thread.start()

    def close(self) -> None:
        """Tell all guests of the end, wait `GOODBYE_S` at most until they know. Idempotent."""
        if self._closing:
            return
        self._closing = True
        self._put(_Event(""))
        self._thread.join(GOODBYE_S + _JOIN_S)
        with self._lock:
            wake, self._wake = self._wake, -1
        os.close(wake)

    def __exit__(self, *_: object) -> None:
        self.close()

    # --- on Zenoh's threads ----------------------------------------------------------------------

    def _on_packet(self, key: str, packet: bytes) -> None:
        self._put(_Event(key.removesuffix("/up"), packet))

    def _on_token(self, key: str, alive: bool) -> None:
        self._put(_Event(key.removesuffix("/alive"), alive=alive))

    def _put(self, event: _Event) -> None:
        guest = keys.guest_of(event.place) if event.place else ("", "")
        if guest is None:
            return  # not the key of a guest
        with self._lock:
            if event.packet is not None:
                cost = len(event.packet) + _EVENT_BYTES
                if self._held[guest[0]] + cost > MAX_HELD_BYTES:
                    return
                self._held[guest[0]] += cost
            self._events.put(event)
            if self._wake >= 0:
                os.eventfd_write(self._wake, 1)

    # --- on the relay's own ----------------------------------------------------------------------

    def _serve(self) -> None:
        while self._over_at is None or (
            self._unheard and self._clock.monotonic_s() < self._over_at
        ):
            for fd, event in self._epoll.poll(0.02 if self._over_at else None):
                if fd == self._wake:
                    os.eventfd_read(self._wake)
                    self._process_events()
                elif (guest := self._by_fd.get(fd)) is not None:
                    with self._only(guest.place):
                        self._move(guest, ended=bool(event & _HANG_UP))
        for guest in tuple(self._guests.values()):
            self._part(guest)
        self._epoll.close()

    def _process_events(self) -> None:
        """Process some events, so that a flood does not delay packets of the hub."""
        for _ in range(_EVENTS):
            try:
                place, packet, alive = self._events.get_nowait()
            except queue.Empty:
                return
            if not place:
                self._over_at = self._clock.monotonic_s() + GOODBYE_S
                self._end_all()
                continue
            with self._only(place):
                if packet is not None:
                    self._process(place, packet)
                elif alive:
                    self._alive.add(place)
                else:
                    self._alive.discard(place)
                    self._leave(place)
        os.eventfd_write(self._wake, 1)

    @contextlib.contextmanager
    def _only(self, place: str) -> Iterator[None]:
        """A failure of one guest ends its connection and no other."""
        try:
            yield
        except Exception as error:
            if not isinstance(error, zenoh.ZError | OSError):  # its way or the hub's end is gone
                _log.exception("the line %s has failed", place)
            self._unheard.discard(place)
            if (guest := self._guests.get(place)) is not None:
                self._part(guest)

    def _process(self, place: str, packet: bytes) -> None:
        with self._lock:
            self._held[_user_of(place)] -= len(packet) + _EVENT_BYTES
        guest = self._guests.get(place)
        kind = packet[0] if packet else 0
        if guest is None:
            # A guest without a token has left; its last packets may arrive after that.
            if kind == HELLO and place in self._alive and self._over_at is None:
                self._join(place, packet)
            elif kind == BYE:
                self._unheard.discard(place)
            return
        if kind == HELLO or guest.leaving:
            return  # a repeated HELLO
        if kind == BYE:
            guest.leaving = True
        elif not guest.sender.grant(packet):
            if len(packet) > MAX_BYTES or not guest.receiver.arrive(packet):
                self._end(guest, "you sent more than your credit allows")
                return
            guest.waiting.append(packet)
        self._move(guest)

    def _move(self, guest: Guest, *, ended: bool = False) -> None:
        """Move packets both ways as far as they go; `ended`: the hub has closed its end."""
        pushed = guest.push()
        if guest.leaving:
            if pushed or ended:
                self._end(guest, "you have left")
                return
        elif not guest.pull(None if ended else _TURN):
            self._end(guest, "the bus has gone")
            return
        if (wanted := guest.wants()) != guest.awaits:
            guest.awaits = wanted
            self._epoll.modify(guest.sock, wanted)

    def _join(self, place: str, hello: bytes) -> None:
        user, channel = keys.guest_of(place) or ("", "")
        run, _, bus = channel.rpartition("/")
        down = self._link.publisher(f"{place}/down")
        granted = self._granted.get(user, ())
        here = ", ".join(self._buses)
        if run not in ("", self._folder.name):
            _refuse(down, f"no run {run!r} is here but {self._folder.name!r}; buses: {here}")
        elif bus not in self._buses:
            _refuse(down, f"no bus {bus!r} is up; buses here: {here}")
        elif ALL_BUSES not in granted and bus not in granted:
            _refuse(down, f"{user!r} may open {', '.join(granted) or 'no bus'}, not {bus!r}")
        elif sum(_user_of(other) == user for other in self._guests) >= MAX_LINES:
            _refuse(down, f"{user!r} has {MAX_LINES} connections open already")
        else:
            sock = None
            try:
                sock = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                sock.setblocking(False)
                sock.connect(str(sockets.socket_path(self._folder, bus)))
                sock.send(hello)
                self._epoll.register(sock, READ)
            except OSError as error:
                if sock is not None:
                    sock.close()
                _refuse(down, f"the bus doesn't answer: {error}")
                return
            self._guests[place] = self._by_fd[sock.fileno()] = Guest(place, sock, down)

    def _leave(self, place: str) -> None:
        """A guest has gone: its packets still reach the hub, packets to it are lost."""
        self._unheard.discard(place)
        if (guest := self._guests.get(place)) is not None:
            guest.leaving = True
            self._move(guest)

    def _end_all(self) -> None:
        for guest in tuple(self._guests.values()):
            with self._only(guest.place):
                guest.push()
                guest.pull(None)
                self._end(guest, "the run has ended")

    def _end(self, guest: Guest, reason: str) -> None:
        """Leave the hub for a guest, which gets the reason, unless the hub sent it."""
        if not guest.told:
            guest.down.put(encode_text(BYE, reason))
        if not guest.leaving:
            self._unheard.add(guest.place)
        self._part(guest)

    def _part(self, guest: Guest) -> None:
        if self._guests.pop(guest.place, None) is not None:
            del self._by_fd[guest.sock.fileno()]
            self._epoll.unregister(guest.sock)
            guest.sock.close()


def _refuse(down: Publisher, reason: str) -> None:
    down.put(encode_text(REFUSED, reason))


def _user_of(place: str) -> str:
    return place.split("/", 3)[2]
