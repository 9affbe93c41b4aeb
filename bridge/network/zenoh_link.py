"""A link over Zenoh: client sessions to one router, which enforces the graph.

Reliable, blocking, real-time priority: nothing is dropped. Express, nothing waits for a batch.
Subscribers run on Zenoh's network thread and only queue. Every session is closed in a `with`: one
that isn't can keep its process from ending. All are kept until it ends
(`bridge.network.session.keep`).
"""

import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

import zenoh
from zenoh.handlers import Callback, RingChannel

from bridge.network import zenoh_log
from bridge.network.access import AccessPlan
from bridge.network.denials import Denials, directives, is_ours
from bridge.network.floods import FloodGuard, deafen
from bridge.network.link import ROOM_BYTES, Arrival, Dropped, Inbox, Publisher
from bridge.network.listening import accept_many, await_first_words, hasty, loopback
from bridge.network.login import Obstacle, obstacle, taken
from bridge.network.session import (
    ONE_THREAD,
    ROUTER_THREADS,
    few_threads,
    keep,
    mutual_tls,
    open_bounded,
    set_key,
    settings,
)
from bridge.process import Stop
from bridge.waiting import readable
from configs.brief import LEASE_S, NetworkLink, Outside
from configs.errors import InfrastructureError
from configs.roles import AGENT

CLOSE_S = 1.0
_PROBE_S = 1.0
_FIRST_RETRY_S, _LAST_RETRY_S = 0.02, 0.3
_ATTEMPT_S, _LISTEN_S = 5.0, 10.0
_BLOCKED_S = 5.0
"""Zenoh's own: a put that waits for longer closes its session."""
_PORT_TRIES = 5
POLLED_DEPTH = 1 << 15
"""Messages on a key that wait for who polls, the newest: many times more than any schedule lets be
on their way (`configs.brief.LEAD_TICKS`), so that a flood doesn't wash away what is due."""
_YIELDS = 20
_PAUSE_S, _LONGEST_PAUSE_S = 50e-6, 2e-3
_WAIT_BEFORE_CLOSE = "transport/link/tx/queue/congestion_control/block/wait_before_close"
UNREAD_S = 0.5
"""Who doesn't read for this long what he asked for, while others wait to say more, is cut off."""


class ZenohLink:
    """One Zenoh session as a `bridge.network.link.Link`."""

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
        put = self._inbox.mailbox(key, tag, room_bytes)

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

    def dropped(self) -> list[Dropped]:
        """The subscriptions that had no room for all, because nobody took what came before."""
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
                keep(self._declared)
                keep(self._tokens)
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

    def __init__(self, session: zenoh.Session, depth: int) -> None:
        super().__init__(session)
        self._depth = depth
        self._polled: list[tuple[str, str, Callable[[], zenoh.Sample | None]]] = []
        self.receive = self._receive

    def subscribe(self, key: str, tag: str, **_: int) -> None:
        """Keep the last that others put on `key`, marked with `tag`.

        Never more, whatever their size: of what arrives here the router bounds that.
        """
        subscriber = self._session.declare_subscriber(
            key, RingChannel(self._depth), allowed_origin=zenoh.Locality.REMOTE
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
        self._guard = FloodGuard()
        denials.turn_away = deafen

    def look_for_floods(self, ticks: int, now_s: float) -> None:
        """Cut off controllers that say far too much; call it several times a second."""
        controllers = self.denials.peers(AGENT.identity())
        for peer in self._guard.look(controllers, ticks, now_s):
            self.denials.note_flood(controllers[peer], peer)


class StoppedError(Exception):
    """Asked to stop before there was a session."""


def open_client(network: NetworkLink, timeout_s: float, stop: Stop | None = None) -> ZenohLink:
    """Connect to the router as `network.user`.

    Raises:
        InfrastructureError: nobody answers there, or the login was refused.
        StoppedError: `stop` was requested before.
    """
    return ZenohLink(_client(network, timeout_s, stop))


def open_polled(
    network: NetworkLink,
    timeout_s: float,
    stop: Stop | None = None,
    *,
    depth: int = POLLED_DEPTH,
) -> PolledLink:
    """The same for who looks at given times and keeps the last `depth` messages on each key."""
    return PolledLink(_client(network, timeout_s, stop), depth)


def _client(network: NetworkLink, timeout_s: float, stop: Stop | None) -> zenoh.Session:
    """Try until it opens; a refused login is told at once, who isn't there yet is waited for."""
    wake = [] if stop is None else [stop.wake_fd]
    deadline = time.monotonic() + timeout_s
    pause_s = _FIRST_RETRY_S
    while True:
        left_s = min(max(deadline - time.monotonic(), _FIRST_RETRY_S), _ATTEMPT_S)
        with few_threads(ONE_THREAD):
            session = open_bounded(_login_config("client", network, left_s), left_s + 1.0)
        if not isinstance(session, str):
            return session
        reason = _reason(network)
        if reason.final or time.monotonic() + pause_s > deadline:
            within = "" if reason.final else f" within {timeout_s:g} s"
            raise InfrastructureError(
                f"{network.user}: no session with the router at {network.endpoint}{within}:"
                f" {reason.text}"
            )
        if readable(wake, pause_s):
            raise StoppedError
        pause_s = min(1.5 * pause_s, _LAST_RETRY_S)


def _reason(network: NetworkLink) -> Obstacle:
    """Why there is no session: Zenoh tells it peers only."""
    config = _login_config("peer", network, _PROBE_S)
    set_key(config, "listen/endpoints", [])
    set_key(config, "connect/exit_on_failure", True)
    said = open_bounded(config, _PROBE_S + 1.0)
    if isinstance(said, str):
        return obstacle(said, network.user)
    said.close()
    return obstacle("", network.user)


def _login_config(mode: str, network: NetworkLink, timeout_s: float) -> zenoh.Config:
    """For a single attempt."""
    config = settings(mode, network.lease_s)
    # A put that finds the router stopped waits for as long as the router may.
    set_key(config, _WAIT_BEFORE_CLOSE, int(max(network.lease_s, _BLOCKED_S) * 1e6))
    set_key(config, "connect/endpoints", [network.endpoint])
    set_key(config, "connect/timeout_ms", 0)
    set_key(config, "transport/unicast/open_timeout", max(int(timeout_s * 1000), 1))
    set_key(config, "transport/auth/usrpwd/user", network.user)
    set_key(config, "transport/auth/usrpwd/password", network.password)
    if network.tls is not None:
        set_key(config, "transport/link/tls", mutual_tls(network.tls, "connect"))
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
        config = settings("router", lease_s)
        set_key(config, "listen/endpoints", [at, *([hasty(outside.endpoint)] if outside else [])])
        if outside is not None and outside.tls is not None:
            set_key(config, "transport/link/tls", mutual_tls(outside.tls, "listen"))
        accept_many(config, len(access.rights))
        set_key(config, "transport/auth/usrpwd/dictionary_file", str(dictionary))
        config.insert_json5("access_control", access.access_control())
        config.insert_json5("low_pass_filter", access.low_pass_filter())
        config.insert_json5("downsampling", access.downsampling())
        set_key(config, _WAIT_BEFORE_CLOSE, int(unread_s * 1e6))
        with few_threads(ROUTER_THREADS):
            session = open_bounded(config, _LISTEN_S)
        if not isinstance(session, str):
            await_first_words([at, *([outside.endpoint] if outside else [])])
            return session, at
        reason = taken(session)
    where = " and ".join(
        [endpoint or "any loopback port", *([outside.endpoint] if outside is not None else [])]
    )
    raise InfrastructureError(f"can't listen at {where}: {reason}")
