"""The hub: all buses of the plant's process, between the emulated drives and their clients.

    deliver    frames of the drives, at one instant, to every client of a bus
    collect    wait until synchronous clients have said all they had to say until that instant
    take       what the clients of a bus sent since the last take

A *batched* client receives and sends the frames of one instant together, in one packet or several.
A *synchronous* client is batched, and bus time stands still until it has answered every request.
Only a robot's own controller in lockstep may be synchronous; it shows the secret of its robot.
All other clients (loggers, host code under test) join, leave, crash or stop reading at any time:
their frames are taken at the next instant, and packets that they don't read are kept within a bound
(`connection`). A client's frames go to all other clients of its bus, and back to the sender only on
request. One thread, one epoll, no clock but for the bound.

Frames of clients are taken `TURN` at a time (`connection.Spoken`). A client with `UNTAKEN` frames
waiting is not read until they are taken: its transmit buffer fills, and nothing is lost. Bytes that
are no packet and frames that violate classic CAN are counted and dropped; the valid frames of a
packet are kept. Where frames take no time an error frame has nothing to destroy: it goes to all
other clients, and not to the drives.

A bus with a `queue` has bit timing: the hub then carries and doesn't forward. The
emulation of the wire reads with `submitted` the frames that clients want to send, hands over with
`forward` the frames that ended on the wire, and gives credit back with `return_credit`.
"""

import contextlib
import errno
import hmac
import os
import select
import socket
import time
from collections.abc import Mapping, Sequence

from bridge.can_bus import packet as wire
from bridge.can_bus.connection import Bus, Connection, Counters
from bridge.can_bus.packet import Key, Stamped, Submitted, Transmitted
from bridge.frame import ERR, Frame
from bridge.waiting import readable

MAX_CLIENTS = 64
MAX_STRANGERS = 64
"""Connections to a bus that have not said hello; with one more the oldest goes."""
UNTAKEN = 100_000
GOODBYE_S = 1.5
"""How long the end of a bus may wait for clients that are behind ..."""
STANDSTILL_S = 0.5
"""... and for one that takes nothing at all."""
_LOOK_MS = 20
_READ, _WRITE = select.EPOLLIN, select.EPOLLOUT
_NOBODY: Mapping[str, Mapping[str, str]] = {}


