"""The hub: all buses of the plant's process, between emulated drives and clients.

    deliver    frames of the drives, at one instant, to every client of a bus
    collect    wait until synchronous clients have answered completely
    receive    frames of the clients of a bus since the last call

A *batched* client receives and sends the frames of one instant together, in one packet or several.
A *synchronous* client is batched, and bus time stands still until it has answered every request.
Only a robot's own controller in lockstep may be synchronous; it shows the secret of its robot. One
that is late may be *excused*: bus time goes on without it, and its late answers are known by their
stamps.
All other clients (loggers, host code under test) join, leave, crash or stop reading at any time:
their frames are taken at the next instant, and packets that they don't read are kept within a bound
(`connection`). A client's frames go to all other clients of its bus, and back to the sender only on
request. One thread, one epoll, no clock but for the bound.

Frames of clients are taken `TURN` at a time (`SubmissionQueue`). A client with `UNTAKEN` frames
waiting is not read until they are taken: its transmit buffer fills, and nothing is lost. Bytes that
are no packet and frames that violate classic CAN are counted and dropped; the valid frames of a
packet are kept. Where frames take no time an error frame has nothing to destroy: it goes to all
other clients, and not to the drives.

A bus with a `queue` has bit timing: the hub then does not forward by itself. The
emulation of the wire reads with `submitted` the frames that clients want to send, hands over with
`forward` the frames that ended on the wire, and gives credit back with `return_credit`.
"""

import socket
from collections.abc import Mapping, Sequence
from typing import Final

from bridge.can_bus.connection import Bus, Connection
from bridge.can_bus.drive_port import WaitablePort
from bridge.can_bus.packet import (
    DONE,
    MAX_FRAMES,
    OWN,
    Key,
    Packet,
    Stamped,
    Submitted,
    Transmitted,
    encode_frames,
    encode_stamped,
    split,
)
from bridge.can_bus.server import ClientServer
from bridge.frame import ERR, Frame
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.waiting import readable

UNTAKEN: Final = 100_000
_NEVER: Final = 1 << 62
_NOBODY: Final[Mapping[str, Mapping[str, str]]] = {}


