"""Offsets of clocks from exchanges: closed forms, and the bound that always holds."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.clocks import ManualClock

from bridge.network.messages import ClockPing, ClockPong
from fleetloop.launch.clock_offsets import (
    ENOUGH,
    ClockOffsets,
    Exchange,
    Hop,
    Offset,
    offset,
    too_far_apart,
)

MS = 1_000_000
DELAYS = st.lists(
    st.tuples(st.integers(0, 500 * MS), st.integers(0, 500 * MS), st.integers(0, 500 * MS)),
    min_size=1,
    max_size=20,
)
AHEAD = st.integers(-(10**12), 10**12)


def exchanges(ahead_ns: int, delays: list[tuple[int, int, int]]) -> list[Exchange]:
    """With these ways there, times to answer and ways back."""
    made, now = [], 10**18
    for there, answers, back in delays:
        received = now + there + ahead_ns
        answered = received + answers
        made.append(Exchange(now, received, answered, answered - ahead_ns + back))
        now += 10**9
    return made


@given(AHEAD, DELAYS)
def test_the_offset_is_never_wrong_by_more_than_it_says(ahead_ns: int, delays) -> None:
    found = offset(exchanges(ahead_ns, delays))
    assert found is not None
    assert abs(found.ahead_ns - ahead_ns) <= found.uncertain_ns + 1


@given(AHEAD, st.integers(0, 500 * MS), DELAYS)
def test_with_equal_shortest_ways_it_is_exact_however_the_others_are(
    ahead_ns: int, shortest: int, delays
) -> None:
    longer = [(shortest + there, answers, shortest + back) for there, answers, back in delays]
    # The shortest way there and the shortest way back need not be of one exchange.
    mixed = [*longer, (shortest, 3, shortest + 7), (shortest + 5, 3, shortest)]
    assert offset(exchanges(ahead_ns, mixed)) == Offset(ahead_ns, shortest)


def test_a_one_sided_delay_shows_as_half_of_it() -> None:
    assert offset(exchanges(0, [(40 * MS, 0, 0)])) == Offset(20 * MS, 20 * MS)
    assert offset([]) is None


def test_a_hop_costs_v_r_times_the_offset() -> None:
    hops = [Hop("agent/r1", "agent/r2")]

    def far(ahead_ms: float, uncertain_ms: float, tolerance_m: float) -> list[str]:
        offsets = {"agent/r2": Offset(round(ahead_ms * MS), round(uncertain_ms * MS))}
        return too_far_apart(offsets, hops, 0.6, tolerance_m)

    (said,) = far(50.0, 0.0, 0.0299)  # 0.6 m/s · 50 ms = 30 mm
    assert "the clock of r2 is +50 ms (± 0 ms) off that of r1" in said
    assert "at 0.6 m/s it would follow 0.03 m off" in said
    assert not far(50.0, 0.0, 0.0301)
    assert not far(50.0, 1.0, 0.0299)  # may be 49 ms
    assert far(-50.0, 0.0, 0.0299)


def test_offsets_to_the_launcher_that_are_alike_cost_nothing() -> None:
    offsets = {f"agent/r{n}": Offset(10**9, 0) for n in (1, 2)}
    assert not too_far_apart(offsets, [Hop("agent/r1", "agent/r2")], 0.6, 0.001)
    assert too_far_apart(offsets, [Hop("plant", "agent/r2")], 0.6, 0.001)


class Asked:
    """A link on which what is asked can be read."""

    def __init__(self) -> None:
        self.pings: list[ClockPing] = []
        self.keys: list[str] = []

    def publisher(self, key: str) -> "Asked":
        assert key == "fleetloop/lab/@clock/ping"
        return self

    def put(self, payload: bytes) -> None:
        ping = ClockPing.decode(payload)
        assert ping is not None
        self.pings.append(ping)

    def subscribe(self, key: str, tag: str) -> None:
        assert tag == "pong"
        self.keys.append(key)


def test_only_answers_to_questions_of_late_count() -> None:
    clock, link = ManualClock(10**18), Asked()
    clocks = ClockOffsets(["agent/r2"], clock)
    clocks.open(link, "lab")
    assert link.keys == ["fleetloop/lab/@pong/agent/r2"]
    for _ in range(ENOUGH):
        assert not clocks.enough()
        clocks.ask(0.05)
        clocks.ask(0.05)  # not yet time
        sent = link.pings[-1].sent_ns
        clock.passes(0.02)
        answer = ClockPong(sent, sent + 15 * MS, sent + 15 * MS)  # 5 ms ahead
        assert clocks.take("agent/r2", answer.encode())
        assert not clocks.take("agent/r2", answer._replace(sent_ns=sent - 1).encode())
        assert not clocks.take("agent/r3", answer.encode())
        assert not clocks.take("agent/r2", b"\xc1")
        clock.passes(0.05)
    assert clocks.enough()
    assert len(link.pings) == ENOUGH
    assert clocks.offsets() == {"agent/r2": Offset(5 * MS, 10 * MS)}
    assert clocks.account() == {
        "agent/r2": {"ahead_ms": 5.0, "uncertain_ms": 10.0, "drift_ms": 0.0}
    }


def test_without_machines_elsewhere_nobody_is_asked() -> None:
    link = Asked()
    clocks = ClockOffsets([], ManualClock())
    clocks.open(link, "lab")
    clocks.ask(0.05)
    assert clocks.enough()
    assert link.pings == []


@pytest.mark.parametrize("ahead_ms", [-3.0, 0.0, 3.0])
def test_only_the_latest_exchanges_are_looked_at(ahead_ms: float) -> None:
    clock, link = ManualClock(10**18), Asked()
    clocks = ClockOffsets(["plant"], clock)
    clocks.open(link, "lab")
    for ahead in [round(50 * MS)] * 40 + [round(ahead_ms * MS)] * 40:
        clocks.ask(0.01)
        sent = link.pings[-1].sent_ns
        clock.passes(0.02)
        clocks.take(
            "plant", ClockPong(sent, sent + 10 * MS + ahead, sent + 10 * MS + ahead).encode()
        )
    assert clocks.offsets()["plant"].ahead_ns == round(ahead_ms * MS)
