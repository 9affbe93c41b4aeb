"""Transports between a client of an emulated bus and its hub: whole packets, both ways, in order.

`UnixTransport` is a Unix socket on the machine of the bus; `zenoh_transport.ZenohTransport` reaches
the same hub from another machine.
"""

import contextlib
import select
import socket
import struct
from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from mypy_extensions import mypyc_attr

from bridge.can_bus import sockets
from bridge.can_bus.packet import MAX_BYTES, WELCOME, Packet, decode
from bridge.process.waiting import readable
from configs.errors import InfrastructureError, ScenarioError

FINE_S: Final = 0.03
"""Waits below this are kept to the microsecond; the kernel's own bound counts in its ticks."""
_TIMEVAL: Final = struct.Struct("ll")


@mypyc_attr(allow_interpreted_subclasses=True)
class Transport(ABC):
    """One client's connection to a hub."""

    __slots__ = ()

    @abstractmethod
    def send(self, packet: bytes) -> None:
        """Send at once. Raises `BlockingIOError` without space, `OSError` when it is broken."""

    @abstractmethod
    def await_writable(self, timeout_s: float) -> bool:
        """Wait until a packet can be sent; whether it can."""

    @abstractmethod
    def receive(self, wait_s: float | None) -> bytes | None:
        """The next packet; None if none came within `wait_s` (None: for ever); empty at the end."""

    @abstractmethod
    def fileno(self) -> int:
        """A descriptor that is readable when a packet is there; −1 once it is closed."""

    @abstractmethod
    def close(self) -> None:
        """Leave; sent packets arrive, and waits in other threads end. Idempotent."""


class JoinError(Exception):
    """A client could not join a bus; the text has the reason."""


class UnixTransport(Transport):
    """A transport over a Unix socket that keeps packet boundaries."""

    __slots__ = ("_bound_s", "_recv", "_send", "_socket")

    def __init__(self, path: Path, hello: bytes, timeout_s: float) -> None:
        """Connect and say hello.

        Raises:
            OSError: no program listens there, or not in time.
        """
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._bound_s: float | None = None
        self._recv, self._send = self._socket.recv, self._socket.send
        try:
            # The kernel's own bound: a socket that doesn't block is refused where others wait too.
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _timeval(timeout_s))
            self._socket.connect(str(path))
            with contextlib.suppress(BrokenPipeError):  # the reason is still to be read
                self._send(hello)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _timeval(None))
        except BlockingIOError as error:
            self._socket.close()
            raise TimeoutError("no answer in time") from error
        except OSError:
            self._socket.close()
            raise

    def send(self, packet: bytes) -> None:
        """Send at once."""
        self._send(packet, socket.MSG_DONTWAIT)

    def await_writable(self, timeout_s: float) -> bool:
        """Wait until a packet can be sent."""
        poller = select.poll()
        try:
            poller.register(self._socket, select.POLLOUT)
        except ValueError:
            return True  # it is closed: the next send raises
        return bool(poller.poll(timeout_s * 1e3))

    def receive(self, wait_s: float | None) -> bytes | None:
        """The next packet."""
        try:
            if wait_s is None or wait_s >= FINE_S:
                if wait_s != self._bound_s:
                    self._limit(wait_s)
                return self._recv(MAX_BYTES)
            if wait_s > 0.0 and not readable([self._socket], wait_s):
                return None
            return self._recv(MAX_BYTES, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return None
        except ConnectionResetError:
            # The hub closed with packets of ours unread; its own are still to be read.
            return self._recv(MAX_BYTES, socket.MSG_DONTWAIT)
        except ValueError as error:  # a descriptor of −1
            raise OSError("the connection is closed") from error

    def fileno(self) -> int:
        """The socket's descriptor."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close the socket; waits in other threads end."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _limit(self, wait_s: float | None) -> None:
        """Let the kernel bound a receive: one system call instead of two."""
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, _timeval(wait_s))
        self._bound_s = wait_s


def connect(
    channel: str, hello: bytes, timeout_s: float, remote: Mapping[str, str]
) -> tuple[Transport, Packet]:
    """Join a bus: its transport, and the WELCOME of its hub.

    Args:
        channel: bus, run/bus or path of a socket.
        hello: the client's HELLO packet.
        timeout_s: bound of the whole handshake.
        remote: options of a client on another machine (`credentials`); empty on this machine.

    Raises:
        JoinError: no such bus, no answer in time, or the hub refused; the text begins ": " or
            " refused: ".
    """
    transport: Transport | None = None
    try:
        if remote:
            # Only remote clients pay for loading Zenoh.
            from bridge.can_bus.credentials import network_of
            from bridge.can_bus.zenoh_transport import ZenohTransport

            transport = ZenohTransport(network_of(remote), channel, hello, timeout_s)
        else:
            transport = UnixTransport(sockets.find(channel), hello, timeout_s)
        data = transport.receive(timeout_s)
    except (OSError, ValueError, InfrastructureError, ScenarioError) as error:
        if transport is not None:
            transport.close()
        late = isinstance(error, TimeoutError) and not remote
        raise JoinError(f": {'no answer in time' if late else error}") from error
    answer = decode(data) if data else None
    if answer is not None and answer.kind == WELCOME:
        return transport, answer
    transport.close()
    if data is None:
        raise JoinError(": no answer in time")
    raise JoinError(f" refused: {answer.text if answer else 'it closed without a word'}")


def _timeval(wait_s: float | None) -> bytes:
    """A bound for the kernel; None: for ever."""
    seconds = 0 if wait_s is None else max(wait_s, 1e-6)
    return _TIMEVAL.pack(int(seconds), int(seconds % 1 * 1e6))
