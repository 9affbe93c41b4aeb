"""How a router listens: on loopback if nobody says where, and so that nobody is kept out.

Whoever opens connections and says nothing, or goes no further, costs little and blocks nobody.
"""

import contextlib
import os
import resource
import socket
from collections.abc import Sequence
from pathlib import Path

import zenoh

from bridge.network.session import set_key
from configs.errors import InfrastructureError

_HANDSHAKE_S, _SILENT_S, _PROBE_S = 2.0, 3600, 1.0
_LEAST_PENDING, MOST_PENDING, _LEAST_SESSIONS = 100, 4096, 1000


def loopback() -> str:
    """A free endpoint that only this machine reaches.

    Raises:
        InfrastructureError: the machine has no loopback address.
    """
    reasons = []
    for family, host in ((socket.AF_INET, "127.0.0.1"), (socket.AF_INET6, "::1")):
        try:
            with socket.socket(family, socket.SOCK_STREAM) as probe:
                probe.bind((host, 0))
                probe.listen()
                port: int = probe.getsockname()[1]
                socket.create_connection((host, port), _PROBE_S).close()  # its device may be down
        except OSError as error:
            reasons.append(f"{host}: {error.strerror}")
        else:
            return f"tcp/[{host}]:{port}" if ":" in host else f"tcp/{host}:{port}"
    raise InfrastructureError(
        f"no loopback address for the processes of a run to meet at ({', '.join(reasons)}):"
        " ip link set lo up"
    )


def hasty(endpoint: str) -> str:
    """The same with a bound on how long a handshake of TLS may take."""
    milliseconds = int(_HANDSHAKE_S * 1e3)
    return f"{endpoint}#tls_handshake_timeout_ms={milliseconds}" if "tls/" in endpoint else endpoint


def accept_many(config: zenoh.Config, identities: int) -> None:
    """Let those who open connections and say nothing keep nobody out.

    Each costs a descriptor until `_HANDSHAKE_S`; those beyond the limit are hung up on, and whoever
    means it tries again at once. They get a quarter of the descriptors at most.
    """
    descriptors, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    pending = min(max(descriptors // 4, 2 * identities, _LEAST_PENDING), MOST_PENDING)
    set_key(config, "transport/unicast/accept_timeout", int(_HANDSHAKE_S * 1e3))
    set_key(config, "transport/unicast/accept_pending", pending)
    set_key(config, "transport/unicast/max_sessions", _LEAST_SESSIONS + 2 * identities)


def await_first_words(endpoints: Sequence[str]) -> None:
    """Let the kernel keep connections until their first bytes: who listens here, speaks second.

    The sockets are Zenoh's, which has no setting for it; where they can't be had or the kernel
    doesn't do it they stay as they are.
    """
    ports = {int(port) for at in endpoints if (port := at.rpartition(":")[2]).isdecimal()}
    for descriptor in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):
            if not str(descriptor.readlink()).startswith("socket:"):
                continue
            with socket.socket(fileno=os.dup(int(descriptor.name))) as listener:
                listens = listener.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
                if listens and listener.getsockname()[1] in ports:
                    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_DEFER_ACCEPT, _SILENT_S)
