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
from collections.abc import Container, Iterator

import zenoh
from zenoh.handlers import Callback

_AT_ONCE = struct.pack("ii", 0, 0)
"""Linux's struct linger: off."""


def connections(peers: Container[str]) -> Iterator[tuple[str, socket.socket]]:
    """This process's connections to these peers, each by a descriptor of its own.

    A peer is "address:port", IPv6 addresses in brackets, as in Zenoh's locators.
    """
    found = set()
    for connection in _sockets():
        with contextlib.suppress(OSError):
            host, port = connection.getpeername()[:2]
            peer = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
            if peer in peers and peer not in found:  # which Zenoh may have more descriptors of
                found.add(peer)
                # Not its own dup(), which would make it, and so Zenoh's, a blocking one.
                yield peer, socket.socket(fileno=os.dup(connection.fileno()))


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
    for connection in _sockets():
        with contextlib.suppress(OSError):
            ends = connection.getsockname(), connection.getpeername()
            if [str(port) for _, port, *_ in ends] == ports:
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)


def _port(locator: str) -> str:
    """Of an end of a link: "7447" of "tls/10.0.0.1:7447"."""
    return locator.rpartition(":")[2]


def _sockets() -> Iterator[socket.socket]:
    """This process's TCP sockets, which stay open when the object here goes."""
    for name in os.listdir("/proc/self/fd"):  # noqa: PTH208
        with contextlib.suppress(OSError):
            if stat.S_ISSOCK(os.fstat(int(name)).st_mode):
                found = socket.socket(fileno=int(name))
                try:
                    if found.family in (socket.AF_INET, socket.AF_INET6):
                        yield found
                finally:
                    found.detach()
