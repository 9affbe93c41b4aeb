"""The start barrier: everybody proves every link that it will use, with a message, before the run.

A process says hello on each of its publishers until everybody is ready, and is ready itself when
it has heard a hello from everyone that it will depend on. So no message of the run can be the first
one on its way, which a declaration still travelling could swallow. Nothing here sleeps: the wait
for the next hello is the pause between two of one's own.
"""

import time
from collections.abc import Callable, Iterable

from bridge.link import Arrival, Link, Publisher
from bridge.process import Stop
from configs.errors import InfrastructureError

HELLO_EVERY_S = 0.02


class Hellos:
    """What a process says on its publishers before the run: the same as in it, marked as early."""

    def __init__(self) -> None:
        self._hellos: list[tuple[Publisher, bytes]] = []

    def add(self, publisher: Publisher, payload: bytes) -> None:
        """Say `payload` on `publisher` at every round."""
        self._hellos.append((publisher, payload))

    def say(self) -> None:
        """Say all of them once."""
        for publisher, payload in self._hellos:
            publisher.put(payload)


def await_hellos(
    link: Link,
    hellos: Hellos,
    take: Callable[[Arrival], None],
    missing: Callable[[], Iterable[str]],
    *,
    who: str,
    within_s: float,
    stop: Stop,
) -> None:
    """Say hello and take arrivals until nothing is missing.

    Raises:
        InfrastructureError: something was still missing after `within_s`; the text names it.
    """
    deadline = time.monotonic() + within_s
    next_hello = time.monotonic()
    while absent := tuple(missing()):
        if stop.requested:
            return
        now = time.monotonic()
        if now > deadline:
            raise InfrastructureError(
                f"{who}: not ready after {within_s:g} s: heard nothing of {', '.join(absent)}"
            )
        if now >= next_hello:
            # Never sooner: a hello that answers a hello would be a storm on a ring.
            next_hello = now + HELLO_EVERY_S
            hellos.say()
        arrival = link.receive(max(next_hello - time.monotonic(), 0.0))
        while arrival is not None:
            take(arrival)
            arrival = link.receive(0.0)
