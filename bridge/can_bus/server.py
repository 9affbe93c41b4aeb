"""Server of the clients of all buses in a process: accepts, identifies, reads and writes.

    state         on                                  to
    connected     HELLO with the right version        joined; a WELCOME is sent
    connected     HELLO that may not join             closed; a REFUSED is sent
    connected     `MAX_UNIDENTIFIED` newer ones       closed
    joined        end of the socket                   closed

One thread, one epoll; no call blocks longer than asked. Packets that a client doesn't read are kept
in its `connection`. At the end of a bus a client may read its backlog for `GOODBYE_S` at most, as
long as it reads something every `STANDSTILL_S`; then it is told how many frames it lost. These two
are measured by this machine's clock, whatever time the buses keep: clients are real processes.
"""

import contextlib
import errno
import hmac
import os
import select
from collections.abc import Callable, Sequence
from typing import Final

from bridge.can_bus.connection import Bus, Connection
from bridge.can_bus.packet import (
    BATCHED,
    BYE,
    FRAMES,
    HELLO,
    MAX_BYTES,
    OWN,
    REFUSED,
    SYNCHRONOUS,
    VERSION,
    WELCOME,
    Packet,
    decode,
    encode_text,
)
from bridge.process.clock import SYSTEM_CLOCK

MAX_CLIENTS: Final = 64
MAX_UNIDENTIFIED: Final = 64
"""Connections to a bus without a HELLO; one more closes the oldest."""
GOODBYE_S: Final = 1.5
STANDSTILL_S: Final = 0.5
_LOOK_MS: Final = 20
_READ: Final = select.EPOLLIN
_WRITE: Final = select.EPOLLOUT


