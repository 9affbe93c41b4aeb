"""The python-can interface `fleetloop`: an emulated bus that any python-can program opens by name.

    can.Bus(interface="fleetloop", channel="r1")
    can.Bus(interface="fleetloop", channel="r1", endpoint="tls/host:7447", user="me", ...)

The second form is for another machine: the same bus with the same guarantees, over Zenoh, for the
guests of the run's deployment.

Works between processes, without kernel module or root; lossless and in order for a client that
reads; no echo of own frames unless asked; classic CAN only. `Message.timestamp` is bus time:
seconds since power-up of the bus. Linux only.

`batched=True` suits a program that reads until nothing is left and then acts: frames of one instant
arrive in one packet, and frames that it sends leave with its next `recv`. `synchronous` is for the
robot's own controller in lockstep, to which the run gives a secret: such a client is batched, bus
time waits for its answer, and its next blocking `recv` completes the answer.

`send` takes what `can.Message(check=True)` takes, but no FD frames, and refuses the rest before
anything goes out. An error frame (`is_error_frame`) on a bus with bit timing is an error flag on
order: it destroys the frame on the wire, and the nodes count it; where frames take no time it
goes to the other clients.
"""

import inspect
from collections import deque
from typing import Any

import can
from can.typechecking import AutoDetectedConfig, CanFilters

from bridge.can_bus import options, sockets
from bridge.can_bus.client import BusClient
from bridge.can_bus.packet import OWN, Packet
from bridge.can_bus.pythoncan import to_frame, to_message
from bridge.can_bus.transport import JoinError
from bridge.process.clock import SYSTEM_CLOCK


class FleetloopBus(can.BusABC):
    """One client of an emulated bus.

    Args:
        channel: bus name ("r1"), run and bus ("<run>/r1"), or the path of the bus's socket.
        can_filters: see `can.BusABC.set_filters`.
        synchronous: the robot whose controller this is, and for which bus time then waits.
        secret: of that controller, from the run.
        batched: frames of one instant travel together; a descriptor is readable once for all.
        receive_own_messages: frames sent come back, with `is_rx` False.
        connect_timeout: how long to wait for the bus to answer [s], above 0.
        fd: must be False; the bus is classic CAN.
        endpoint, user, ...: from another machine, see `bridge.can_bus.credentials`.

    Raises:
        can.CanInitializationError: no such bus, it refused, or an option's value is wrong; the text
            names what there is, or what is right.
        TypeError: there is no such option.
    """

    client: BusClient
    """The same client, for frames beside python-can's messages; filters don't apply to them."""

    def __init__(
        self,
        channel: str | int | None = None,
        can_filters: CanFilters | None = None,
        *,
        synchronous: str | bool = "",
        secret: str = "",
        batched: bool = False,
        receive_own_messages: bool = False,
        connect_timeout: float = 10.0,
        fd: bool = False,
        **kwargs: Any,
    ) -> None:
        remote = options.remote(kwargs, _KEYWORDS)
        self.channel = options.channel_name(channel)
        options.refuse_fd(channel, fd)
        robot, secret = options.controller(synchronous, secret)
        batched = options.truth("batched", batched)
        own = options.truth("receive_own_messages", receive_own_messages)
        timeout_s = options.seconds("connect_timeout", connect_timeout)
        self._inbox: deque[can.Message] = deque()
        try:
            self.client = BusClient(
                self.channel,
                robot=robot,
                secret=secret,
                batched=batched,
                own=own,
                timeout_s=timeout_s,
                remote=remote,
            )
        except JoinError as error:
            raise can.CanInitializationError(f"bus {self.channel!r}{error}") from error
        self.channel_info = f"fleetloop bus {self.channel}"
        self._can_protocol = can.CanProtocol.CAN_20
        super().__init__(channel=self.channel, can_filters=can_filters)

    # --- python-can's contract -------------------------------------------------------------------

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next message, None if none came within `timeout` seconds (None: wait for ever).

        A synchronous client's time is the bus's: None as well when a tick passed without a frame.

        Raises:
            can.CanOperationError: the bus is gone; everything received before was handed out.
        """
        inbox = self._inbox
        if inbox and self._filters is None:
            return inbox.popleft()
        deadline = None
        while True:
            while inbox:
                message = inbox.popleft()
                if self._filters is None or self._matches_filters(message):
                    return message
            if deadline is None:
                wait_s = timeout
                if timeout is not None:
                    deadline = SYSTEM_CLOCK.monotonic_s() + timeout
            else:
                wait_s = max(0.0, deadline - SYSTEM_CLOCK.monotonic_s())
            packet = self.client.receive(wait_s)
            if packet is None:
                return None
            self._put(packet)
            # A question without a frame says that a tick has passed.
            if self.client.asked and not inbox:
                return None

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send one classic frame.

        On a bus with bit timing it waits in this node's transmit queue until it wins the bus.

        Args:
            msg: what to send.
            timeout: how long to wait for credit and for the socket; None: not at all for the
                queue, as on SocketCAN, and up to `PATIENCE_S` for a process that is busy.

        Raises:
            can.CanOperationError: no classic frame, the bus is gone, or no credit in time.
        """
        try:
            frame = to_frame(msg)
        except ValueError as error:
            raise can.CanOperationError(f"bus {self.channel!r}: not sent: {error}") from error
        self.client.send(frame, timeout)

    @property
    def asked(self) -> bool:
        """Of a synchronous client: whether the bus waits for its answer, to a tick or to frames."""
        return self.client.asked

    @property
    def question_ns(self) -> int | None:
        """Of a synchronous client: bus time of the question whose last frame was handed out [ns].

        None: frames of it are left, or it was answered.
        """
        return None if self._inbox else self.client.question_ns

    @property
    def lost(self) -> int:
        """Frames for this client that were lost because it did not read them in time."""
        return self.client.lost

    def fileno(self) -> int:
        """The descriptor that becomes readable with the next frame."""
        return self.client.fileno()

    def shutdown(self) -> None:
        """Leave the bus; what was sent before is delivered. Idempotent.

        Threads that wait in `recv` or `send` come back with a `can.CanOperationError`.
        """
        if self._is_shutdown:
            return
        super().shutdown()
        self.client.close()

    @staticmethod
    def _detect_available_configs() -> list[AutoDetectedConfig]:
        return [
            {"interface": "fleetloop", "channel": sockets.name_of(path)}
            for path in sockets.live_buses()
        ]

    def _put(self, packet: Packet) -> None:
        """Put the frames of a packet into the inbox."""
        flags, stamp_ns, before_ns = packet.flags, packet.stamp_ns, packet.before_ns
        timestamp, channel, is_rx = stamp_ns / 1e9, self.channel, not flags & OWN
        put = self._inbox.append
        if before_ns:
            for frame, ago_ns in zip(packet.frames, before_ns, strict=True):
                at = (stamp_ns - ago_ns) / 1e9
                put(to_message(frame.can_id, frame.data, at, channel, is_rx))
            return
        for frame in packet.frames:
            put(to_message(frame.can_id, frame.data, timestamp, channel, is_rx))


_KEYWORDS = frozenset(inspect.signature(FleetloopBus).parameters) - {"channel", "kwargs"}