class Hub(WaitablePort):
    """All buses of one process.

    Args:
        listeners: bound, listening sockets by bus name.
        wake_fd: a descriptor that ends a wait.
        queue: frames that may wait at a client, on buses with bit timing; 0: they have none.
        controllers: of each bus the secrets of its robots' controllers, by robot. Bus time waits
            for these only.
    """

    def __init__(
        self,
        listeners: Mapping[str, socket.socket],
        wake_fd: int | None = None,
        *,
        queue: int = 0,
        controllers: Mapping[str, Mapping[str, str]] = _NOBODY,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._clock = clock
        self._buses = {
            name: Bus(name, sock, queue, controllers.get(name, {}))
            for name, sock in listeners.items()
        }
        self._answered: list[str] = []
        self._server = ClientServer(tuple(self._buses.values()), wake_fd, self._receive_frames)
        self._handle, self._send = self._server.handle, self._server.send

    # --- the drives' side ------------------------------------------------------------------------

    def deliver(self, name: str, stamp_ns: int, frames: Sequence[Frame]) -> None:
        """Send frames of the drives, in order, to all clients of a bus at bus time `stamp_ns`."""
        bus = self._buses[name]
        bus.stamp_ns = stamp_ns
        clients = bus.clients
        if not clients:
            return
        if len(clients) == 1 and len(frames) <= MAX_FRAMES:
            (client,) = clients
            if client.synchronous and not (client.owes or client.backlog or client.pending):
                client.owes = True
                bus.owing += 1
                self._send(client, encode_frames(0, stamp_ns, frames))
                return
        together = b""
        for client in clients.copy():
            if client.synchronous and not client.owes:
                client.owes = True
                bus.owing += 1
            if client.pending or (client.batched and len(frames) > MAX_FRAMES):
                heard, client.pending = client.pending, []
                heard += [Stamped(stamp_ns, frame) for frame in frames]
                self._send_all(client, stamp_ns, heard)
            elif client.batched:
                together = together or encode_frames(0, stamp_ns, frames)
                self._send(client, together)
            else:
                # One frame a packet: a readable descriptor must mean one more frame.
                for frame in frames:
                    self._send(client, encode_frames(0, stamp_ns, (frame,)))

    def forward(
        self, name: str, stamp_ns: int, frames: Sequence[Transmitted], asked: str | None = None
    ) -> None:
        """Tell the clients of a bus with bit timing what ended on it until `stamp_ns`.

        Synchronous clients hear it when they are `asked`: by name, "" asks all of them.
        """
        bus = self._buses[name]
        bus.stamp_ns = stamp_ns
        for client in bus.clients.copy():
            heard = [p.as_heard_by(client.key) for p in frames if p.heard_by(client.key)]
            if client.own:
                for mine in [p for p in frames if p.key == client.key]:
                    own = encode_stamped(OWN, stamp_ns, [mine], client.released)
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
                    self._send(client, encode_stamped(0, stamp_ns, [one], client.released))

    def submitted(self, name: str) -> list[Submitted]:
        """What the clients of a bus with bit timing sent since the last call, in order."""
        bus = self._buses[name]
        submitted = bus.submitted.next_batch()
        if bus.held:
            self._release(bus)
        return submitted

    def departed(self, name: str) -> list[Key]:
        """Keys of clients that left a bus with bit timing since the last call."""
        bus = self._buses[name]
        departed, bus.departed = bus.departed, []
        return departed

    def return_credit(self, name: str, key: Key, count: int) -> None:
        """Frames of a client have left its transmit queue; it hears it with the next frames."""
        for client in self._buses[name].clients:
            if client.key == key:
                client.released += count
                if not client.synchronous:
                    stamp_ns = self._buses[name].stamp_ns
                    self._send(client, encode_stamped(0, stamp_ns, (), client.released))

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
        """Handle what happens on the buses; waits at most `timeout_s`.

        A wait of milliseconds ends in the last of them, one call of the kernel instead of two where
        something comes before; a shorter one is kept to the microsecond.
        """
        whole_ms = int(timeout_s * 1e3)
        if whole_ms > 0:
            self._handle((whole_ms - 0.5) * 1e-3)  # the kernel counts up to the next whole one
        elif timeout_s <= 0.0 or readable([self._server], timeout_s):
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
        return [name for name, bus in self._buses.items() if bus.received.now or bus.submitted.now]

    def receive(self, name: str) -> list[Frame]:
        """What the clients of a bus sent since the last take, in order."""
        bus = self._buses[name]
        received = bus.received.next_batch()
        if bus.held:
            self._release(bus)
        return received

    def await_controllers(self, timeout_s: float) -> tuple[str, ...]:
        """Wait until all robots' controllers have joined; return the robots whose have not."""
        deadline = self._clock.monotonic_s() + timeout_s
        while missing := self._missing():
            left_s = deadline - self._clock.monotonic_s()
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

    # --- controllers that bus time doesn't wait for ----------------------------------------------

    def owing(self, name: str) -> list[str]:
        """Robots whose controllers a bus waits for."""
        bus = self._buses[name]
        return [client.name for client in bus.clients if client.owes and not client.excused]

    def joined(self, robot: str) -> bool:
        """Whether the controller of a robot is on its bus."""
        return self._controller(robot) is not None

    def excuse(self, robot: str) -> None:
        """Wait for a controller no longer, neither for the answer that it owes nor for others.

        It still hears everything; what it answers is dropped, until it is recalled.
        """
        client = self._controller(robot)
        if client is None or client.excused:
            return
        client.bus.owing -= client.owes
        # Owing, it is never counted again.
        client.excused = client.owes = True
        client.awake = False
        client.since_ns = _NEVER

    def awake(self, robot: str) -> bool:
        """Whether an excused controller has answered any question meanwhile."""
        client = self._controller(robot)
        return client is not None and client.awake

    def recall(self, robot: str) -> None:
        """Wait for an excused controller again from the next question on, which has a later stamp.

        What it says to earlier questions is dropped.
        """
        client = self._controller(robot)
        if client is not None and client.excused:
            client.excused = client.owes = False
            client.since_ns = client.bus.stamp_ns + 1

    def expel(self, robot: str, reason: str) -> None:
        """End the connection of a controller, if it has one."""
        client = self._controller(robot)
        if client is not None:
            self._server.expel(client, reason)

    def _controller(self, robot: str) -> Connection | None:
        clients = (client for bus in self._buses.values() for client in bus.clients)
        return next((it for it in clients if it.synchronous and it.name == robot), None)

    def left(self) -> tuple[str, ...]:
        """Robots whose controllers have gone, in the order in which they went."""
        return tuple(self._server.left)

    def troubles(self) -> dict[str, str]:
        """Buses with invalid frames or packets of clients, or frames that they didn't read in time.

        An emulated bus never fails.
        """
        found = {}
        for name, bus in self._buses.items():
            garbage, lost = bus.counters.garbage, bus.counters.dropped
            said = []
            if garbage:
                what = "what is no frame of classic CAN: it was dropped"
                said.append(f"clients sent {garbage} × {what}")
            if lost:
                said.append(f"{lost} frames for clients were lost: they did not read them in time")
            if said:
                found[name] = "; ".join(said)
        return found

    def fileno(self) -> int:
        """A descriptor that is readable when there is something to handle."""
        return self._server.fileno()

    def close(self, reason: str) -> None:
        """Say goodbye to all clients and close all sockets. Idempotent."""
        self._server.close(reason)

    # --- frames of clients -----------------------------------------------------------------------

    def _receive_frames(self, client: Connection, packet: Packet) -> None:
        bus = client.bus
        flags, stamp_ns, frames = packet.flags, packet.stamp_ns, packet.frames
        if stamp_ns < client.since_ns:
            client.awake |= bool(flags & DONE)
            client.released += len(frames)
            return
        if frames:
            if bus.queue:
                submitted = [Submitted(client.key, frame) for frame in frames]
                bus.submitted.put(submitted, at_once=client.synchronous)
            else:
                if client.own or len(bus.clients) > 1:
                    self._forward(client, frames)
                heard = frames if client.synchronous else _without_errors(frames)
                bus.received.put(heard, at_once=client.synchronous)
            if len(bus.received) + len(bus.submitted) >= UNTAKEN and not client.synchronous:
                client.held = True
                bus.held.append(client)
                self._server.watch(client)
        if client.owes and flags & DONE and stamp_ns == bus.stamp_ns:
            self._settle(client)

    def _release(self, bus: Bus) -> None:
        """The received frames were taken: resume reading from paused clients."""
        held, bus.held = bus.held, []
        for client in held:
            client.held = False
            if client.sock.fileno() >= 0:
                self._server.watch(client)

    def _settle(self, client: Connection) -> None:
        client.owes = False
        bus = client.bus
        bus.owing -= 1
        if not bus.owing:
            self._answered.append(bus.name)

    def _forward(self, sender: Connection, frames: Sequence[Frame]) -> None:
        bus = sender.bus
        for frame in frames:
            data = encode_frames(0, bus.stamp_ns, (frame,))
            for client in tuple(bus.clients):
                if client.synchronous and client is not sender:
                    client.pend(Stamped(bus.stamp_ns, frame))
                elif client is not sender:
                    self._send(client, data)
            if sender.own:
                self._send(sender, encode_frames(OWN, bus.stamp_ns, (frame,)))

    def _send_all(self, client: Connection, stamp_ns: int, frames: Sequence[Stamped]) -> None:
        """Send what a client hears of an instant, together."""
        for data in split(0, stamp_ns, frames, client.released):
            self._send(client, data)


def _without_errors(frames: Sequence[Frame]) -> Sequence[Frame]:
    """What drives hear of these."""
    if any(frame.can_id & ERR for frame in frames):
        return [frame for frame in frames if not frame.can_id & ERR]
    return frames
