"""The hub: all buses of the plant's process, between the emulated drives and their clients.

    deliver    frames of the drives, at one instant, to every client of a bus
    collect    wait until paced clients have said all they had to say until that instant
    take       what the clients of a bus sent since the last take

A *gathered* client takes and sends the frames of one instant together, in one packet. A *paced* one
(a controller in lockstep) is gathered, and owes an answer to every packet: bus time stands still
until it has answered. All others (loggers, host code under test) come, go, crash or stop reading as
they like: what they send is taken at the next instant, what they don't read is kept for them up to
`BACKLOG` frames and then dropped and counted. A client's frames go to all other clients of its bus,
and back to itself only if it asked for that. One thread, one epoll, no clock but for the bound.

A bus with a `queue` has bit timing: the hub then carries and doesn't forward. Who emulates the wire
takes with `say` who sent what, gives with `pass_on` what ended when and who had sent it, and tells
with `left_queue` whose transmit queue has room again.
"""

import select
import socket
import time
from collections import deque
from collections.abc import Mapping, Sequence

from bridge.can_bus import packet as wire
from bridge.can_bus.traffic import Key, Passed, Said, Stamped
from bridge.frame import Frame

BACKLOG = 100_000
MAX_CLIENTS = 64
GOODBYE_S = 0.5
"""How long the end of a bus may wait for clients that are behind."""
_READ, _WRITE = select.EPOLLIN, select.EPOLLOUT


class Counters:
    """What went over one bus."""

    __slots__ = ("dropped", "from_clients", "from_drives", "garbage", "joins")

    def __init__(self) -> None:
        self.from_drives = 0
        self.from_clients = 0
        self.dropped = 0
        self.garbage = 0
        self.joins = 0


class _Client:
    __slots__ = (
        "backlog",
        "bus",
        "gathered",
        "gone",
        "joined",
        "key",
        "name",
        "owes",
        "own",
        "paced",
        "pending",
        "receive",
        "send",
        "sock",
    )

    def __init__(self, sock: socket.socket, bus: "_Bus") -> None:
        self.sock = sock
        self.receive, self.send = sock.recv, sock.send
        self.bus = bus
        self.name = ""
        self.key: Key = 0
        self.gone = 0  # frames that left its transmit queue
        self.pending: list[Stamped] = []  # what a paced client hears with its next question
        self.joined = self.paced = self.gathered = self.own = self.owes = False
        self.backlog: deque[bytes] = deque()


class _Bus:
    __slots__ = (
        "clients",
        "counters",
        "departed",
        "listener",
        "name",
        "owing",
        "queue",
        "said",
        "stamp_ns",
        "taken",
    )

    def __init__(self, name: str, listener: socket.socket, queue: int) -> None:
        self.queue = queue
        self.said: list[Said] = []
        self.departed: list[Key] = []
        self.name = name
        self.listener = listener
        self.stamp_ns = -1  # not powered up yet
        self.clients: list[_Client] = []
        self.taken: list[Frame] = []
        self.owing = 0
        self.counters = Counters()


