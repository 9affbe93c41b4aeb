"""A process on another machine answers the launcher's question for the time by its wall clock.

The question is dated on the network's thread: a loop would add the rest of its period to the way
there. It is answered in a thread of its own: a put may wait for room, which on the network's only
thread nobody would make.
"""

import threading
from queue import SimpleQueue

import zenoh

from bridge.network import keys
from bridge.network.messages import ClockPing, ClockPong
from bridge.network.zenoh_link import ZenohLink
from bridge.process.clock import SYSTEM_CLOCK, Clock


def answer_pings(link: ZenohLink, run: str, process: str, clock: Clock = SYSTEM_CLOCK) -> None:
    """Answer every question for as long as the link lives."""
    pong = link.publisher(keys.pong(run, process))
    asked: SimpleQueue[tuple[int, int]] = SimpleQueue()

    def hear(payload: bytes) -> None:
        received_ns = clock.wall_ns()
        if (ping := ClockPing.decode(payload)) is not None:
            asked.put((ping.sent_ns, received_ns))

    def answer() -> None:
        while True:
            sent_ns, received_ns = asked.get()
            try:
                pong.put(ClockPong(sent_ns, received_ns, clock.wall_ns()).encode())
            except zenoh.ZError:  # the link is closed
                return

    link.each(keys.ping(run), hear)
    threading.Thread(target=answer, daemon=True).start()
