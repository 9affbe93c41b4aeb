"""The router of a run, in the launcher's process: listens, authenticates, enforces access.

Without an endpoint it listens on a free port of the loopback interface. Connections without a login
cost little and keep no other client out: handshakes are bounded in time and number, and the kernel
holds back connections that send nothing. A client that doesn't read for `UNREAD_S` while others
wait to send to it is disconnected.
"""

import contextlib
import os
import socket
from collections.abc import Iterator, Sequence
from pathlib import Path

import zenoh

from bridge.network import zenoh_log
from bridge.network.access import AccessPlan
from bridge.network.client import StoppedError, open_session
from bridge.network.flood_guard import FloodGuard, deafen
from bridge.network.router_config import router_settings
from bridge.network.router_refusals import Denials, directives, is_ours
from bridge.network.session import (
    ROUTER_THREADS,
    config_of,
    few_threads,
    open_bounded,
)
from bridge.network.session_errors import taken
from bridge.network.zenoh_link import ZenohLink
from bridge.process.lifecycle import Stop
from configs.connections import LEASE_S, NetworkLink, Outside
from configs.errors import InfrastructureError
from configs.roles import AGENT

_LISTEN_S = 10.0
_PORT_TRIES = 5
UNREAD_S = 0.5
_SILENT_S, _PROBE_S = 3600, 1.0


class LauncherLink(ZenohLink):
    """The launcher's link to a router elsewhere, whose refusals stay in that router's log."""

    def __init__(self, session: zenoh.Session, endpoint: str, denials: Denials) -> None:
        super().__init__(session)
        self.endpoint = endpoint
        self.denials = denials
        """Refusals by the router, from its log."""

    def look_for_floods(self, ticks: int, now_s: float) -> None:
        """Nothing: a router elsewhere looks after itself."""


class RouterLink(LauncherLink):
    """The launcher's link: its session is the router."""

    def __init__(self, session: zenoh.Session, endpoint: str, denials: Denials) -> None:
        super().__init__(session, endpoint, denials)
        self._guard = FloodGuard()
        denials.turn_away = deafen

    def look_for_floods(self, ticks: int, now_s: float) -> None:
        """Cut off controllers that say far too much; call it several times a second."""
        controllers = self.denials.peers(AGENT.identity())
        for peer in self._guard.look(controllers, ticks, now_s):
            self.denials.note_flood(controllers[peer], peer)


@contextlib.contextmanager
def open_router(
    endpoint: str | None,
    access: AccessPlan,
    folder: Path,
    outside: Outside | None = None,
    *,
    unread_s: float = UNREAD_S,
    lease_s: float = LEASE_S,
) -> Iterator[RouterLink]:
    """Be the router at `endpoint`, or at a free loopback port if None, and enforce `access`.

    Clients on other machines connect at `outside`. `folder` must be private: it holds the user
    dictionary while the router opens. A client that doesn't read is cut off after `unread_s`; a
    client that hears nothing of the router for `lease_s` takes it for gone.

    Raises:
        InfrastructureError: an endpoint is taken or can't be listened on.
    """
    present = {user: access.passwords[user] for user in access.certified}
    denials = Denials(present, access.kept_out, access.expiries)
    zenoh_log.begin(directives(every_message=outside is not None))
    dictionary = folder / "users"
    dictionary.touch(mode=0o600)
    dictionary.write_text(access.dictionary(), "utf-8")
    with zenoh_log.listening(denials.process, is_ours):
        try:
            session, at = _listen(endpoint, access, dictionary, outside, unread_s, lease_s)
        finally:
            dictionary.unlink()
        with RouterLink(session, at, denials) as link:
            yield link


def join_router(network: NetworkLink, timeout_s: float, stop: Stop | None = None) -> LauncherLink:
    """Be the launcher of a run whose router is a program of its own.

    Raises:
        InfrastructureError: no answer from there, the login was refused, or `stop` was requested.
    """
    try:
        session = open_session(network, timeout_s, stop)
    except StoppedError as error:
        raise InfrastructureError(f"no router at {network.endpoint} yet: stopped") from error
    return LauncherLink(session, network.endpoint, Denials())


def _listen(
    endpoint: str | None,
    access: AccessPlan,
    dictionary: Path,
    outside: Outside | None,
    unread_s: float,
    lease_s: float,
) -> tuple[zenoh.Session, str]:
    tries = 1 if endpoint else _PORT_TRIES
    reason = ""
    for _ in range(tries):
        at = endpoint or loopback()
        settings = router_settings(
            access,
            [at, *([outside.endpoint] if outside else [])],
            dictionary,
            outside.tls if outside else None,
            lease_s=lease_s,
            unread_s=unread_s,
        )
        with few_threads(ROUTER_THREADS):
            session = open_bounded(config_of(settings), _LISTEN_S)
        if not isinstance(session, str):
            await_first_words([at, *([outside.endpoint] if outside else [])])
            return session, at
        reason = taken(session)
    where = " and ".join(
        [endpoint or "any loopback port", *([outside.endpoint] if outside is not None else [])]
    )
    raise InfrastructureError(f"can't listen at {where}: {reason}")


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


def await_first_words(endpoints: Sequence[str]) -> None:
    """Let the kernel hold back connections until their first bytes: the client speaks first.

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
