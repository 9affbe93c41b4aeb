"""Offsets of other machines' wall clocks, from the launcher's exchanges with their processes.

    launcher   sent ─┐              ┌─► returned
    process          └─► received, answered

A clock that is ahead by δ makes the way there look δ longer and the way back δ shorter. Of the
shortest ways seen, half the difference is δ, wrong by half their sum at most, whatever the delays
(as in NTP, RFC 5905, but for minima over the exchanges instead of one of them).

A robot that takes its neighbour's state for δ older than it is follows it v_r δ off: the offset of
a hop costs the formation that distance. A run is refused where it surely is more than its
tolerance.
"""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from bridge.network import keys
from bridge.network.link import Link
from bridge.network.messages import ClockPing, ClockPong
from bridge.process.clock import SYSTEM_CLOCK, Clock
from configs.roles import short_name

KEPT = 32
"""Latest exchanges with one process that are looked at."""
ENOUGH = 8
"""Exchanges with each process before a start."""
START_EVERY_S, EVERY_S = 0.05, 1.0
"""Between two questions, before and after the start."""
WAITED_S = 2.0
"""For so long a start waits for answers once all is ready."""


class Exchange(NamedTuple):
    """Four readings of two wall clocks [ns]."""

    sent_ns: int  # the launcher's
    received_ns: int  # the other's
    answered_ns: int  # the other's
    returned_ns: int  # the launcher's


class Offset(NamedTuple):
    """How far a clock is ahead of the launcher's, and how wrong that may be."""

    ahead_ns: int
    uncertain_ns: int


class Hop(NamedTuple):
    """One process uses what another one dates."""

    sender: str
    receiver: str


HERE = Offset(0, 0)
"""Of processes on the launcher's machine, by definition."""


def offset(exchanges: Iterable[Exchange]) -> Offset | None:
    """The offset that exchanges show, None of none."""
    ways = [(it.received_ns - it.sent_ns, it.returned_ns - it.answered_ns) for it in exchanges]
    if not ways:
        return None
    there, back = min(way[0] for way in ways), min(way[1] for way in ways)
    return Offset((there - back) // 2, max((there + back) // 2, 0))


def too_far_apart(
    offsets: Mapping[str, Offset],
    hops: Iterable[Hop],
    most_speed_m_s: float,
    tolerance_m: float,
) -> list[str]:
    """The hops whose clocks surely displace a robot by more than a tolerance, in words."""
    found = []
    for sender, receiver in hops:
        one, other = offsets.get(sender, HERE), offsets.get(receiver, HERE)
        apart_ns = other.ahead_ns - one.ahead_ns
        uncertain_ns = one.uncertain_ns + other.uncertain_ns
        surely_m = most_speed_m_s * max(abs(apart_ns) - uncertain_ns, 0) * 1e-9
        if surely_m > tolerance_m:
            found.append(
                f"the clock of {short_name(receiver)} is {apart_ns * 1e-6:+.3g} ms"
                f" (± {uncertain_ns * 1e-6:.2g} ms) off that of {short_name(sender)}, which it"
                f" hears: at {most_speed_m_s:g} m/s it would follow"
                f" {most_speed_m_s * abs(apart_ns) * 1e-9:.3g} m off"
            )
    return found


class ClockOffsets:
    """Asks processes on other machines for the time, and keeps what they answered."""

    def __init__(self, processes: Iterable[str], clock: Clock = SYSTEM_CLOCK) -> None:
        self._clock = clock
        self._exchanges: dict[str, deque[Exchange]] = {it: deque(maxlen=KEPT) for it in processes}
        self._asked: deque[int] = deque(maxlen=KEPT)
        self._next_s = 0.0
        self._put: Callable[[bytes], None] = lambda _: None
        self.at_start: dict[str, Offset] = {}

    def open(self, link: Link, run: str) -> None:
        """Ask and hear over a link."""
        if self._exchanges:
            self._put = link.publisher(keys.ping(run)).put
            for process in self._exchanges:
                link.subscribe(keys.pong(run, process), "pong")

    def ask(self, every_s: float) -> None:
        """Ask all for the time, if it is time to."""
        now_s = self._clock.monotonic_s()
        if self._exchanges and now_s >= self._next_s:
            self._next_s = now_s + every_s
            sent_ns = self._clock.wall_ns()
            self._asked.append(sent_ns)
            self._put(ClockPing(sent_ns).encode())

    def take(self, process: str, payload: bytes) -> bool:
        """Keep an answer; return whether it is one to a question of late."""
        returned_ns = self._clock.wall_ns()
        pong = ClockPong.decode(payload)
        known = self._exchanges.get(process)
        if known is None or pong is None or pong.sent_ns not in self._asked:
            return False
        known.append(Exchange(*pong, returned_ns))
        return True

    def enough(self) -> bool:
        """Whether all have answered often enough for a start."""
        return all(len(known) >= ENOUGH for known in self._exchanges.values())

    def offsets(self) -> dict[str, Offset]:
        """The offsets of those that have answered."""
        found = {process: offset(known) for process, known in self._exchanges.items()}
        return {process: it for process, it in found.items() if it is not None}

    def account(self) -> dict[str, dict[str, float]]:
        """The offsets at the start, and how far the clocks drifted since, for the summary."""
        last = self.offsets()
        return {
            process: {
                "ahead_ms": round(it.ahead_ns * 1e-6, 3),
                "uncertain_ms": round(it.uncertain_ns * 1e-6, 3),
                "drift_ms": round((last.get(process, it).ahead_ns - it.ahead_ns) * 1e-6, 3),
            }
            for process, it in (self.at_start or last).items()
        }
