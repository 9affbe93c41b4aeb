"""Bus load and response times against the figures of the analysis done by hand."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.wire.bits import most_bits
from bridge.wire.response_time import Message, analyse

US = 1000
MS = 1_000_000


def robots(count: int, period_ns: int) -> list[Message]:
    """Two wheels each, on one bus: heartbeat, encoder, torque (4 bytes)."""
    return [
        Message(node << 5 | command, length, period, mean)
        for node in range(2 * count)
        for command, length, period, mean in (
            (0x01, 8, 100 * MS, 125),
            (0x09, 8, period_ns, 116),
            (0x0E, 4, period_ns, 83),
        )
    ]


@pytest.mark.parametrize(
    ("hz", "bit_rate", "mean", "worst"),
    [
        (100, 1_000_000, 4.2, 4.9),
        (200, 1_000_000, 8.2, 9.5),
        (500, 1_000_000, 20.1, 23.3),
        (1000, 1_000_000, 40.0, 46.3),
        (1000, 500_000, 80.0, 92.5),
    ],
)
def test_load_of_one_robot_is_what_the_table_says(
    hz: int, bit_rate: int, mean: float, worst: float
) -> None:
    found = analyse(robots(1, round(1e9 / hz)), bit_rate)
    assert 100 * found.mean_load == pytest.approx(mean, abs=0.15)
    assert 100 * found.worst_load == pytest.approx(worst, abs=0.15)


@pytest.mark.parametrize(
    ("count", "hz", "bit_rate", "worst_us", "schedulable"),
    [
        (1, 1000, 1_000_000, 730, True),
        (2, 500, 1_000_000, 1460, True),
        (2, 1000, 1_000_000, 3900, False),
        (1, 1000, 500_000, 2900, False),
    ],
)
def test_the_last_torque_comes_as_late_as_the_analysis_says(
    count: int, hz: int, bit_rate: int, worst_us: int, schedulable: bool
) -> None:
    found = analyse(robots(count, round(1e9 / hz)), bit_rate)
    last = found.messages[-1].response_ns
    assert last == pytest.approx(worst_us * US, rel=0.1)
    assert found.schedulable is schedulable


def test_the_first_torque_waits_for_one_blocking_frame_and_two_more_urgent_ones() -> None:
    responses = {m.can_id: m.response_ns for m in analyse(robots(1, MS), 1_000_000).messages}
    assert responses[0x00E] == (135 + 135 + 135 + 95) * US
    assert responses[0x001] == (135 + 135) * US


def test_a_bus_asked_for_more_than_it_has_gives_no_bound_to_who_starves_only() -> None:
    found = analyse(robots(3, MS), 1_000_000)
    assert found.worst_load > 1
    assert not found.schedulable
    assert found.messages[0].response_ns is not None
    assert found.messages[-1].response_ns is None
    assert found.slowest.response_ns is None


def test_the_response_in_a_long_busy_period_is_that_of_its_worst_instance() -> None:
    # The example that refuted the earlier analysis (Davis et al. 2007, table 3): three messages of
    # 125 bits at 125 kbit/s, that is 1 ms each, every 2.5, 3.5 and 3.5 ms. The second instance of
    # the lowest one is the late one: 3.5 ms, where the first takes 3 ms.
    messages = [Message(1, 7, 2_500_000), Message(2, 7, 3_500_000), Message(3, 7, 3_500_000)]
    assert messages[0].worst_bits == most_bits(7) == 125
    found = analyse(messages, 125_000)
    assert [m.response_ns for m in found.messages] == [2 * MS, 3 * MS, 3_500_000]


def test_two_messages_with_one_identifier_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match="0x29"):
        analyse([Message(0x29, 8, MS), Message(0x29, 4, MS)], 1_000_000)


@given(
    st.lists(st.integers(0, 0x7FF), min_size=1, max_size=8, unique=True),
    st.integers(0, 8),
    st.integers(2, 100),
)
def test_no_response_is_shorter_than_the_frame_and_the_more_urgent_never_wait_longer(
    can_ids: list[int], length: int, period_ms: int
) -> None:
    found = analyse([Message(i, length, period_ms * MS) for i in can_ids], 1_000_000)
    responses = [m.response_ns for m in found.messages]
    assert all(r is not None and r >= most_bits(length) * US for r in responses)
    bounds = [r for r in responses if r is not None]
    assert bounds == sorted(bounds)
