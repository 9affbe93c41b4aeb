"""A line from another machine: packets over Zenoh to the relay beside the hub (`relay`).

    guest ── <bus>/up ──► router, relay ── Unix socket ──► hub
          ◄─ <bus>/down ─

Packets are the same as on the Unix socket, so are the promises: lossless, in order, no echo. The
guest holds a liveliness token for as long as it lives; the router says when that is gone, and the
relay leaves the hub in its name. What a guest doesn't read waits at the guest, up to `BACKLOG`
packets; then its line is broken.
"""

import contextlib
import os
import queue
import secrets
import select
import time

from bridge import keys
from bridge.zenoh_link import open_client
from configs.brief import NetworkLink, TlsFiles
from configs.errors import InfrastructureError

BACKLOG = 100_000
_HELLO_EVERY_S = 0.1


class RemoteLine:
    """One guest's line to a bus behind a router."""

    def __init__(
        self,
        endpoint: str,
        bus: str,
        hello: bytes,
        timeout_s: float,
        *,
        user: str,
        password: str,
        tls: TlsFiles | None,
    ) -> None:
        """Connect, and say hello until the relay answers.

        Raises:
            OSError: no router there, the login was refused, or nobody relays that bus.
        """
        deadline = time.monotonic() + timeout_s
        self._packets: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self._broken = ""
        self._readable = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC | os.EFD_SEMAPHORE)
        network = NetworkLink("", endpoint, user, password or user, tls)
        try:
            self._link = open_client(network, timeout_s)
        except InfrastructureError as error:
            os.close(self._readable)
            raise OSError(str(error)) from error
        place = keys.guest_line(user, secrets.token_hex(8), bus)
        self._alive = f"{place}/alive"
        self._link.each(f"{place}/down", self._take)
        self._up = self._link.publisher(f"{place}/up")
        self._link.declare_live(self._alive)
        while True:
            self._up.put(hello)
            if select.select([self._readable], [], [], _HELLO_EVERY_S)[0]:
                return
            if time.monotonic() > deadline:
                self.close()
                raise TimeoutError(
                    f"nobody at {endpoint} answers to {user!r} for a bus within {timeout_s:g} s"
                )

    def _take(self, packet: bytes) -> None:
        if self._packets.qsize() >= BACKLOG:
            self._broken = f"{BACKLOG} packets wait to be read"
            packet = b""
        if self._readable >= 0:
            os.eventfd_write(self._readable, 1)  # first: every packet that is got is counted
            self._packets.put(packet)

    def send(self, packet: bytes) -> None:
        """Send at once; waits only while the network is full."""
        if self._readable < 0:
            raise OSError("the line is closed")
        self._up.put(packet)

    def await_room(self, timeout_s: float) -> bool:  # noqa: ARG002 - a send waits itself
        """There always is."""
        return True

    def receive(self, wait_s: float | None) -> bytes | None:
        """The next packet."""
        if self._readable < 0:
            raise OSError("the line is closed")
        try:
            if wait_s is not None and wait_s <= 0.0:
                packet = self._packets.get_nowait()
            else:
                packet = self._packets.get(timeout=wait_s)
        except queue.Empty:
            return None
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self._readable)
        if not packet and self._broken:
            raise OSError(self._broken)
        return packet

    def fileno(self) -> int:
        """Readable when a packet waits."""
        return self._readable

    def close(self) -> None:
        """Leave."""
        readable, self._readable = self._readable, -1
        if readable >= 0:
            self._link.close()
            os.close(readable)
