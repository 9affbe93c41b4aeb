"""A process answers the launcher's question for the time."""

import threading
from collections.abc import Callable
from queue import SimpleQueue

from support.clocks import ManualClock

from bridge.network import keys
from bridge.network.clock_exchange import answer_pings
from bridge.network.messages import ClockPing, ClockPong


class Line:
    """What is said on a link, and by which thread."""

    def __init__(self) -> None:
        self.said: SimpleQueue[tuple[int, bytes]] = SimpleQueue()
        self.hear: Callable[[bytes], None] = lambda _: None

    def publisher(self, key: str) -> "Line":
        assert key == keys.pong("lab", "agent/r1")
        return self

    def put(self, payload: bytes) -> None:
        self.said.put((threading.get_ident(), payload))

    def each(self, key: str, act: Callable[[bytes], None]) -> None:
        assert key == keys.ping("lab")
        self.hear = act


def test_the_networks_thread_dates_a_question_and_never_puts_the_answer() -> None:
    line = Line()
    answer_pings(line, "lab", "agent/r1", ManualClock(7000))
    line.hear(b"\xc1")
    line.hear(ClockPing(5000).encode())
    thread, payload = line.said.get(timeout=10.0)
    assert ClockPong.decode(payload) == ClockPong(5000, 7000, 7000)
    assert thread != threading.get_ident()  # a put that waits there would wait for itself