class Hub:
    """All buses of one process.

    Args:
        listeners: bound, listening sockets by bus name.
        wake_fd: a descriptor that ends a wait.
        queue: frames that may wait at a client, on buses with bit timing; 0: they have none.
        controllers: of each bus the secrets of its robots' controllers, by robot. Bus time waits
            for these and for nobody else.
    """

    def __init__(
        self,
        listeners: Mapping[str, socket.socket],
        wake_fd: int | None = None,
        *,
        queue: int = 0,
        controllers: Mapping[str, Mapping[str, str]] = _NOBODY,
    ) -> None:
        self._buses = {
            name: Bus(name, sock, queue, controllers.get(name, {}))
            for name, sock in listeners.items()
        }
        self._joined = 0
        self._epoll = select.epoll()
        self._spare = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)  # see `_turn_away`
        self._poll = self._epoll.poll
        self._readers: dict[int, Connection | Bus | None] = {}
        self._answered: list[str] = []
        self._left: list[str] = []
        for bus in self._buses.values():
            bus.listener.setblocking(False)
            self._register(bus.listener.fileno(), bus)
        if wake_fd is not None:
            self._register(wake_fd, None)

    # --- the drives' end -------------------------------------------------------------------------

    def deliver(self, name: str, stamp_ns: int, frames: Sequence[Frame]) -> None:
        """Send frames of the drives, in order, to all clients of a bus at bus time `stamp_ns`."""
        bus = self._buses[name]
        bus.stamp_ns = stamp_ns
        bus.counters.from_drives += len(frames)
        clients = bus.clients
        if not clients:
            return
        if len(clients) == 1 and len(frames) <= wire.MAX_FRAMES:
            (client,) = clients
            if client.synchronous and not (client.owes or client.backlog or client.pending):
                client.owes = True
                bus.owing += 1
                self._send(client, wire.encode_frames(0, stamp_ns, frames))
                return
        together = b""
        for client in clients.copy():
            if client.synchronous and not client.owes:
                client.owes = True
                bus.owing += 1
            if client.pending or (client.batched and len(frames) > wire.MAX_FRAMES):
                heard, client.pending = client.pending, []
                heard += [Stamped(stamp_ns, frame) for frame in frames]
                self._send_all(client, stamp_ns, heard)
            elif client.batched:
                together = together or wire.encode_frames(0, stamp_ns, frames)
                self._send(client, together)
            else:
                # One frame a packet: a readable descriptor must mean one more frame.
                for frame in frames:
                    self._send(client, wire.encode_frames(0, stamp_ns, (frame,)))

    def forward(
        self, name: str, stamp_ns: int, frames: Sequence[Transmitted], asked: str | None = None
    ) -> None:
        """Tell the clients of a bus with bit timing what ended on it until `stamp_ns`.

        Paced clients hear it when they are `asked`: by name, "" asks all of them.
        """
        bus = self._buses[name]
        bus.stamp_ns = stamp_ns
        bus.counters.from_drives += sum(passed.of_drive for passed in frames)
        for client in bus.clients.copy():
            heard = [p.as_heard_by(client.key) for p in frames if p.heard_by(client.key)]
            if client.own:
                for mine in (Stamped(p.end_ns, p.frame) for p in frames if p.key == client.key):
                    own = wire.encode_stamped(wire.OWN, stamp_ns, [mine], client.gone)
                    self._send(client, own)
            if client.synchronous:
                for frame in heard:
                    client.pend(frame)
                if asked is not None and asked in ("", client.name):
                    heard, client.pending = client.pending, []
                    bus.owing += not client.owes
                    client.owes = True
                    self._send_all(client, stamp_ns, heard)
            elif client.batched and heard:
                self._send_all(client, stamp_ns, heard)
            else:
                for one in heard:
                    self._send(client, wire.encode_stamped(0, stamp_ns, [one], client.gone))

    def submitted(self, name: str) -> list[Submitted]:
        """What the clients of a bus with bit timing sent since the last call, in order."""
        bus = self._buses[name]
        said = bus.said.take()
        if bus.held:
            self._release(bus)
        return said

    def departed(self, name: str) -> list[Key]:
        """Keys of clients that left a bus with bit timing since the last call."""
        bus = self._buses[name]
        departed, bus.departed = bus.departed, []
        return departed

    def return_credit(self, name: str, key: Key, count: int) -> None:
        """Frames of a client have left its transmit queue; it hears it with the next frames."""
        for client in self._buses[name].clients:
            if client.key == key:
                client.gone += count
                if not client.synchronous:
                    stamp_ns = self._buses[name].stamp_ns
                    self._send(client, wire.encode_stamped(0, stamp_ns, (), client.gone))

    def collect(self, timeout_s: float) -> list[str]:
        """Buses whose synchronous clients have all answered, since the last call.

        Waits at most `timeout_s` for one; returns an empty list also when a synchronous client
        left or the wake-up descriptor is readable. Whatever else happens on the buses is handled.
        """
        if not self._answered:
            self._handle(timeout_s)
        answered = self._answered
        if answered:
            self._answered = []
        return answered

    def serve(self, timeout_s: float) -> None:
        """Handle what happens on the buses; waits at most `timeout_s`, to the microsecond."""
        if readable([self._epoll], max(timeout_s, 0.0)):
            self._handle(0.0)

    @property
    def names(self) -> frozenset[str]:
        """All buses."""
        return frozenset(self._buses)

    def clients(self) -> int:
        """How many clients all buses have."""
        return sum(len(bus.clients) for bus in self._buses.values())

    def pending(self) -> list[str]:
        """Buses with something to take."""
        return [name for name, bus in self._buses.items() if bus.taken.now or bus.said.now]

    def receive(self, name: str) -> list[Frame]:
        """What the clients of a bus sent since the last take, in order."""
        bus = self._buses[name]
        taken = bus.taken.take()
        if bus.held:
            self._release(bus)
        return taken

    def await_controllers(self, timeout_s: float) -> tuple[str, ...]:
        """Wait until all robots' controllers have joined; return the robots whose have not."""
        deadline = time.monotonic() + timeout_s
        while missing := self._missing():
            left_s = deadline - time.monotonic()
            if left_s <= 0:
                return missing
            self._handle(left_s)
        return ()

    def _missing(self) -> tuple[str, ...]:
        return tuple(
            robot
            for bus in self._buses.values()
            for robot in bus.controllers
            if robot not in bus.joined_controllers()
        )

    def left(self) -> tuple[str, ...]:
        """Robots whose controllers have gone, in the order in which they went."""
        return tuple(self._left)

    def counters(self, name: str) -> Counters:
        """What went over a bus so far."""
        return self._buses[name].counters

    def troubles(self) -> dict[str, str]:
        """Buses on which clients said what can't be: none of ours fails."""
        return {
            name: f"clients sent {count} × what is no frame of classic CAN: it was dropped"
            for name, bus in self._buses.items()
            if (count := bus.counters.garbage)
        }

    def fileno(self) -> int:
        """A descriptor that is readable when there is something to handle."""
        return self._epoll.fileno()

    def close(self, reason: str) -> None:
        """Say goodbye to all clients and close everything. Idempotent.

        Who is behind may take what was kept for it, for `GOODBYE_S` at most and as long as it takes
        something every `STANDSTILL_S`; then it is told how much it lost.
        """
        if self._epoll.closed:
            return
        goodbye = wire.encode_text(wire.BYE, reason)
        clients = [client for bus in self._buses.values() for client in bus.clients]
        self._let_catch_up([client for client in clients if client.backlog or client.missing])
        for client in clients:
            client.say_last(goodbye)
        for bus in self._buses.values():
            bus.listener.close()
        for reader in self._readers.values():
            if isinstance(reader, Connection):
                reader.sock.close()
        self._readers.clear()
        self._epoll.close()
        os.close(self._spare)

    def _let_catch_up(self, behind: Sequence[Connection]) -> None:
        now_s = time.monotonic()
        deadline = now_s + GOODBYE_S
        poller = select.poll()
        clients = {client.sock.fileno(): client for client in behind}
        patience = dict.fromkeys(clients, now_s + STANDSTILL_S)
        for fd in clients:
            poller.register(fd, select.POLLOUT)
        while clients:
            # A socket is polled as writable when a good part of it is free: look more often.
            poller.poll(_LOOK_MS)
            now_s = time.monotonic()
            for fd, client in tuple(clients.items()):
                before = len(client.backlog)
                drained = client.drain()
                if len(client.backlog) < before:
                    patience[fd] = now_s + STANDSTILL_S
                if drained or now_s >= min(deadline, patience[fd]):
                    poller.unregister(fd)
                    del clients[fd]

    # --- the clients' end ------------------------------------------------------------------------

    def _handle(self, timeout_s: float) -> bool:
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

    def _read(self, client: Connection) -> None:
        try:
            data = client.receive(wire.MAX_BYTES)
        except BlockingIOError:
            return
        except ConnectionResetError:
            return  # it closed with something unread; what it sent is still to be read
        except OSError:
            data = b""
        if not data:
            self._drop(client)
            return
        packet = wire.decode(data)
        if packet is not None and packet[0] == wire.FRAMES and client.joined:
            self._take_frames(client, packet)
            if packet.flawed:
                client.bus.counters.garbage += packet.flawed
            return
        if packet is None or (packet.kind == wire.FRAMES) != client.joined:
            client.bus.counters.garbage += 1
        elif packet.kind == wire.HELLO:
            self._welcome(client, packet)
        else:
            client.bus.counters.garbage += 1

    def _take_frames(self, client: Connection, packet: wire.Packet) -> None:
        bus = client.bus
        _, flags, _, stamp_ns, frames, *_ = packet
        if frames:
            bus.counters.from_clients += len(frames)
            if bus.queue:
                submitted = [Submitted(client.key, frame) for frame in frames]
                bus.said.put(submitted, at_once=client.synchronous)
            else:
                if client.own or len(bus.clients) > 1:
                    self._forward(client, frames)
                heard = frames if client.synchronous else _without_errors(frames)
                bus.taken.put(heard, at_once=client.synchronous)
            if len(bus.taken) + len(bus.said) >= UNTAKEN and not client.synchronous:
                client.held = True
                bus.held.append(client)
                self._watch(client)
        if client.owes and flags & wire.DONE and stamp_ns == bus.stamp_ns:
            self._settle(client)

    def _release(self, bus: Bus) -> None:
        """What was said is taken: read those again who said so much."""
        held, bus.held = bus.held, []
        for client in held:
            client.held = False
            if client.sock.fileno() >= 0:
                self._watch(client)

    def _settle(self, client: Connection) -> None:
        client.owes = False
        bus = client.bus
        bus.owing -= 1
        if not bus.owing:
            self._answered.append(bus.name)

    def _forward(self, sender: Connection, frames: Sequence[Frame]) -> None:
        bus = sender.bus
        for frame in frames:
            data = wire.encode_frames(0, bus.stamp_ns, (frame,))
            for client in tuple(bus.clients):
                if client.synchronous and client is not sender:
                    client.pend(Stamped(bus.stamp_ns, frame))
                elif client is not sender:
                    self._send(client, data)
            if sender.own:
                self._send(sender, wire.encode_frames(wire.OWN, bus.stamp_ns, (frame,)))

    def _accept(self, bus: Bus) -> None:
        try:
            sock, _ = bus.listener.accept()
        except OSError as error:
            if error.errno in (errno.EMFILE, errno.ENFILE):
                self._turn_away(bus)
            return
        sock.setblocking(False)
        stranger = Connection(sock, bus, _READ)
        self._register(sock.fileno(), stranger)
        bus.strangers.append(stranger)
        if len(bus.strangers) > MAX_STRANGERS:
            self._drop(bus.strangers[0])

    def _turn_away(self, bus: Bus) -> None:
        """Tell a client that there is no descriptor for it: waiting, it would wake us for ever."""
        os.close(self._spare)
        with contextlib.suppress(OSError), bus.listener.accept()[0] as sock:
            sock.send(wire.encode_text(wire.REFUSED, "too many open files here (ulimit -n)"))
        self._spare = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)

    def _welcome(self, client: Connection, hello: wire.Packet) -> None:
        bus = client.bus
        client.name, _, secret = hello.text.partition("\0")
        synchronous = bool(hello.flags & wire.SYNCHRONOUS)
        if refusal := self._refusal(
            bus, hello.number, client.name, secret if synchronous else None
        ):
            self._send(client, wire.encode_text(wire.REFUSED, refusal))
            self._drop(client)
            return
        self._joined += 1
        client.synchronous = synchronous
        client.batched = synchronous or bool(hello.flags & wire.BATCHED)
        client.own = bool(hello.flags & wire.OWN)
        client.key = client.name if synchronous else self._joined
        client.joined = True
        bus.strangers.remove(client)
        bus.clients.append(client)
        bus.counters.joins += 1
        welcome = wire.encode_text(
            wire.WELCOME, count=wire.VERSION, stamp_ns=bus.stamp_ns, room=bus.queue
        )
        self._send(client, welcome)

    def _refusal(self, bus: Bus, version: int, name: str, secret: str | None) -> str:
        """Why a client may not join, "" if it may; `secret` None: it isn't synchronous."""
        if version != wire.VERSION:
            return f"it speaks version {version} of the bus's packets, not {wire.VERSION}"
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

    def _send(self, client: Connection, data: bytes) -> None:
        if not client.send(data):
            self._watch(client)

    def _send_all(self, client: Connection, stamp_ns: int, frames: Sequence[Stamped]) -> None:
        """Send what a client hears of an instant, together."""
        for data in wire.split(0, stamp_ns, frames, client.gone):
            self._send(client, data)

    def _drain(self, client: Connection) -> None:
        client.drain()
        self._watch(client)

    def _watch(self, client: Connection) -> None:
        """Wait for what a client's connection waits for."""
        mask = 0 if client.held else _READ
        if client.backlog or client.missing:
            mask |= _WRITE
        if mask != client.mask:
            client.mask = mask
            self._epoll.modify(client.sock.fileno(), mask)

    def _drop(self, client: Connection) -> None:
        fd = client.sock.fileno()
        if self._readers.pop(fd, None) is None:
            return
        self._epoll.unregister(fd)
        client.sock.close()
        if not client.joined:
            client.bus.strangers.remove(client)
        else:
            client.bus.clients.remove(client)
            if client.bus.queue:
                client.bus.departed.append(client.key)
        if client.owes:
            client.owes = False
            client.bus.owing -= 1
        if client.synchronous:
            self._left.append(client.name)

    def _register(self, fd: int, reader: Connection | Bus | None) -> None:
        self._readers[fd] = reader
        self._epoll.register(fd, _READ)


def _without_errors(frames: Sequence[Frame]) -> Sequence[Frame]:
    """What drives hear of these."""
    if any(can_id & ERR for can_id, _ in frames):
        return [frame for frame in frames if not frame.can_id & ERR]
    return frames
