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
    for descriptor in os.scandir("/proc/self/fd"):
        with contextlib.suppress(OSError):
            if not stat.S_ISSOCK(descriptor.stat().st_mode):
                continue
            connection = socket.socket(fileno=os.dup(int(descriptor.name)))
            try:
                inet = connection.family in (socket.AF_INET, socket.AF_INET6)
                peer = _place(connection.getpeername()) if inet else ""
            except OSError:
                peer = ""
            if peer in peers and peer not in found:  # which Zenoh may have more descriptors of
                found.add(peer)
                yield peer, connection
            else:
                connection.close()


def never_linger(session: zenoh.Session) -> object:
    """Let close(2) return at once for every connection of a session, those to come as well.

    Returns what must be kept for as long as the session.
    """

    def on_link(event: zenoh.LinkEvent) -> None:
        if event.kind == zenoh.SampleKind.PUT:
            close_at_once(event.link.dst.partition("/")[2])

    listener: object = session.info.declare_link_events_listener(
        Callback(on_link, indirect=False), history=True
    )
    return listener


def close_at_once(peer: str) -> None:
    """Let close(2) of the connections to this peer return at once."""
    for _, connection in connections({peer}):
        with connection, contextlib.suppress(OSError):
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)


def _place(address: tuple[str, int]) -> str:
    host, port = address[:2]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