class Hub:
    """All buses of one process; `listeners` are bound, listening sockets by bus name.

    `queue` is how many frames may wait at a client, on buses with bit timing; 0: they have none.
    """

    def __init__(
        self,
        listeners: Mapping[str, socket.socket],
        wake_fd: int | None = None,
        *,
        queue: int = 0,
    ) -> None:
        self._buses = {name: _Bus(name, sock, queue) for name, sock in listeners.items()}
        self._joined = 0
        self._epoll = select.epoll()
        self._poll = self._epoll.poll
        self._readers: dict[int, _Client | _Bus | None] = {}
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
        together = wire.encode_frames(0, stamp_ns, frames)
        if len(clients) == 1:
            (client,) = clients
            if client.paced and not (client.owes or client.backlog or client.pending):
                client.owes = True
                bus.owing += 1
                self._send(client, together)
                return
        clients = clients.copy()
        for client in clients:
            if client.gathered:
                if client.paced and not client.owes:
                    client.owes = True
                    bus.owing += 1
                self._send(client, self._with_pending(client, stamp_ns, frames) or together)
            else:
                # One frame a packet: a readable descriptor must mean one more frame.
                for frame in frames:
                    self._send(client, wire.encode_frames(0, stamp_ns, (frame,)))

    def pass_on(
        self, name: str, stamp_ns: int, frames: Sequence[Passed], asked: str | None = None
    ) -> None:
        """Tell the clients of a bus with bit timing what ended on it until `stamp_ns`.

        Paced clients hear it when they are `asked`: by name, "" asks all of them.
        """
        bus = self._buses[name]
        bus.stamp_ns = stamp_ns
        for client in bus.clients.copy():
            heard = [Stamped(p.end_ns, p.frame) for p in frames if p.heard_by(client.key)]
            if client.own:
                for mine in (Stamped(p.end_ns, p.frame) for p in frames if p.key == client.key):
                    own = wire.encode_stamped(wire.OWN, stamp_ns, [mine], client.gone)
                    self._send(client, own)
            if client.paced:
                client.pending += heard
                if asked is not None and asked in ("", client.name):
                    heard, client.pending = client.pending, []
                    bus.owing += not client.owes
                    client.owes = True
                    self._send(client, wire.encode_stamped(0, stamp_ns, heard, client.gone))
            elif client.gathered and heard:
                self._send(client, wire.encode_stamped(0, stamp_ns, heard, client.gone))
            else:
                for one in heard:
                    self._send(client, wire.encode_stamped(0, stamp_ns, [one], client.gone))

    def say(self, name: str) -> list[Said]:
        """What the clients of a bus with bit timing sent since the last call, in order."""
        bus = self._buses[name]
        said, bus.said = bus.said, []
        return said

    def departed(self, name: str) -> list[Key]:
        """Keys of clients that left a bus with bit timing since the last call."""
        bus = self._buses[name]
        departed, bus.departed = bus.departed, []
        return departed

    def left_queue(self, name: str, key: Key, count: int) -> None:
        """Frames of a client have left its transmit queue; it hears it with the next frames."""
        for client in self._buses[name].clients:
            if client.key == key:
                client.gone += count
                if not client.paced:
                    stamp_ns = self._buses[name].stamp_ns
                    self._send(client, wire.encode_stamped(0, stamp_ns, (), client.gone))

    def collect(self, timeout_s: float) -> list[str]:
        """Buses whose paced clients have all answered what was delivered, since the last call.

        Waits until there is one, at most `timeout_s`; returns with none as well when a paced client
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
        if select.select([self._epoll], [], [], max(timeout_s, 0.0))[0]:
            self._handle(0.0)

    @property
    def names(self) -> frozenset[str]:
        """All buses."""
        return frozenset(self._buses)

    def clients(self) -> int:
        """How many clients all buses have."""
        return sum(len(bus.clients) for bus in self._buses.values())

    def heard(self) -> list[str]:
        """Buses with something to take."""
        return [name for name, bus in self._buses.items() if bus.taken or bus.said]

    def take(self, name: str) -> list[Frame]:
        """What the clients of a bus sent since the last take, in order."""
        bus = self._buses[name]
        taken = bus.taken
        if taken:
            bus.taken = []
        return taken

    def await_paced(self, wanted: Mapping[str, int], timeout_s: float) -> tuple[str, ...]:
        """Wait until each bus has this many paced clients; return the buses that have not."""
        deadline = time.monotonic() + timeout_s
        while missing := tuple(name for name, n in wanted.items() if self._paced(name) < n):
            left_s = deadline - time.monotonic()
            if left_s <= 0:
                return missing
            self._handle(left_s)
        return ()

    def left(self) -> tuple[str, ...]:
        """Buses whose paced client has gone, in the order in which they went."""
        return tuple(self._left)

    def counters(self, name: str) -> Counters:
        """What went over a bus so far."""
        return self._buses[name].counters

    def troubles(self) -> dict[str, str]:
        """Buses that failed at times: none of ours does."""
        return {}

    def fileno(self) -> int:
        """A descriptor that is readable when there is something to handle."""
        return self._epoll.fileno()

    def close(self, reason: str) -> None:
        """Say goodbye to all clients and close everything. Idempotent.

        Who is behind has `GOODBYE_S` to take what was kept for it.
        """
        if self._epoll.closed:
            return
        goodbye = wire.encode_text(wire.BYE, reason)
        clients = [client for bus in self._buses.values() for client in bus.clients]
        for client in clients:
            if client.backlog:
                client.backlog.append(goodbye)  # past the bound: it is the last one
            else:
                self._send(client, goodbye)
        self._let_catch_up([client for client in clients if client.backlog])
        for bus in self._buses.values():
            bus.listener.close()
        for reader in self._readers.values():
            if isinstance(reader, _Client):
                reader.sock.close()
        self._readers.clear()
        self._epoll.close()

    def _let_catch_up(self, behind: Sequence[_Client]) -> None:
        deadline = time.monotonic() + GOODBYE_S
        poller = select.poll()
        clients = {client.sock.fileno(): client for client in behind}
        for fd in clients:
            poller.register(fd, select.POLLOUT)
        while clients and (left_s := deadline - time.monotonic()) > 0.0:
            for fd, _ in poller.poll(left_s * 1e3):
                self._drain(clients[fd])
                if clients[fd].sock.fileno() < 0 or not clients[fd].backlog:
                    poller.unregister(fd)
                    del clients[fd]

    # --- the clients' end ------------------------------------------------------------------------

    def _handle(self, timeout_s: float) -> bool:
        """Handle what is ready; return whether the wake-up descriptor was."""
        woken = False
        readers = self._readers
        for fd, event in self._poll(timeout_s):
            reader = readers.get(fd)
            if isinstance(reader, _Client):
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

    def _read(self, client: _Client) -> None:
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
            return
        if packet is None or (packet.kind == wire.FRAMES) != client.joined:
            client.bus.counters.garbage += 1
        elif packet.kind == wire.HELLO:
            self._welcome(client, packet)
        else:
            client.bus.counters.garbage += 1

    def _take_frames(self, client: _Client, packet: wire.Packet) -> None:
        bus = client.bus
        _, flags, _, stamp_ns, frames, *_ = packet
        if frames and bus.queue:
            bus.said += [Said(client.key, frame) for frame in frames]
            bus.counters.from_clients += len(frames)
        elif frames:
            bus.taken += frames
            bus.counters.from_clients += len(frames)
            if client.own or len(bus.clients) > 1:
                self._forward(client, frames)
        if client.owes and flags & wire.DONE and stamp_ns == bus.stamp_ns:
            self._settle(client)

    def _settle(self, client: _Client) -> None:
        client.owes = False
        bus = client.bus
        bus.owing -= 1
        if not bus.owing:
            self._answered.append(bus.name)

    def _forward(self, sender: _Client, frames: Sequence[Frame]) -> None:
        bus = sender.bus
        for frame in frames:
            data = wire.encode_frames(0, bus.stamp_ns, (frame,))
            for client in tuple(bus.clients):
                if client.paced and client is not sender:
                    client.pending.append(Stamped(bus.stamp_ns, frame))
                elif client is not sender:
                    self._send(client, data)
            if sender.own:
                self._send(sender, wire.encode_frames(wire.OWN, bus.stamp_ns, (frame,)))

    def _with_pending(
        self, client: _Client, stamp_ns: int, frames: Sequence[Frame]
    ) -> bytes | None:
        """A packet of these frames after those that came meanwhile; None if none came."""
        if not client.pending:
            return None
        heard = [*client.pending, *(Stamped(stamp_ns, frame) for frame in frames)]
        client.pending = []
        return wire.encode_stamped(0, stamp_ns, heard, 0)

    def _accept(self, bus: _Bus) -> None:
        try:
            sock, _ = bus.listener.accept()
        except OSError:
            return
        sock.setblocking(False)
        self._register(sock.fileno(), _Client(sock, bus))

    def _welcome(self, client: _Client, hello: wire.Packet) -> None:
        bus = client.bus
        refusal = ""
        if hello.number != wire.VERSION:
            refusal = f"it speaks version {hello.number} of the bus's packets, not {wire.VERSION}"
        elif len(bus.clients) >= MAX_CLIENTS:
            refusal = f"it has {MAX_CLIENTS} clients already"
        if refusal:
            self._send(client, wire.encode_text(wire.REFUSED, refusal))
            self._drop(client)
            return
        self._joined += 1
        client.name = hello.text
        client.paced = bool(hello.flags & wire.PACED)
        client.gathered = client.paced or bool(hello.flags & wire.GATHERED)
        client.own = bool(hello.flags & wire.OWN)
        client.key = client.name if client.paced else self._joined
        client.joined = True
        bus.clients.append(client)
        bus.counters.joins += 1
        welcome = wire.encode_text(
            wire.WELCOME, count=wire.VERSION, stamp_ns=bus.stamp_ns, room=bus.queue
        )
        self._send(client, welcome)

    def _send(self, client: _Client, data: bytes) -> None:
        if client.backlog:
            self._keep(client, data)
            return
        try:
            client.send(data)
        except BlockingIOError:
            self._keep(client, data)
            self._epoll.modify(client.sock.fileno(), _READ | _WRITE)
        except OSError:
            # It has gone; what it said before is still to be read, and then its end.
            client.bus.counters.dropped += 1

    def _keep(self, client: _Client, data: bytes) -> None:
        if len(client.backlog) < BACKLOG:
            client.backlog.append(data)
        else:
            client.bus.counters.dropped += 1

    def _drain(self, client: _Client) -> None:
        backlog = client.backlog
        try:
            while backlog:
                client.sock.send(backlog[0])
                backlog.popleft()
        except BlockingIOError:
            return
        except OSError:
            # It has gone; what it said before is still to be read, and then its end.
            client.bus.counters.dropped += len(backlog)
            backlog.clear()
        self._epoll.modify(client.sock.fileno(), _READ)

    def _drop(self, client: _Client) -> None:
        fd = client.sock.fileno()
        if self._readers.pop(fd, None) is None:
            return
        self._epoll.unregister(fd)
        client.sock.close()
        if client in client.bus.clients:
            client.bus.clients.remove(client)
            if client.bus.queue:
                client.bus.departed.append(client.key)
        if client.owes:
            client.owes = False
            client.bus.owing -= 1
        if client.paced:
            self._left.append(client.bus.name)

    def _register(self, fd: int, reader: _Client | _Bus | None) -> None:
        self._readers[fd] = reader
        self._epoll.register(fd, _READ)

    def _paced(self, name: str) -> int:
        return sum(client.paced for client in self._buses[name].clients)