class ClientServer:
    """Sockets of all buses of one process.

    Args:
        buses: with listening sockets.
        wake_fd: a descriptor that ends a wait.
        on_frames: called with every FRAMES packet of a joined client.
    """

    def __init__(
        self,
        buses: Sequence[Bus],
        wake_fd: int | None,
        on_frames: Callable[[Connection, Packet], None],
    ) -> None:
        self._buses = buses
        self._on_frames = on_frames
        self._joined = 0
        self._epoll = select.epoll()
        self._spare = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)  # see `_turn_away`
        self._poll = self._epoll.poll
        self._readers: dict[int, Connection | Bus | None] = {}
        self.left: list[str] = []
        """Robots whose controllers have left, in order."""
        for bus in buses:
            bus.listener.setblocking(False)
            self._register(bus.listener.fileno(), bus)
        if wake_fd is not None:
            self._register(wake_fd, None)

    def fileno(self) -> int:
        """A descriptor that is readable when there is something to handle."""
        return self._epoll.fileno()

    def handle(self, timeout_s: float) -> bool:
        """Handle what is ready; return whether the wake-up descriptor was."""
        woken = False
        readers = self._readers
        for fd, event in self._poll(timeout_s):
            reader = readers.get(fd)
            if isinstance(reader, Connection):
                if event == _READ:
                    self._read(reader)
                    continue
                if event & _WRITE:
                    self._drain(reader)
                if event & ~_WRITE:
                    self._read(reader)
            elif reader is not None:
                self._accept(reader)
            else:
                woken = True
        return woken

    def send(self, client: Connection, data: bytes) -> None:
        """Send a packet, or keep it until the client reads."""
        if not client.send(data):
            self.watch(client)

    def watch(self, client: Connection) -> None:
        """Wait for the events that a connection needs now."""
        mask = 0 if client.held else _READ
        if client.backlog or client.missing:
            mask |= _WRITE
        if mask != client.mask:
            client.mask = mask
            self._epoll.modify(client.sock.fileno(), mask)

    def expel(self, client: Connection, reason: str) -> None:
        """Say goodbye to one client and close its socket."""
        client.send_last(encode_text(BYE, reason))
        self._drop(client)

    def close(self, reason: str) -> None:
        """Say goodbye to all clients and close all sockets. Idempotent."""
        if self._epoll.closed:
            return
        goodbye = encode_text(BYE, reason)
        clients = [client for bus in self._buses for client in bus.clients]
        self._let_catch_up([client for client in clients if client.backlog or client.missing])
        for client in clients:
            client.send_last(goodbye)
        for bus in self._buses:
            bus.listener.close()
        for reader in self._readers.values():
            if isinstance(reader, Connection):
                reader.sock.close()
        self._readers.clear()
        self._epoll.close()
        os.close(self._spare)

    def _let_catch_up(self, behind: Sequence[Connection]) -> None:
        now_s = SYSTEM_CLOCK.monotonic_s()
        deadline = now_s + GOODBYE_S
        poller = select.poll()
        clients = {client.sock.fileno(): client for client in behind}
        patience = dict.fromkeys(clients, now_s + STANDSTILL_S)
        for fd in clients:
            poller.register(fd, select.POLLOUT)
        while clients:
            # A socket is polled as writable when a good part of it is free: look more often.
            poller.poll(_LOOK_MS)
            now_s = SYSTEM_CLOCK.monotonic_s()
            for fd, client in tuple(clients.items()):
                before = len(client.backlog)
                drained = client.drain()
                if len(client.backlog) < before:
                    patience[fd] = now_s + STANDSTILL_S
                if drained or now_s >= min(deadline, patience[fd]):
                    poller.unregister(fd)
                    del clients[fd]

    def _read(self, client: Connection) -> None:
        try:
            data = client.receive(MAX_BYTES)
        except BlockingIOError:
            return
        except ConnectionResetError:
            return  # it closed with something unread; what it sent is still to be read
        except OSError:
            data = b""
        if not data:
            self._drop(client)
            return
        packet = decode(data)
        if packet is not None and packet.kind == FRAMES and client.joined:
            self._on_frames(client, packet)
            if packet.flawed:
                client.bus.counters.garbage += packet.flawed
            return
        if packet is None or (packet.kind == FRAMES) != client.joined:
            client.bus.counters.garbage += 1
        elif packet.kind == HELLO:
            self._welcome(client, packet)
        else:
            client.bus.counters.garbage += 1

    def _accept(self, bus: Bus) -> None:
        try:
            sock, _ = bus.listener.accept()
        except OSError as error:
            if error.errno in (errno.EMFILE, errno.ENFILE):
                self._turn_away(bus)
            return
        sock.setblocking(False)
        connection = Connection(sock, bus, _READ)
        self._register(sock.fileno(), connection)
        bus.unidentified.append(connection)
        if len(bus.unidentified) > MAX_UNIDENTIFIED:
            self._drop(bus.unidentified[0])

    def _turn_away(self, bus: Bus) -> None:
        """Tell a client that there is no descriptor for it: waiting, it would wake us for ever."""
        os.close(self._spare)
        with contextlib.suppress(OSError), bus.listener.accept()[0] as sock:
            sock.send(encode_text(REFUSED, "too many open files here (ulimit -n)"))
        self._spare = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)

    def _welcome(self, client: Connection, hello: Packet) -> None:
        bus = client.bus
        client.name, _, secret = hello.text.partition("\0")
        synchronous = bool(hello.flags & SYNCHRONOUS)
        if refusal := self._refusal(
            bus, hello.number, client.name, secret if synchronous else None
        ):
            self.send(client, encode_text(REFUSED, refusal))
            self._drop(client)
            return
        self._joined += 1
        client.synchronous = synchronous
        client.batched = synchronous or bool(hello.flags & BATCHED)
        client.own = bool(hello.flags & OWN)
        client.key = client.name if synchronous else self._joined
        client.joined = True
        bus.unidentified.remove(client)
        bus.clients.append(client)
        welcome = encode_text(WELCOME, count=VERSION, stamp_ns=bus.stamp_ns, credit=bus.queue)
        self.send(client, welcome)

    def _refusal(self, bus: Bus, version: int, name: str, secret: str | None) -> str:
        """Why a client may not join, "" if it may; `secret` None: it isn't synchronous."""
        if version != VERSION:
            return f"it speaks version {version} of the bus's packets, not {VERSION}"
        if len(bus.clients) >= MAX_CLIENTS and secret is None:
            return f"it has {MAX_CLIENTS} clients already"
        if secret is None:
            return ""
        if not bus.controllers:
            return "synchronous is for a robot's own controller in lockstep: this bus has none"
        known = bus.controllers.get(name)
        if known is None or not hmac.compare_digest(known.encode(), secret.encode()):
            robots = ", ".join(bus.controllers)
            return (
                f"synchronous is for the controllers that the run started, of {robots}: bus time"
                " waits for no other client; join without synchronous"
            )
        if name in bus.joined_controllers():
            return f"the controller of {name} is on it already"
        return ""

    def _drain(self, client: Connection) -> None:
        client.drain()
        self.watch(client)

    def _drop(self, client: Connection) -> None:
        fd = client.sock.fileno()
        if self._readers.pop(fd, None) is None:
            return
        self._epoll.unregister(fd)
        client.sock.close()
        if not client.joined:
            client.bus.unidentified.remove(client)
        else:
            client.bus.clients.remove(client)
            if client.bus.queue:
                client.bus.departed.append(client.key)
        if client.owes and not client.excused:
            client.bus.owing -= 1
        client.owes = False
        if client.synchronous:
            self.left.append(client.name)

    def _register(self, fd: int, reader: Connection | Bus | None) -> None:
        self._readers[fd] = reader
        self._epoll.register(fd, _READ)
