"""The start barrier on a clock that stands still but for its waits."""

from itertools import pairwise

import pytest
from support.clocks import ManualClock

from bridge.network.barrier import RARER, RAREST, Hellos, await_hellos
from bridge.network.link import Arrival
from bridge.process.lifecycle import Stop
from configs.errors import InfrastructureError

EVERY_S = 0.02


class Place:
    """A link of which a test knows what arrives, and when [s]: waiting is all that takes time."""

    def __init__(self, clock: ManualClock, arrivals: dict[float, str]) -> None:
        self._clock = clock
        self._arrivals = sorted(arrivals.items())
        self.said_s: list[float] = []

    def put(self, payload: bytes) -> None:  # noqa: ARG002
        self.said_s.append(self._clock.monotonic_s())

    def receive(self, timeout_s: float) -> Arrival | None:
        now_s = self._clock.monotonic_s()
        if self._arrivals and self._arrivals[0][0] <= now_s + timeout_s:
            at_s, tag = self._arrivals.pop(0)
            self._clock.passes(max(at_s - now_s, 0.0))
            return Arrival(tag, "", b"")
        self._clock.passes(max(timeout_s, 1e-9))
        return None


def awaiting(arrivals: dict[float, str], within_s: float) -> tuple[Place, float]:
    """The barrier of a process that depends on a and b: its link, and when it was passed [s]."""
    clock = ManualClock()
    place, missing = Place(clock, arrivals), {"a", "b"}
    hellos = Hellos(EVERY_S, clock=clock)
    hellos.add(place, b"hello")
    await_hellos(
        place,
        hellos,
        lambda arrival: missing.discard(arrival.tag),
        lambda: sorted(missing),
        name="me",
        within_s=within_s,
        stop=Stop(),
        clock=clock,
    )
    return place, clock.monotonic_s()


def test_it_is_passed_with_the_last_hello_awaited_and_says_its_own_until_then() -> None:
    place, passed_s = awaiting({0.05: "a", 0.11: "b"}, 20.0)
    assert passed_s == pytest.approx(0.11)
    assert place.said_s == pytest.approx([0.0, 0.02, 0.04, 0.06, 0.08, 0.10])


def test_of_a_start_that_takes_long_hellos_take_a_bounded_part() -> None:
    place, passed_s = awaiting({0.05: "a", 40.0: "b"}, 60.0)
    assert passed_s == pytest.approx(40.0)
    pauses_s = [after - before for before, after in pairwise(place.said_s)]
    for before_s, pause_s in zip(place.said_s, pauses_s, strict=False):
        rarer_s = max(min(RARER * before_s, RAREST * EVERY_S), EVERY_S)
        assert pause_s == pytest.approx(rarer_s, abs=1e-6)
    assert len(place.said_s) < 300  # of 2000 without


def test_who_is_still_missing_is_named_at_the_bound() -> None:
    with pytest.raises(InfrastructureError, match=r"me: not ready after 2 s: heard nothing of b$"):
        awaiting({1.0: "a", 2.5: "b"}, 2.0)
