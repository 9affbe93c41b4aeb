"""A link: how a process talks to the others, whatever carries it.

Promises of every link: a message put on a key reaches every link that subscribes to it once, in the
order of its publisher, and never the link that put it; nothing is lost while both live; `receive`
waits a bounded time and wakes at once. `bridge.zenoh_link` carries it over Zenoh.
"""

from queue import Empty, SimpleQueue
from types import TracebackType
from typing import NamedTuple, Protocol, Self


class Arrival(NamedTuple):
    """One message: the subscriber's own tag, the key it was put on, its bytes."""

    tag: str
    key: str
    payload: bytes


class Publisher(Protocol):
    """The right to put messages on one key."""

    def put(self, payload: bytes) -> None:
        """Put one message."""


class Link(Protocol):
    """One process's connection to the others."""

    def publisher(self, key: str, *, express: bool = True) -> Publisher:
        """A publisher on `key`; not express, its messages may travel with others a little later."""

    def subscribe(self, key: str, tag: str) -> None:
        """Queue what is put on `key`, marked with `tag`."""

    def receive(self, timeout_s: float) -> Arrival | None:
        """The next message, waiting at most `timeout_s`; 0 polls."""

    def declare_live(self, key: str) -> None:
        """Hold a liveliness token: seen by who watches, gone with this link."""

    def watch_live(self, key_expr: str, tag: str) -> None:
        """Queue b"1" for every token that is there or comes, b"0" for every one that goes."""

    def close(self) -> None:
        """End the link; its tokens go. Idempotent."""

    def __enter__(self) -> Self:
        """The link itself."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close."""


class Inbox:
    """Arrivals in order, from whatever thread, with a bounded wait."""

    __slots__ = ("_queue", "put")

    def __init__(self) -> None:
        self._queue: SimpleQueue[Arrival] = SimpleQueue()
        self.put = self._queue.put

    def receive(self, timeout_s: float) -> Arrival | None:
        """The next arrival, waiting at most `timeout_s`; 0 polls."""
        try:
            if timeout_s <= 0.0:
                return self._queue.get_nowait()
            return self._queue.get(timeout=timeout_s)
        except Empty:
            return None
