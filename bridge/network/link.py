"""Links between processes: publish, subscribe, liveliness, whatever transport carries them.

Promises of every link: a message put on a key reaches every link that subscribes to it once, in the
order of its publisher, and never the link that put it; nothing is lost while both live; `receive`
waits a bounded time and returns at once on a message. `zenoh_link` implements it over Zenoh.

Memory is bounded: each subscription has a buffer of its own for unread messages, so that a flood on
one key displaces no messages of another. Messages beyond the buffer are dropped and counted.
"""

import threading
from collections.abc import Callable, Iterator
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Final, NamedTuple, Protocol, Self

MOST_AT_ONCE: Final = 10_000
"""Messages taken at a time: draining ends, however fast new messages arrive."""
ROOM_BYTES: Final = 1 << 18
"""Of one subscription, if the subscriber asks for no other."""
MOST_WAITING: Final = 1 << 14
"""Messages of one subscription, however small: many small ones cost time to read."""
_OVERHEAD_BYTES: Final = 256
"""What a message takes besides its payload."""


class Arrival(NamedTuple):
    """One message: the subscriber's own tag, the key it was put on, its bytes."""

    tag: str
    key: str
    payload: bytes


class Dropped(NamedTuple):
    """How many messages of a subscription found no room."""

    tag: str
    key: str
    messages: int


class Publisher(Protocol):
    """The right to put messages on one key."""

    def put(self, payload: bytes) -> None:
        """Put one message."""


class Receiver(Protocol):
    """Where messages arrive."""

    def receive(self, timeout_s: float) -> Arrival | None:
        """The next message, waiting at most `timeout_s`; 0 polls."""


class Link(Receiver, Protocol):
    """One process's connection to the others."""

    def publisher(self, key: str, *, express: bool = True, steady: bool = False) -> Publisher:
        """A publisher on `key`.

        Not express, its messages may travel with others a little later. A steady one also sends
        while nobody subscribes: the first message of a subscription that the router knows is not
        lost because word of it has not come here yet.
        """

    def subscribe(self, key: str, tag: str, *, room_bytes: int = ROOM_BYTES) -> None:
        """Queue what is put on `key`, marked with `tag`, as long as there is room."""

    def unsubscribe(self, key: str) -> None:
        """End the subscription to `key`; it may be subscribed to again."""

    def declare_live(self, key: str) -> None:
        """Hold a liveliness token: seen by its subscribers, withdrawn with this link."""

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


def waiting(link: Receiver, most: int = MOST_AT_ONCE) -> Iterator[Arrival]:
    """What has arrived, without waiting; of a flood no more than `most`: the rest stays."""
    for _ in range(most):
        arrival = link.receive(0.0)
        if arrival is None:
            return
        yield arrival


class Mailbox:
    """The room of one subscription. Filled from whatever thread, emptied by one."""

    __slots__ = ("_admitted", "_given", "_lock", "_released", "_removed", "_room", "dropped")

    def __init__(self, room_bytes: int) -> None:
        self.dropped = 0
        self._room = room_bytes
        self._given = self._released = 0
        self._admitted = self._removed = 0
        self._lock = threading.Lock()

    def admit(self, payload_bytes: int) -> bool:
        """Whether there is room for a message; a single one always finds some."""
        size = payload_bytes + _OVERHEAD_BYTES
        with self._lock:
            held = self._given - self._released
            full = self._admitted - self._removed >= MOST_WAITING
            if full or (held and held + size > self._room):
                self.dropped += 1
                return False
            self._given += size
            self._admitted += 1
        return True

    def release(self, payload_bytes: int) -> None:
        """Give back the room of a message that was received."""
        self._released += payload_bytes + _OVERHEAD_BYTES
        self._removed += 1


class Inbox:
    """Arrivals in order, from whatever thread, with a bounded wait."""

    __slots__ = ("_boxes", "_latest", "_lock", "_queue")

    def __init__(self) -> None:
        self._queue: SimpleQueue[tuple[Arrival, Mailbox | None]] = SimpleQueue()
        self._boxes: list[tuple[str, str, Mailbox]] = []  # tag and key of each
        self._latest: dict[tuple[str, str], bytes] = {}  # by tag and key, of what is queued
        self._lock = threading.Lock()

    def mailbox(
        self, key: str, tag: str, room_bytes: int
    ) -> Callable[[str, Callable[[], bytes], int], None]:
        """How a subscriber puts messages: key, how to get the payload, its length."""
        box = Mailbox(room_bytes)
        self._boxes.append((tag, key, box))
        put = self._queue.put

        def put_arrival(key: str, payload: Callable[[], bytes], size: int) -> None:
            if box.admit(size):
                put((Arrival(tag, key, payload()), box))

        return put_arrival

    def put_latest(self, arrival: Arrival) -> None:
        """Queue a message that replaces one of the same tag and key, if that still waits."""
        tag, key, payload = arrival
        with self._lock:
            waits = (tag, key) in self._latest
            self._latest[tag, key] = payload
        if not waits:
            self._queue.put((arrival, None))

    def dropped(self) -> list[Dropped]:
        """The subscriptions that had no room for all, and how many messages they lost."""
        return [Dropped(tag, key, box.dropped) for tag, key, box in self._boxes if box.dropped]

    def receive(self, timeout_s: float) -> Arrival | None:
        """The next arrival, waiting at most `timeout_s`; 0 polls."""
        try:
            if timeout_s <= 0.0:
                arrival, box = self._queue.get_nowait()
            else:
                arrival, box = self._queue.get(timeout=timeout_s)
        except Empty:
            return None
        if box is not None:
            box.release(len(arrival.payload))
            return arrival
        with self._lock:
            return arrival._replace(payload=self._latest.pop((arrival.tag, arrival.key)))
