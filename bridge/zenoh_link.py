"""A link over Zenoh: client sessions to one router, which enforces the graph.

Client mode, multicast and gossip off, so that nobody can talk past the router; shared memory off;
reliable, blocking, real-time priority: nothing is dropped. Express, nothing waits for a batch.
Subscribers run on Zenoh's network thread and only queue. Every session is closed in a `with`: one
that isn't can keep its process from ending. Every session is kept until the process ends (`_keep`).

Each session keeps few threads: a message that wakes one instead of five costs half as much. In a
router what hears and what says stay apart, so that somebody who doesn't read can't stop the rest.
"""

import contextlib
import ctypes
import json
import os
import resource
import select
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

import zenoh
from zenoh.handlers import Callback, RingChannel

from bridge import zenoh_log
from bridge.access import AccessPlan
from bridge.denials import Denials, directives, is_ours
from bridge.link import ROOM_BYTES, Arrival, Inbox, Publisher
from bridge.login import Obstacle, obstacle, taken
from bridge.messages import MAX_BYTES
from bridge.process import Stop
from configs.brief import LEASE_S, NetworkLink, Outside, TlsFiles
from configs.errors import InfrastructureError

CLOSE_S = 1.0
_PROBE_S = 1.0
_FIRST_RETRY_S, _LAST_RETRY_S = 0.02, 0.3
_ATTEMPT_S, _LISTEN_S = 5.0, 10.0
_HANDSHAKE_S, _SILENT_S = 2.0, 3600
_BLOCKED_S = 5.0
"""Zenoh's own: a put that waits for longer closes its session."""
_LEAST_PENDING, _MOST_PENDING, _LEAST_SESSIONS = 100, 4096, 1000
_PORT_TRIES = 5
POLLED_DEPTH = 64
"""Messages on a key that wait for who polls, the newest: more than any schedule lets be on their
way (`configs.brief.LEAD_TICKS`)."""
_YIELDS = 20
_PAUSE_S, _LONGEST_PAUSE_S = 50e-6, 2e-3
_ONE_THREAD = (
    "(app: (worker_threads: 1), net: (handover: app), acc: (handover: app), rx: (handover: app),"
    " tx: (handover: app))"
)
_ROUTER_THREADS = (
    "(app: (worker_threads: 1), net: (handover: app), acc: (handover: app),"
    " rx: (worker_threads: 2), tx: (worker_threads: 1))"
)
_WAIT_BEFORE_CLOSE = "transport/link/tx/queue/congestion_control/block/wait_before_close"
UNREAD_S = 0.5
"""Who doesn't read for this long what he asked for, while others wait to say more, is cut off."""
_Kept = TypeVar("_Kept")


