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

Waits end with a packet or with the kernel's timer, so the time that is left of one is read from the
system's clock: no other clock could shorten it.

What a program doesn't read is kept for it within bounds; what is lost beyond them is counted in
`lost`, logged, and told by the error with which the bus ends.
"""

import errno
import inspect
import logging
import socket
from collections import deque
from typing import Any

import can
from can.typechecking import AutoDetectedConfig, CanFilters

from bridge.can_bus import options, sockets
from bridge.can_bus.packet import (
    BATCHED,
    BYE,
    DONE,
    FRAMES,
    HELLO,
    LOST,
    MAX_FRAMES,
    MORE,
    OWN,
    SYNCHRONOUS,
    VERSION,
    Packet,
    decode,
    encode_frames,
    encode_text,
)
from bridge.can_bus.pythoncan import to_frame, to_message
from bridge.can_bus.transport import JoinError, Transport, connect
from bridge.frame import Frame, flaw
from bridge.process.clock import SYSTEM_CLOCK

FLUSH_S = 10.0
"""How long a batched client waits for a hub that doesn't read."""
PATIENCE_S = 1.0
"""How long a sender without a timeout waits for a hub that doesn't read."""
TimedFrame = tuple[int, Frame]
"""A frame and the bus time of its end [ns]."""
_LOG = logging.getLogger("can.fleetloop")  # as python-can's own interfaces name theirs


