"""Transport from another machine: packets over Zenoh to the relay beside the hub (`relay`).

    guest ── <bus>/up ──► router, relay ── Unix socket ──► hub
          ◄─ <bus>/down ─

Packets and guarantees are those of the Unix socket: lossless, in order, no echo, bounded by credit
in both directions (`flow_control`). What the guest doesn't read waits here, up to `BACKLOG`
packets, and then at the hub, which drops and counts what is too much. Leaving waits, at most
`CLOSE_S`, until the hub has all that was sent. The guest holds a liveliness token for as long as it
lives and watches the relay's: when that goes, or the network to it (noticed within Zenoh's lease),
the connection is broken for good, with the reason.

Credit and the answer to a BYE are put on a thread of their own, not on Zenoh's, which must not wait
(`ZenohLink.each`).
"""

import atexit
import contextlib
import os
import queue
import secrets
import threading
from collections import deque

import zenoh

from bridge.can_bus.flow_control import Receiver, Sender
from bridge.can_bus.packet import (
    BYE,
    REFUSED,
    encode_text,
)
from bridge.can_bus.transport import Transport
from bridge.network import keys
from bridge.network.client import open_client
from bridge.process.clock import SYSTEM_CLOCK
from configs.connections import NetworkLink
from configs.errors import InfrastructureError

BACKLOG = 100_000
CLOSE_S = 1.0
_FIRST_HELLO_S, _LAST_HELLO_S = 0.01, 0.2
_ENDS = frozenset({BYE, REFUSED})


class ZenohTransport(Transport):
    """One guest's connection to a bus behind a router."""

    def __init__(self, network: NetworkLink, channel: str, hello: bytes, timeout_s: float) -> None:
        """Connect, and say hello until the relay answers.

        Raises:
            OSError: no router there, the login was refused, or no relay serves that bus.
            ScenarioError: user or channel can't be names.
        """
        deadline = SYSTEM_CLOCK.monotonic_s() + timeout_s
        place = keys.guest_line(network.user, secrets.token_hex(8), channel)
        self._packets: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._lock = threading.Lock()  # packets and descriptor change together
        self._news = threading.Condition(self._lock)
        self._sender, self._receiver = Sender(), Receiver()
        self._held: deque[bytes] = deque()  # past the backlog: no room is given back for them yet
        self._broken = ""
        self._answers: queue.SimpleQueue[bytes] = queue.SimpleQueue()  # b"": the last
        self._ended = threading.Event()
        try:
            self._link = open_client(network, timeout_s)
        except InfrastructureError as error:
            raise OSError(str(error)) from error
        try:
            self._readable = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC | os.EFD_SEMAPHORE)
            self._link.each(f"{place}/down", self._on_packet)
            self._link.on_gone(keys.guest_relay(network.user), self._lose)
            self._up = self._link.publisher(f"{place}/up")
            self._link.declare_live(f"{place}/alive")
        except (zenoh.ZError, OSError) as error:
            self._link.close()
            raise OSError(str(error)) from error
        threading.Thread(target=self._answer, daemon=True).start()
        # Later, when the interpreter ends, a session can't be closed and keeps the process.
        atexit.register(self.close)
        again_s = _FIRST_HELLO_S
        while True:
            self._up.put(hello)
            with self._news:
                if self._news.wait_for(self._has_packets, again_s):
                    return
            again_s = min(2.0 * again_s, _LAST_HELLO_S)
            if SYSTEM_CLOCK.monotonic_s() > deadline:
                self._ended.set()  # no BYE will come
                self.close()
                raise TimeoutError(
                    f"no relay at {network.endpoint} answers to {network.user!r} within"
                    f" {timeout_s:g} s: the run there has no such guest, or this isn't its"
                    " certificate"
                )

    # --- on Zenoh's thread -----------------------------------------------------------------------

    def _on_packet(self, packet: bytes) -> None:
        kind = packet[0] if packet else 0
        answer = self._keep_or_answer(packet, kind)
        if answer is not None:
            self._answers.put(answer)
        if kind in _ENDS:
            self._answers.put(b"")

    def _keep_or_answer(self, packet: bytes, kind: int) -> bytes | None:
        with self._news:
            if self._readable < 0 or self._broken:
                return None
            answer = None
            if not self._sender.grant(packet):
                self._keep(packet)
                if kind == BYE:
                    answer = packet  # heard
                elif self._packets.qsize() < BACKLOG:
                    answer = self._receiver.consume(packet)
                else:
                    self._held.append(packet)
            if kind in _ENDS:
                self._break("the bus has gone")
            self._news.notify_all()
        return answer

    def _lose(self) -> None:
        with self._news:
            if self._readable >= 0 and not self._broken:
                self._break("the run's router has gone, or the network to it")
            self._ended.set()
            self._news.notify_all()

    def _keep(self, packet: bytes) -> None:
        os.eventfd_write(self._readable, 1)
        self._packets.put(packet)

    def _break(self, reason: str) -> None:
        """No more comes: the descriptor stays readable, as at the end of a socket."""
        self._broken = reason
        self._keep(b"")

    def _has_packets(self) -> bool:
        return not self._packets.empty()

    # --- on a thread of its own ------------------------------------------------------------------

    def _answer(self) -> None:
        while answer := self._answers.get():
            with contextlib.suppress(OSError):
                self._publish(answer)
        # After the answers: the waiting thread then closes the session.
        self._ended.set()

    # --- transport -------------------------------------------------------------------------------

    def send(self, packet: bytes) -> None:
        """Send at once."""
        with self._lock:
            if self._broken or self._readable < 0:
                raise OSError(self._broken or "the connection is closed")
            if not self._sender.has_credit():
                raise BlockingIOError
            self._sender.spend(packet)
        self._publish(packet)

    def await_writable(self, timeout_s: float) -> bool:
        """Wait for credit, or for the end of the connection."""
        with self._news:
            return self._news.wait_for(
                lambda: self._sender.has_credit() or bool(self._broken) or self._readable < 0,
                timeout_s,
            )

    def receive(self, wait_s: float | None) -> bytes | None:
        """The next packet."""
        try:
            if wait_s is None or wait_s > 0.0:
                packet = self._packets.get(timeout=wait_s)
            else:
                with self._lock:
                    packet = self._packets.get_nowait()
        except queue.Empty:
            return None
        with self._lock:
            if self._readable < 0 or not packet:
                self._packets.put(b"")  # the end stays the end
                raise OSError(self._broken or "the connection is closed")
            with contextlib.suppress(BlockingIOError):
                os.eventfd_read(self._readable)
            credit = self._receiver.consume(self._held.popleft()) if self._held else None
        if credit is not None:
            with contextlib.suppress(OSError):  # the end is still to be read
                self._publish(credit)
        return packet

    def _publish(self, packet: bytes) -> None:
        try:
            self._up.put(packet)
        except zenoh.ZError as error:
            raise OSError("the connection is closed") from error

    def fileno(self) -> int:
        """Readable when a packet waits."""
        return self._readable

    def close(self) -> None:
        """Say goodbye, wait until the hub has what was sent before it, and leave."""
        with self._news:
            readable, self._readable = self._readable, -1
            self._packets.put(b"")  # ends waits in other threads
            self._news.notify_all()
        if readable < 0:
            return
        atexit.unregister(self.close)
        os.close(readable)
        if not self._broken:
            with contextlib.suppress(OSError):
                self._publish(encode_text(BYE))
        self._ended.wait(CLOSE_S)
        self._answers.put(b"")  # ends their thread
        self._link.close()