class ZenohLink:
    """One Zenoh session as a `bridge.link.Link`."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._inbox = Inbox()
        self._declared: list[object] = []
        self._tokens: dict[str, zenoh.LivelinessToken] = {}
        self.receive = self._inbox.receive

    def publisher(self, key: str, *, express: bool = True) -> Publisher:
        """A publisher on `key`; a put blocks rather than drops."""
        return self._session.declare_publisher(
            key,
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.REAL_TIME,
            express=express,
            reliability=zenoh.Reliability.RELIABLE,
            allowed_destination=zenoh.Locality.REMOTE,
        )

    def subscribe(self, key: str, tag: str, *, room_bytes: int = ROOM_BYTES) -> None:
        """Queue what others put on `key`, marked with `tag`; what finds no room is counted."""
        put = self._inbox.mailbox(tag, room_bytes)

        def take(sample: zenoh.Sample) -> None:
            payload = sample.payload
            put(str(sample.key_expr), payload.to_bytes, len(payload))

        self._declared.append(
            self._session.declare_subscriber(
                key, Callback(take, indirect=False), allowed_origin=zenoh.Locality.REMOTE
            )
        )

    def each(self, key: str, act: Callable[[bytes], None]) -> None:
        """Call `act`, on the network's thread, with what others put on `key`."""
        self.each_keyed(key, lambda _, payload: act(payload))

    def each_keyed(self, key_expr: str, act: Callable[[str, bytes], None]) -> None:
        """Call `act`, on the network's thread, with key and payload of what others put."""

        def take(sample: zenoh.Sample) -> None:
            act(str(sample.key_expr), sample.payload.to_bytes())

        self._declared.append(
            self._session.declare_subscriber(
                key_expr, Callback(take, indirect=False), allowed_origin=zenoh.Locality.REMOTE
            )
        )

    def declare_live(self, key: str) -> None:
        """Hold a liveliness token on `key`."""
        self._tokens[key] = self._session.liveliness().declare_token(key)

    def withdraw_live(self, key: str) -> None:
        """Let go of the token on `key`."""
        self._tokens.pop(key).undeclare()

    def on_gone(self, key: str, act: Callable[[], None]) -> None:
        """Call `act`, on the network's thread, when the token on `key` goes, or the way to it."""

        def take(_: str, alive: bool) -> None:
            if not alive:
                act()

        self.each_live(key, take)

    def each_live(self, key_expr: str, act: Callable[[str, bool], None]) -> None:
        """Call `act`, on the network's thread, with every token that is there, comes or goes."""

        def take(sample: zenoh.Sample) -> None:
            act(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        self._declared.append(
            self._session.liveliness().declare_subscriber(
                key_expr, Callback(take, indirect=False), history=True
            )
        )

    def watch_live(self, key_expr: str, tag: str) -> None:
        """Queue b"1" for every token that is there or comes, b"0" for every one that goes."""
        put = self._inbox.put_latest
        self.each_live(key_expr, lambda key, alive: put(Arrival(tag, key, b"1" if alive else b"0")))

    def dropped(self) -> dict[str, int]:
        """By tag, how many messages found no room because nobody took those before them."""
        return self._inbox.dropped()

    stuck = False
    """A session of this process did not close in time: the process must end without its leave."""

    def close(self) -> None:
        """Close the session and with it all that it declared, within `CLOSE_S`.

        A session that still has something for a peer that was killed while it did not read can hang
        in its close, and so could dropping what it declared before it is closed.
        """
        if not self._session.is_closed():
            closer = threading.Thread(target=self._session.close, daemon=True)
            closer.start()
            closer.join(CLOSE_S)
            if closer.is_alive():
                ZenohLink.stuck = True
                _keep(self._declared)
                _keep(self._tokens)
                return
        self._declared.clear()
        self._tokens.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()


class PolledLink(ZenohLink):
    """A link for who looks at given times: what comes wakes nobody and runs no Python.

    `receive` looks at all subscribers in turn. Waiting is looking again: a few times giving way to
    others, then with pauses that grow.
    """

    def __init__(self, session: zenoh.Session) -> None:
        super().__init__(session)
        self._polled: list[tuple[str, str, Callable[[], zenoh.Sample | None]]] = []
        self.receive = self._receive

    def subscribe(self, key: str, tag: str, **_: int) -> None:
        """Keep the last `POLLED_DEPTH` that others put on `key`, marked with `tag`.

        Never more, whatever their size: of what arrives here the router bounds that.
        """
        subscriber = self._session.declare_subscriber(
            key, RingChannel(POLLED_DEPTH), allowed_origin=zenoh.Locality.REMOTE
        )
        self._declared.append(subscriber)
        self._polled.append((tag, key, subscriber.try_recv))

    def _receive(self, timeout_s: float) -> Arrival | None:
        if (arrival := self._look()) is not None or timeout_s <= 0.0:
            return arrival
        deadline = time.monotonic() + timeout_s
        looks, pause_s = 0, _PAUSE_S
        while (left_s := deadline - time.monotonic()) > 0.0:
            if looks < _YIELDS:
                os.sched_yield()
            else:
                time.sleep(min(pause_s, left_s))
                pause_s = min(1.5 * pause_s, _LONGEST_PAUSE_S)
            looks += 1
            if (arrival := self._look()) is not None:
                return arrival
        return None

    def _look(self) -> Arrival | None:
        """What waits on one of the keys; whose turn it was, waits for all others' next time."""
        polled = self._polled
        for n, (tag, key, look) in enumerate(polled):
            if (sample := look()) is not None:
                polled.append(polled.pop(n))
                return Arrival(tag, key, sample.payload.to_bytes())
        return None

    def close(self) -> None:
        """Close the session and all that it declared."""
        self._polled.clear()
        super().close()


class RouterLink(ZenohLink):
    """The launcher's link: its session is the router."""

    def __init__(self, session: zenoh.Session, endpoint: str, denials: Denials) -> None:
        super().__init__(session)
        self.endpoint = endpoint
        self.denials = denials
        """Whom the router refused, from its log."""


class StoppedError(Exception):
    """Asked to stop before there was a session."""


def open_client(network: NetworkLink, timeout_s: float, stop: Stop | None = None) -> ZenohLink:
    """Connect to the router as `network.user`.

    Raises:
        InfrastructureError: nobody answers there, or the login was refused.
        StoppedError: `stop` was requested before.
    """
    return ZenohLink(_client(network, timeout_s, stop))


def open_polled(network: NetworkLink, timeout_s: float, stop: Stop | None = None) -> PolledLink:
    """The same for who looks at given times."""
    return PolledLink(_client(network, timeout_s, stop))


def _client(network: NetworkLink, timeout_s: float, stop: Stop | None) -> zenoh.Session:
    """Try until it opens; a refused login is told at once, who isn't there yet is waited for."""
    wake = [] if stop is None else [stop.wake_fd]
    deadline = time.monotonic() + timeout_s
    pause_s = _FIRST_RETRY_S
    while True:
        left_s = min(max(deadline - time.monotonic(), _FIRST_RETRY_S), _ATTEMPT_S)
        with _few_threads(_ONE_THREAD):
            session = _open_bounded(_login_config("client", network, left_s), left_s + 1.0)
        if not isinstance(session, str):
            return session
        reason = _reason(network)
        if reason.final or time.monotonic() + pause_s > deadline:
            within = "" if reason.final else f" within {timeout_s:g} s"
            raise InfrastructureError(
                f"{network.user}: no session with the router at {network.endpoint}{within}:"
                f" {reason.text}"
            )
        if select.select(wake, [], [], pause_s)[0]:
            raise StoppedError
        pause_s = min(1.5 * pause_s, _LAST_RETRY_S)


def _reason(network: NetworkLink) -> Obstacle:
    """Why there is no session: Zenoh tells it peers only."""
    config = _login_config("peer", network, _PROBE_S)
    _set(config, "listen/endpoints", [])
    _set(config, "connect/exit_on_failure", True)
    said = _open_bounded(config, _PROBE_S + 1.0)
    if isinstance(said, str):
        return obstacle(said, network.user)
    said.close()
    return obstacle("", network.user)


def _login_config(mode: str, network: NetworkLink, timeout_s: float) -> zenoh.Config:
    """For a single attempt."""
    config = _config(mode, network.lease_s)
    # A put that finds the router stopped waits for as long as the router may.
    _set(config, _WAIT_BEFORE_CLOSE, int(max(network.lease_s, _BLOCKED_S) * 1e6))
    _set(config, "connect/endpoints", [network.endpoint])
    _set(config, "connect/timeout_ms", 0)
    _set(config, "transport/unicast/open_timeout", max(int(timeout_s * 1000), 1))
    _set(config, "transport/auth/usrpwd/user", network.user)
    _set(config, "transport/auth/usrpwd/password", network.password)
    if network.tls is not None:
        _set(config, "transport/link/tls", _mutual_tls(network.tls, "connect"))
    return config


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

    Those on other machines come in at `outside`. `folder` must be private: the user dictionary is
    written there while the router opens. Who doesn't read is cut off after `unread_s`; who doesn't
    hear the router for `lease_s` takes it for gone.

    Raises:
        InfrastructureError: an endpoint is taken or can't be listened on.
    """
    denials = Denials()
    zenoh_log.begin(directives(every_message=outside is not None))
    dictionary = folder / "users"
    dictionary.touch(mode=0o600)
    dictionary.write_text(access.dictionary(), "utf-8")
    with zenoh_log.listening(denials.take, is_ours):
        try:
            session, at = _listen(endpoint, access, dictionary, outside, unread_s, lease_s)
        finally:
            dictionary.unlink()
        with RouterLink(session, at, denials) as link:
            yield link


@contextlib.contextmanager
def _few_threads(threads: str) -> Iterator[None]:
    """Around the first session of a process: Zenoh reads it then, and children don't inherit it."""
    if "ZENOH_RUNTIME" in os.environ:
        yield
        return
    os.environ["ZENOH_RUNTIME"] = threads
    try:
        yield
    finally:
        del os.environ["ZENOH_RUNTIME"]


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
        at = endpoint or _loopback()
        config = _config("router", lease_s)
        _set(config, "listen/endpoints", [at, *([_hasty(outside.endpoint)] if outside else [])])
        if outside is not None and outside.tls is not None:
            _set(config, "transport/link/tls", _mutual_tls(outside.tls, "listen"))
        _accept_many(config, len(access.rights))
        _set(config, "transport/auth/usrpwd/dictionary_file", str(dictionary))
        config.insert_json5("access_control", access.access_control())
        config.insert_json5("low_pass_filter", access.low_pass_filter())
        config.insert_json5("downsampling", access.downsampling())
        _set(config, _WAIT_BEFORE_CLOSE, int(unread_s * 1e6))
        with _few_threads(_ROUTER_THREADS):
            session = _open_bounded(config, _LISTEN_S)
        if not isinstance(session, str):
            _await_first_words([at, *([outside.endpoint] if outside else [])])
            return session, at
        reason = taken(session)
    where = " and ".join(
        [endpoint or "any loopback port", *([outside.endpoint] if outside is not None else [])]
    )
    raise InfrastructureError(f"can't listen at {where}: {reason}")


def _hasty(endpoint: str) -> str:
    """The same with a bound on how long a handshake of TLS may take."""
    milliseconds = int(_HANDSHAKE_S * 1e3)
    return f"{endpoint}#tls_handshake_timeout_ms={milliseconds}" if "tls/" in endpoint else endpoint


def _accept_many(config: zenoh.Config, identities: int) -> None:
    """Let those who open connections and say nothing keep nobody out.

    Each costs a descriptor until `_HANDSHAKE_S`; those beyond the limit are hung up on, and whoever
    means it tries again at once (`_client`). A quarter of the descriptors stays out of their reach.
    """
    descriptors, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    pending = min(max(descriptors // 4, 2 * identities, _LEAST_PENDING), _MOST_PENDING)
    _set(config, "transport/unicast/accept_timeout", int(_HANDSHAKE_S * 1e3))
    _set(config, "transport/unicast/accept_pending", pending)
    _set(config, "transport/unicast/max_sessions", _LEAST_SESSIONS + 2 * identities)


def _await_first_words(endpoints: Sequence[str]) -> None:
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


def _mutual_tls(files: TlsFiles, side: str) -> dict[str, object]:
    """Zenoh's TLS section; `side` is "listen" or "connect"."""
    return {
        "root_ca_certificate": files.ca,
        "enable_mtls": True,
        f"{side}_certificate": files.certificate,
        f"{side}_private_key": files.private_key,
    }


def _config(mode: str, lease_s: float) -> zenoh.Config:
    zenoh_log.begin()
    config = zenoh.Config()
    _set(config, "mode", mode)
    _set(config, "scouting/multicast/enabled", False)
    _set(config, "scouting/gossip/enabled", False)
    _set(config, "scouting/delay", 0)
    _set(config, "transport/shared_memory/enabled", False)
    _set(config, "transport/link/rx/max_message_size", 2 * MAX_BYTES)
    _set(config, "transport/link/tx/lease", int(lease_s * 1e3))
    return config


def _set(config: zenoh.Config, path: str, value: object) -> None:
    config.insert_json5(path, json.dumps(value))


def _open_bounded(config: zenoh.Config, timeout_s: float) -> zenoh.Session | str:
    """A session, or why there is none; "" if that took too long.

    Opened in a thread of its own: a peer that accepts and never answers would hang it. A session
    that opens after all when nobody waits for it any more is closed.
    """
    result: list[zenoh.Session | str] = []
    lock = threading.Lock()
    waiting = True

    def open_session() -> None:
        try:
            opened: zenoh.Session | str = _keep(zenoh.open(config))
        except zenoh.ZError as error:
            opened = str(error)
        with lock:
            if waiting:
                result.append(opened)
                return
        if not isinstance(opened, str):
            opened.close()

    opener = threading.Thread(target=open_session, daemon=True)
    opener.start()
    opener.join(timeout_s)
    with lock:
        waiting = False
    return result[0] if result else ""


def _keep(thing: _Kept) -> _Kept:
    """Never deallocate it: no list or module may own it, for those end before the process does.

    To deallocate a session, open or closed, is to wait with the GIL held for a task of Zenoh's,
    and Zenoh's only thread may wait for the GIL at that moment to call another session back: every
    thread of the process would stop for ever. Whatever drops the last reference does it, a garbage
    collection of an old exception's traceback in any thread too. A session that was closed costs
    20 kB.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(thing))
    return thing


def _loopback() -> str:
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
