"""Addresses that each test has for itself: test runs beside each other must not hear each other."""

import secrets
import socket


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    """A port that nobody has now."""
    with socket.socket(type=kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def multicast_bus() -> str:
    """A deployment's `bus` on UDP multicast, in a group and on a port that nobody else uses."""
    group = ".".join(str(part) for part in (239, 74, *secrets.token_bytes(2)))
    port = free_port(socket.SOCK_DGRAM)
    where = f'channel = "{group}", port = {port}, hop_limit = 0'
    return f'bus = {{ interface = "udp_multicast", {where} }}'


def multicast_goes_nowhere() -> bool:
    """Whether this machine has no route for multicast."""
    with socket.socket(type=socket.SOCK_DGRAM) as probe:
        probe.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        try:
            probe.sendto(b"", ("239.74.163.9", 43118))
        except OSError:
            return True
    return False