class BusClosedError(can.CanOperationError):
    """The bus was closed, at the end of its run; the text has the reason."""


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

    lost: int
    """Frames for this client that were lost because it did not read them in time."""

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
        self._name, self._secret = options.controller(synchronous, secret)
        self._synchronous = bool(self._name)
        self._batched = options.truth("batched", batched) or self._synchronous
        own = options.truth("receive_own_messages", receive_own_messages)
        timeout_s = options.seconds("connect_timeout", connect_timeout)
        self.lost = 0
        self._inbox: deque[can.Message] = deque()
        self._outbox: list[Frame] = []
        self._stamp_ns = -1
        self._reply_due = False
        self._closed_because: str | None = None
        self._queue = 0  # frames that may wait at this node; 0: frames take no time
        self._submitted = self._released = 0  # frames sent; those that have left the queue
        self._transport = self._connect(own, timeout_s, remote)
        self._send_now, self._next = self._transport.send, self._transport.receive
        self.channel_info = f"fleetloop bus {self.channel}"
        self._can_protocol = can.CanProtocol.CAN_20
        super().__init__(channel=self.channel, can_filters=can_filters)

    def _connect(self, own: bool, timeout_s: float, remote: dict[str, str]) -> Transport:
        flags = SYNCHRONOUS if self._synchronous else BATCHED if self._batched else 0
        flags |= OWN if own else 0
        name = f"{self._name}\0{self._secret}" if self._synchronous else socket.gethostname()
        hello = encode_text(HELLO, name, flags=flags, count=VERSION)
        try:
            transport, welcome = connect(self.channel, hello, timeout_s, remote)
        except JoinError as error:
            raise can.CanInitializationError(f"bus {self.channel!r}{error}") from error
        self._stamp_ns, self._queue = welcome.stamp_ns, welcome.credit
        return transport

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
            # A question without a frame says that a tick has passed.
            if not self._receive(wait_s) or (self._reply_due and not inbox):
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
        if self._batched:
            self._submit(frame, timeout)
            return
        if self._queue:
            self._await_credit(timeout)
        data = encode_frames(0, self._stamp_ns, (frame,))
        try:
            self._send_now(data)
        except BlockingIOError:
            self._send_late(data, timeout)
        except OSError as error:
            raise self._unsent(error) from error

    @property
    def asked(self) -> bool:
        """Of a synchronous client: whether the bus waits for its answer, to a tick or to frames."""
        return self._reply_due

    @property
    def question_ns(self) -> int | None:
        """Of a synchronous client: bus time of the question whose last frame was handed out [ns].

        None: frames of it are left, or it was answered.
        """
        return self._stamp_ns if self._reply_due and not self._inbox else None

    # --- frames, beside python-can's messages ----------------------------------------------------

    def recv_frames(self, timeout: float) -> list[TimedFrame] | None:
        """The frames of the next packet; filters don't apply.

        Of a synchronous client: a question without a frame has none. None: no packet came within
        `timeout` seconds.

        Raises:
            can.CanOperationError: the bus is gone.
        """
        deadline = None
        wait_s = timeout
        while True:
            data = self._next_packet(wait_s)
            if data is None:
                return None
            packet = self._take(data)
            if packet is not None:
                stamp_ns, before_ns = packet.stamp_ns, packet.before_ns
                if before_ns:
                    pairs = zip(packet.frames, before_ns, strict=True)
                    return [(stamp_ns - ago_ns, frame) for frame, ago_ns in pairs]
                return [(stamp_ns, frame) for frame in packet.frames]
            if deadline is None:
                deadline = SYSTEM_CLOCK.monotonic_s() + timeout
            wait_s = max(0.0, deadline - SYSTEM_CLOCK.monotonic_s())

    def send_frame(self, frame: Frame) -> None:
        """Send a frame of a batched client, as `send` does.

        Raises:
            can.CanOperationError: no classic frame, the bus is gone, or the queue is full.
        """
        if wrong := flaw(frame[0], len(frame[1])):
            raise can.CanOperationError(f"bus {self.channel!r}: not sent: {wrong}")
        self._submit(frame, None)

    def fileno(self) -> int:
        """The descriptor that becomes readable with the next frame."""
        return self._transport.fileno()

    def shutdown(self) -> None:
        """Leave the bus; what was sent before is delivered. Idempotent.

        Threads that wait in `recv` or `send` come back with a `can.CanOperationError`.
        """
        if self._is_shutdown:
            return
        super().shutdown()
        try:
            if self._outbox:
                self._flush(DONE)
        finally:
            self._transport.close()

    @staticmethod
    def _detect_available_configs() -> list[AutoDetectedConfig]:
        return [
            {"interface": "fleetloop", "channel": sockets.name_of(path)}
            for path in sockets.live_buses()
        ]

    # --- packets ---------------------------------------------------------------------------------

    def _receive(self, wait_s: float | None) -> bool:
        """Take one packet; False if none came in time."""
        data = self._next_packet(wait_s)
        if data is None:
            return False
        packet = self._take(data)
        if packet is not None:
            self._put(packet)
        return True

    def _next_packet(self, wait_s: float | None) -> bytes | None:
        """Send what waits, then wait for a packet; None if none came in time."""
        if self._reply_due and not (wait_s is not None and wait_s <= 0.0):
            self._reply_due = False
            self._flush(DONE)
        elif self._outbox:
            self._flush(0)
        if self._closed_because is not None:
            raise self._closed()
        try:
            return self._next(wait_s)
        except OSError as error:
            raise self._gone_with(error) from error

    def _put(self, packet: Packet) -> None:
        """Put the frames of a packet into the inbox."""
        _, flags, _, stamp_ns, frames, _, _, before_ns, _ = packet
        timestamp, channel, is_rx = stamp_ns / 1e9, self.channel, not flags & OWN
        put = self._inbox.append
        if before_ns:
            for (can_id, content), ago_ns in zip(frames, before_ns, strict=True):
                at = (stamp_ns - ago_ns) / 1e9
                put(to_message(can_id, content, at, channel, is_rx))
            return
        for can_id, content in frames:
            put(to_message(can_id, content, timestamp, channel, is_rx))

    def _submit(self, frame: Frame, timeout: float | None) -> None:
        """Put a frame of a batched client with those that travel together."""
        if self._queue:
            self._await_credit(timeout)
        if self._is_shutdown:
            raise self._gone_with(None)
        if len(self._outbox) == MAX_FRAMES:
            self._flush(0)
        self._outbox.append(frame)

    def _take(self, data: bytes) -> Packet | None:
        """A packet of frames; None: it was another, which is taken account of here."""
        packet = decode(data)
        if packet is not None and packet[0] == FRAMES:
            self._stamp_ns, self._released = packet.stamp_ns, packet.credit
            self._reply_due = self._synchronous and not packet.flags & MORE
            return packet
        if packet is not None and packet.kind == BYE:
            self._closed_because = packet.text
            raise self._closed()
        if packet is not None and packet.kind == LOST:
            self.lost += packet.credit
            _LOG.warning("bus %r: %d frames lost: not read in time", self.channel, packet.credit)
        elif not data:
            raise self._gone_with(None)
        return None

    def _closed(self) -> BusClosedError:
        return BusClosedError(
            f"bus {self.channel!r} closed: {self._closed_because}{self._losses()}"
        )

    def _gone_with(self, error: OSError | None) -> can.CanOperationError:
        if self._is_shutdown:
            return can.CanOperationError(f"bus {self.channel!r} was shut down")
        if self._closed_because is not None:
            return self._closed()
        why = "closed without a word" if error is None else f"is gone: {error}"
        return can.CanOperationError(f"bus {self.channel!r} {why}{self._losses()}")

    def _unsent(self, error: OSError) -> can.CanOperationError:
        """Why nothing can be sent: the bus's own last word, if it is there to read."""
        try:
            while self._receive(0.0):
                pass
        except can.CanOperationError as told:
            if self._closed_because is None:
                return told
            because = f"{self._closed_because}{self._losses()}"
            return BusClosedError(f"bus {self.channel!r} is gone: {because}")
        return self._gone_with(error)

    def _losses(self) -> str:
        return f"; {self.lost} frames for it were lost: not read in time" if self.lost else ""

    def _await_credit(self, timeout: float | None) -> None:
        """Take a place in the transmit queue, waiting at most `timeout`; None: not at all."""
        deadline = SYSTEM_CLOCK.monotonic_s() + (timeout or 0.0)
        while (self._submitted - self._released) & 0xFFFF_FFFF >= self._queue:
            left_s = max(deadline - SYSTEM_CLOCK.monotonic_s(), 0.0)
            # Credit returns with packets from the hub, also for a client that only sends. A
            # synchronous client holds the bus's time: waiting would be for ever.
            if self._synchronous or not self._receive(left_s):
                raise can.CanOperationError(
                    f"bus {self.channel!r}: transmit queue full, {self._queue} frames wait",
                    errno.ENOBUFS,
                )
        self._submitted += 1

    def _flush(self, flags: int) -> None:
        frames, self._outbox = self._outbox, []
        data = encode_frames(flags, self._stamp_ns, frames)
        try:
            self._send_now(data)
        except BlockingIOError:
            self._send_late(data, FLUSH_S)
        except OSError:
            # The reason, if there is one, is still to be read.
            return

    def _send_late(self, data: bytes, timeout: float | None) -> None:
        deadline = SYSTEM_CLOCK.monotonic_s() + (PATIENCE_S if timeout is None else timeout)
        while (
            left_s := deadline - SYSTEM_CLOCK.monotonic_s()
        ) > 0.0 and self._transport.await_writable(left_s):
            try:
                self._send_now(data)
            except BlockingIOError:
                continue  # another thread was faster
            except OSError as error:
                raise self._unsent(error) from error
            return
        raise can.CanOperationError(f"bus {self.channel!r}: transmit buffer full", errno.ENOBUFS)


_KEYWORDS = frozenset(inspect.signature(FleetloopBus).parameters) - {"channel", "kwargs"}
