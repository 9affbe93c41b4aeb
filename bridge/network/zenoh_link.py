"""Zenoh links: one Zenoh session as a `bridge.network.link.Link`.

Messages are reliable, blocking, express and of real-time priority: none is dropped, none waits for
a batch. Subscribers run on Zenoh's network thread and only queue. A session that is not closed can
keep its process from ending, so every link is closed in a `with`; session objects are kept until
the process ends (`bridge.network.session.keep`). `client` opens links to a router, `router` is one.
"""

import os
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Any, ClassVar, Final, Self

import zenoh
from mypy_extensions import mypyc_attr
from zenoh.handlers import Callback, RingChannel

from bridge.network.link import ROOM_BYTES, Arrival, Dropped, Inbox, Publisher
from bridge.network.session import keep
from bridge.process.clock import SYSTEM_CLOCK, Clock

CLOSE_S: Final = 1.0
POLLED_DEPTH: Final = 1 << 15
"""Newest messages kept on a key of a polled link: many times more than any schedule lets be under
way (`configs.brief.LEAD_TICKS`), so that a flood doesn't displace due messages."""
_YIELDS: Final = 20
_PAUSE_S: Final = 50e-6
_LONGEST_PAUSE_S: Final = 2e-3
_PAUSE_SHARE: Final = 0.05
"""Between two looks; where nothing has come for long, up to this part of that time: a fleet that
waits for its last robots leaves them the processor."""


class _SteadyPublisher:
    """Puts undeclared: a declared publisher sends nothing while it knows of no subscriber."""

    def __init__(self, session: zenoh.Session, key: str, *, express: bool) -> None:
        self._session = session
        self._key = zenoh.KeyExpr(key)
        self._express = express

    def put(self, payload: bytes) -> None:
        """Put one message."""
        self._session.put(
            self._key,
            payload,
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.REAL_TIME,
            express=self._express,
            allowed_destination=zenoh.Locality.REMOTE,
        )


def heard(publisher: Publisher) -> bool:
    """Whether somebody subscribes to what a publisher puts, as far as its session knows."""
    if not isinstance(publisher, zenoh.Publisher):
        return True
    status: object = publisher.matching_status  # typed as a bool, but has one
    return bool(getattr(status, "matching", status))


@mypyc_attr(allow_interpreted_subclasses=True)
class ZenohLink:
    """One Zenoh session as a `bridge.network.link.Link`."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._inbox = Inbox()
        self._declared: list[object] = []
        self._subscribers: dict[str, zenoh.Subscriber[Any]] = {}  # by key
        self._tokens: dict[str, zenoh.LivelinessToken] = {}
        self.receive: Callable[[float], Arrival | None] = self._inbox.receive

    def publisher(self, key: str, *, express: bool = True, steady: bool = False) -> Publisher:
        """A publisher on `key`; a put blocks rather than drops."""
        if steady:
            return _SteadyPublisher(self._session, key, express=express)
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

        def on_sample(sample: zenoh.Sample) -> None:
            payload = sample.payload
            put(str(sample.key_expr), payload.to_bytes, len(payload))

        self._subscribers[key] = self._session.declare_subscriber(
            key, Callback(on_sample, indirect=False), allowed_origin=zenoh.Locality.REMOTE
        )

    def unsubscribe(self, key: str) -> None:
        """End the subscription to `key`; messages of it that wait already still arrive."""
        self._subscribers.pop(key).undeclare()

    def each(self, key: str, act: Callable[[bytes], None]) -> None:
        """Call `act`, on the network's thread, with what others put on `key`.

        `act` must not put: a put may wait for room, and the thread that would make it may be this
        one; then the session is lost.
        """
        self.each_keyed(key, lambda _, payload: act(payload))

    def each_keyed(self, key_expr: str, act: Callable[[str, bytes], None]) -> None:
        """Call `act`, on the network's thread, with key and payload of what others put."""

        def on_sample(sample: zenoh.Sample) -> None:
            act(str(sample.key_expr), sample.payload.to_bytes())

        self._declared.append(
            self._session.declare_subscriber(
                key_expr, Callback(on_sample, indirect=False), allowed_origin=zenoh.Locality.REMOTE
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

        def on_token(_: str, alive: bool) -> None:
            if not alive:
                act()

        self.each_live(key, on_token)

    def each_live(self, key_expr: str, act: Callable[[str, bool], None]) -> None:
        """Call `act`, on the network's thread, with every token that is there, comes or goes."""

        def on_sample(sample: zenoh.Sample) -> None:
            act(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        self._declared.append(
            self._session.liveliness().declare_subscriber(
                key_expr, Callback(on_sample, indirect=False), history=True
            )
        )

    def watch_live(self, key_expr: str, tag: str) -> None:
        """Queue b"1" for every token that is there or comes, b"0" for every one that goes."""
        put = self._inbox.put_latest
        self.each_live(key_expr, lambda key, alive: put(Arrival(tag, key, b"1" if alive else b"0")))

    def dropped(self) -> list[Dropped]:
        """The subscriptions that lost messages because their buffer was full."""
        return self._inbox.dropped()

    stuck: ClassVar[bool] = False
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
                keep(self._subscribers)
                keep(self._tokens)
                return
        self._declared.clear()
        self._subscribers.clear()
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
    """A link that is polled at given times: an arriving message wakes no thread and runs no Python.

    `receive` looks at all subscribers in turn. Waiting is looking again: a few times giving way to
    others, then with pauses that grow until a message comes.
    """

    def __init__(self, session: zenoh.Session, depth: int, *, clock: Clock = SYSTEM_CLOCK) -> None:
        super().__init__(session)
        self._depth, self._clock = depth, clock
        self._polled: list[tuple[str, str, Callable[[], zenoh.Sample | None]]] = []
        self._looks, self._pause_s = 0, _PAUSE_S  # since the last message that was waited for
        self._idle_since_s = 0.0
        self.receive = self._receive

    def subscribe(self, key: str, tag: str, *, room_bytes: int = ROOM_BYTES) -> None:  # noqa: ARG002
        """Keep the last that others put on `key`, marked with `tag`.

        Never more, whatever their size: of what arrives here the router bounds that.
        """
        subscriber = self._session.declare_subscriber(
            key, RingChannel(self._depth), allowed_origin=zenoh.Locality.REMOTE
        )
        self._subscribers[key] = subscriber
        self._polled.append((tag, key, subscriber.try_recv))

    def unsubscribe(self, key: str) -> None:
        """End the subscription to `key`; messages of it that wait already are dropped."""
        self._polled = [polled for polled in self._polled if polled[1] != key]
        super().unsubscribe(key)

    def _receive(self, timeout_s: float) -> Arrival | None:
        if (arrival := self._look()) is not None or timeout_s <= 0.0:
            if arrival is not None:
                self._looks = 0
            return arrival
        clock = self._clock
        now_s = clock.monotonic_s()
        deadline = now_s + timeout_s
        if not self._looks:
            self._pause_s, self._idle_since_s = _PAUSE_S, now_s
        while (left_s := deadline - now_s) > 0.0:
            if self._looks < _YIELDS:
                os.sched_yield()
            else:
                clock.sleep(min(self._pause_s, left_s))
                longest_s = max(_LONGEST_PAUSE_S, _PAUSE_SHARE * (now_s - self._idle_since_s))
                self._pause_s = min(1.5 * self._pause_s, longest_s)
            self._looks += 1
            if (arrival := self._look()) is not None:
                self._looks = 0
                return arrival
            now_s = clock.monotonic_s()
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
