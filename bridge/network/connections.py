"""The TCP connections of this process by their peers: sockets that are Zenoh's, found in /proc.

Zenoh sets SO_LINGER to 10 s, so close(2) of a connection whose peer is gone waits in a thread that
carries other connections as well: in a client the only one, which then doesn't connect again until
the kernel hears of the old connection, or 10 s are over. Without the option the kernel delivers
what was sent in the background, as always.
"""

import contextlib
import os
import socket
import stat
import struct
from collections.abc import Collection, Iterator

import zenoh
from zenoh.handlers import Callback

_AT_ONCE = struct.pack("ii", 0, 0)
"""Linux's struct linger: off."""


class Connections:
    """This process's connections by their peers; remembers which descriptors they had.

    A peer is "address:port", IPv6 addresses in brackets, as in Zenoh's locators.
    """

    __slots__ = ("_descriptors",)

    def __init__(self) -> None:
        self._descriptors: dict[str, int] = {}

    def to(self, peers: Collection[str]) -> Iterator[tuple[str, socket.socket]]:
        """The connections to these peers, each by a descriptor of its own."""
        found = {
            peer: descriptor
            for peer, descriptor in self._descriptors.items()
            if peer in peers and _peer(descriptor) == peer
        }
        if len(found) < len(peers):
            found = {}
            for descriptor in _descriptors():
                peer = _peer(descriptor)
                if peer in peers:  # Zenoh may have more descriptors of it: the first will do
                    found.setdefault(peer, descriptor)
        self._descriptors = found
        for peer, descriptor in found.items():
            with contextlib.suppress(OSError):
                # Not its own dup(), which would make it, and so Zenoh's, a blocking one.
                yield peer, socket.socket(fileno=os.dup(descriptor))


def never_linger(session: zenoh.Session) -> object:
    """Let close(2) return at once for every connection of a session, those to come as well.

    Returns what must be kept for as long as the session.
    """

    def on_link(event: zenoh.LinkEvent) -> None:
        if event.kind == zenoh.SampleKind.PUT:
            _close_at_once(event.link)

    listener: object = session.info.declare_link_events_listener(Callback(on_link, indirect=False))
    for link in session.info.links():
        _close_at_once(link)
    return listener


def _close_at_once(link: zenoh.Link) -> None:
    """Let close(2) return at once for a link; the ports of both ends are enough to find it."""
    ports = [_port(link.src), _port(link.dst)]
    for descriptor in _descriptors():
        with contextlib.suppress(OSError), _borrowed(descriptor) as connection:
            if connection is None:
                continue
            ends = connection.getsockname(), connection.getpeername()
            if [str(port) for _, port, *_ in ends] == ports:
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)


def _port(locator: str) -> str:
    """Of an end of a link: "7447" of "tls/10.0.0.1:7447"."""
    return locator.rpartition(":")[2]


def _descriptors() -> Iterator[int]:
    """This process's, as far as they are open."""
    return map(int, os.listdir("/proc/self/fd"))  # noqa: PTH208


def _peer(descriptor: int) -> str:
    """The peer of a TCP connection, "" if the descriptor is of none."""
    with contextlib.suppress(OSError), _borrowed(descriptor) as connection:
        if connection is not None:
            host, port = connection.getpeername()[:2]
            return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    return ""


@contextlib.contextmanager
def _borrowed(descriptor: int) -> Iterator[socket.socket | None]:
    """A TCP socket, which stays open when the object here goes; None if it is none.

    Raises:
        OSError: the descriptor is closed.
    """
    if not stat.S_ISSOCK(os.fstat(descriptor).st_mode):
        yield None
        return
    found = socket.socket(fileno=descriptor)
    try:
        yield found if found.family in (socket.AF_INET, socket.AF_INET6) else None
    finally:
        found.detach()
