"""A process on another machine answers the launcher's question for the time by its wall clock.

At once, on the network's thread: a loop would add the rest of its period to the way there.
"""

from bridge.network import keys
from bridge.network.messages import ClockPing, ClockPong
from bridge.network.zenoh_link import ZenohLink
from bridge.process.clock import SYSTEM_CLOCK, Clock


def answer_pings(link: ZenohLink, run: str, process: str, clock: Clock = SYSTEM_CLOCK) -> None:
    """Answer every question for as long as the link lives."""
    pong = link.publisher(keys.pong(run, process))

    def hear(payload: bytes) -> None:
        received_ns = clock.wall_ns()
        ping = ClockPing.decode(payload)
        if ping is not None:
            pong.put(ClockPong(ping.sent_ns, received_ns, clock.wall_ns()).encode())

    link.each(keys.ping(run), hear)
