"""Start barrier: every link that a run will use carries a message before the run begins.

A process sends a hello on each of its publishers until all processes are ready; it is ready itself
when it has received a hello from every process that it depends on. So no message of the run is the
first on its link, where a declaration still under way could swallow it. Nothing here sleeps: a
process waits for the next hello between two rounds of its own.
"""

from collections.abc import Callable, Iterable

from bridge.network.link import Arrival, Publisher, Receiver, waiting
from bridge.process.awake import LOOK_S, AwakeClock
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import Stop, launcher_stopped
from configs.errors import InfrastructureError

RARER, RAREST = 0.05, 8.0
"""The pause after a round: a part of the time since the first; at most so many of the first's."""


class Hellos:
    """What a process says on its publishers before the run: the same as in it, marked as early.

    Rounds grow rarer, so that a fleet that takes long doesn't spend its time on them.

    Args:
        every_s: from one round to the next at first, however often one is asked for.
    """

    def __init__(self, every_s: float, *, clock: Clock = SYSTEM_CLOCK) -> None:
        self._clock = clock
        self._hellos: list[tuple[Publisher, bytes]] = []
        self._every_s = every_s
        self._next_s = 0.0
        self._began_s = clock.monotonic_s()

    def add(self, publisher: Publisher, payload: bytes) -> None:
        """Say `payload` on `publisher` at every round, the first of which is at once.

        It takes the place of what was said on it before.
        """
        self._hellos = [one for one in self._hellos if one[0] is not publisher]
        self._hellos.append((publisher, payload))
        self._next_s = 0.0

    def say(self) -> float:
        """Say all of them once, if it is time; return how long it is until the next round."""
        now = self._clock.monotonic_s()
        if now >= self._next_s:
            # Never sooner: a hello that answers a hello would be a storm on a ring.
            rarer_s = min(RARER * (now - self._began_s), RAREST * self._every_s)
            self._next_s = now + max(rarer_s, self._every_s)
            for publisher, payload in self._hellos:
                publisher.put(payload)
        return max(self._next_s - self._clock.monotonic_s(), 0.0)


def await_hellos(
    link: Receiver,
    hellos: Hellos,
    deliver: Callable[[Arrival], object],
    missing: Callable[[], Iterable[str]],
    *,
    name: str,
    within_s: float,
    stop: Stop,
    clock: Clock = SYSTEM_CLOCK,
) -> None:
    """Say hello and deliver arrivals until nothing is missing.

    Raises:
        InfrastructureError: something was still missing after `within_s`; the text names it.
    """
    awake = AwakeClock(held=launcher_stopped, clock=clock)
    deadline = awake.now() + within_s
    while absent := tuple(missing()):
        if stop.requested:
            return
        if awake.now() > deadline:
            raise InfrastructureError(
                f"{name}: not ready after {within_s:g} s: heard nothing of {', '.join(absent)}"
            )
        if (arrival := link.receive(min(hellos.say(), LOOK_S))) is not None:
            deliver(arrival)
        for more in waiting(link):
            deliver(more)
