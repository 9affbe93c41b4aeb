"""A client of an emulated bus, in frames: below python-can's messages, and compiled.

`bridge.can_bus.interface` makes it a python-can bus; a controller's loops use it as it is. Waits
end with a packet or with the kernel's timer, so the time that is left of one is read from the
system's clock: no other clock could shorten it.

What a program doesn't read is kept for it within bounds; what is lost beyond them is counted in
`lost`, logged, and told by the error with which the bus ends.
"""

import errno
import logging
import socket
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Final

import can

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
from bridge.can_bus.pythoncan import BusClosedError
from bridge.can_bus.transport import connect
from bridge.frame import Frame, flaw
from bridge.process.clock import SYSTEM_CLOCK

FLUSH_S: Final = 10.0
"""How long a batched client waits for a hub that doesn't read."""
PATIENCE_S: Final = 1.0
"""How long a sender without a timeout waits for a hub that doesn't read."""
TimedFrame = tuple[int, Frame]
"""A frame and the bus time of its end [ns]."""
_LOG: Final = logging.getLogger("can.fleetloop")  # as python-can's own interfaces name theirs


class BusClient:
    """One client of an emulated bus.

    Args:
        channel: bus name, run and bus, or the path of the bus's socket.
        robot: whose controller in lockstep this is; such a client is batched, and bus time waits
            for its answer. "": it is none.
        secret: of that controller, from the run.
        batched: frames of one instant travel together.
        own: frames sent come back.
        timeout_s: how long to wait for the bus to answer [s].
        remote: options of a client on another machine (`bridge.can_bus.credentials`).

    Raises:
        JoinError: no such bus, no answer in time, or it refused.
    """

    def __init__(
        self,
        channel: str,
        *,
        robot: str,
        secret: str,
        batched: bool,
        own: bool,
        timeout_s: float,
        remote: Mapping[str, str],
    ) -> None:
        self.channel = channel
        self._synchronous = bool(robot)
        self._batched = batched or self._synchronous
        flags = SYNCHRONOUS if self._synchronous else BATCHED if self._batched else 0
        flags |= OWN if own else 0
        said = f"{robot}\0{secret}" if self._synchronous else socket.gethostname()
        hello = encode_text(HELLO, said, flags=flags, count=VERSION)
        self._transport, welcome = connect(channel, hello, timeout_s, remote)
        self._stamp_ns = welcome.stamp_ns
        self._queue = welcome.credit  # frames that may wait at this node; 0: frames take no time
        self._submitted = self._released = 0  # frames sent; those that have left the queue
        self._outbox: list[Frame] = []
        self._unread: deque[Packet] = deque()  # came while something else was waited for
        self._closed_because: str | None = None
        self._left = False
        self.asked = False
        """Of a synchronous client: whether the bus waits for its answer, to a tick or to frames."""
        self.lost = 0
        """Frames for this client that were lost because it did not read them in time."""

    @property
    def question_ns(self) -> int | None:
        """Of a synchronous client: bus time of the question that it has read [ns].

        None: it was answered.
        """
        return self._stamp_ns if self.asked else None

    def receive(self, timeout_s: float | None) -> Packet | None:
        """The next packet of frames; None if none came within a time [s] (None: for ever).

        Of a synchronous client: a question may have none. Waiting completes its last answer.

        Raises:
            can.CanOperationError: the bus is gone; everything received before was handed out.
        """
        if self._unread:
            return self._unread.popleft()
        deadline_s = -1.0
        wait_s = timeout_s
        while True:
            data = self._next_packet(wait_s)
            if data is None:
                return None
            packet = self._take(data)
            if packet is not None:
                return packet
            if timeout_s is not None:
                now_s = SYSTEM_CLOCK.monotonic_s()
                if deadline_s < 0.0:
                    deadline_s = now_s + timeout_s
                wait_s = max(0.0, deadline_s - now_s)

    def receive_frames(self, timeout_s: float) -> Sequence[Frame] | None:
        """The frames of the next packet, as `receive` has them."""
        packet = self.receive(timeout_s)
        return None if packet is None else packet.frames

    def receive_timed_frames(self, timeout_s: float) -> list[TimedFrame] | None:
        """The frames of the next packet, each with its end."""
        packet = self.receive(timeout_s)
        if packet is None:
            return None
        stamp_ns, before_ns = packet.stamp_ns, packet.before_ns
        if before_ns:
            pairs = zip(packet.frames, before_ns, strict=True)
            return [(stamp_ns - ago_ns, frame) for frame, ago_ns in pairs]
        return [(stamp_ns, frame) for frame in packet.frames]

    def send(self, frame: Frame, timeout_s: float | None = None) -> None:
        """Send one classic frame; those of a batched client leave together with its next wait.

        Args:
            frame: what to send.
            timeout_s: how long to wait for credit and for the socket; None: not at all for the
                queue, as on SocketCAN, and up to `PATIENCE_S` for a process that is busy.

        Raises:
            can.CanOperationError: no classic frame, the bus is gone, or no credit in time.
        """
        if wrong := flaw(frame.can_id, len(frame.data)):
            raise can.CanOperationError(f"bus {self.channel!r}: not sent: {wrong}")
        if self._queue:
            self._await_credit(timeout_s)
        if self._batched:
            if self._left:
                raise self._gone_with(None)
            if len(self._outbox) == MAX_FRAMES:
                self._flush(0)
            self._outbox.append(frame)
            return
        data = encode_frames(0, self._stamp_ns, (frame,))
        try:
            self._transport.send(data)
        except BlockingIOError:
            self._send_late(data, timeout_s)
        except OSError as error:
            raise self._unsent(error) from error

    def fileno(self) -> int:
        """The descriptor that becomes readable with the next packet."""
        return self._transport.fileno()

    def close(self) -> None:
        """Leave the bus; what was sent before is delivered. Idempotent.

        Threads that wait come back with a `can.CanOperationError`.
        """
        if self._left:
            return
        self._left = True
        try:
            if self._outbox:
                self._flush(DONE)
        finally:
            self._transport.close()

    # --- packets ---------------------------------------------------------------------------------

    def _next_packet(self, wait_s: float | None) -> bytes | None:
        """Send what waits, then wait for a packet; None if none came in time."""
        if self.asked and not (wait_s is not None and wait_s <= 0.0):
            self.asked = False
            self._flush(DONE)
        elif self._outbox:
            self._flush(0)
        if self._closed_because is not None:
            raise self._closed()
        try:
            return self._transport.receive(wait_s)
        except OSError as error:
            raise self._gone_with(error) from error

    def _take(self, data: bytes) -> Packet | None:
        """A packet of frames; None: it was another, which is taken account of here."""
        packet = decode(data)
        if packet is not None and packet.kind == FRAMES:
            self._stamp_ns, self._released = packet.stamp_ns, packet.credit
            self.asked = self._synchronous and not packet.flags & MORE
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
        if self._left:
            return can.CanOperationError(f"bus {self.channel!r} was shut down")
        if self._closed_because is not None:
            return self._closed()
        why = "closed without a word" if error is None else f"is gone: {error}"
        return can.CanOperationError(f"bus {self.channel!r} {why}{self._losses()}")

    def _unsent(self, error: OSError) -> can.CanOperationError:
        """Why nothing can be sent: the bus's own last word, if it is there to read."""
        try:
            while self._keep_next(0.0):
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
            if self._synchronous or not self._keep_next(left_s):
                raise can.CanOperationError(
                    f"bus {self.channel!r}: transmit queue full, {self._queue} frames wait",
                    errno.ENOBUFS,
                )
        self._submitted += 1

    def _keep_next(self, wait_s: float) -> bool:
        """Keep the next packet for `receive`; False if none came in time."""
        data = self._next_packet(wait_s)
        if data is None:
            return False
        packet = self._take(data)
        if packet is not None:
            self._unread.append(packet)
        return True

    def _flush(self, flags: int) -> None:
        frames, self._outbox = self._outbox, []
        data = encode_frames(flags, self._stamp_ns, frames)
        try:
            self._transport.send(data)
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
                self._transport.send(data)
            except BlockingIOError:
                continue  # another thread was faster
            except OSError as error:
                raise self._unsent(error) from error
            return
        raise can.CanOperationError(f"bus {self.channel!r}: transmit buffer full", errno.ENOBUFS)
