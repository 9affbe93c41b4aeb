"""What a far bus hands back, told from what others say there."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.can_bus.echo import ECHO_S
from bridge.frame import Frame
from fleetloop.can.echo import LEAST, EchoGuard

A, B = Frame(1, b"a"), Frame(2, b"b")


def test_each_frame_is_taken_for_an_echo_once() -> None:
    guard = EchoGuard(echoes=True)
    guard.sent(A, 0.0)
    guard.sent(A, 0.0)
    assert [guard.is_echo(A, 0.1) for _ in range(3)] == [True, True, False]
    assert not guard.is_echo(B, 0.1)


def test_an_interface_that_does_not_echo_loses_nothing() -> None:
    guard = EchoGuard(echoes=False)
    guard.sent(A, 0.0)
    assert not guard.is_echo(A, 0.0)


def test_an_echo_that_never_came_swallows_nothing_later() -> None:
    guard = EchoGuard(echoes=True)
    guard.sent(A, 0.0)
    assert not guard.is_echo(A, ECHO_S + 0.01)
    guard.sent(A, ECHO_S + 0.02)
    assert [guard.is_echo(A, ECHO_S + 0.02) for _ in range(2)] == [True, False]


@given(st.lists(st.tuples(st.booleans(), st.sampled_from([A, B])), max_size=60))
def test_as_many_frames_get_through_as_neighbours_sent(events: list[tuple[bool, Frame]]) -> None:
    # An echoing bus in order: ours come back, a neighbour's (True) come too.
    guard = EchoGuard(echoes=True)
    passed: list[Frame] = []
    for neighbour, frame in events:
        if not neighbour:
            guard.sent(frame, 0.0)
    for _, frame in events:
        if not guard.is_echo(frame, 0.0):
            passed.append(frame)
    said = [frame for neighbour, frame in events if neighbour]
    assert sorted(passed) == sorted(said)


@pytest.mark.parametrize("echoes", [False, True])
def test_frames_that_go_round_are_noticed_whether_or_not_the_interface_echoes(
    echoes: bool,
) -> None:
    guard = EchoGuard(echoes=echoes)
    for k in range(LEAST):
        assert not guard.storm
        frame, now_s = Frame(1, bytes([k])), k / 1000
        guard.sent(frame, now_s)
        assert guard.is_echo(frame, now_s) == echoes
        if echoes:
            assert not guard.is_echo(frame, now_s)  # another gateway's copy
    assert guard.storm


def test_a_round_that_takes_seconds_is_noticed_too() -> None:
    guard = EchoGuard(echoes=False)
    for k in range(4000):
        guard.sent(Frame(1, k.to_bytes(2, "big")), k / 1000)
    for k in range(4000):
        guard.is_echo(Frame(1, k.to_bytes(2, "big")), 4.0 + k / 1000)
    assert guard.storm


def test_traffic_of_both_sides_is_no_storm() -> None:
    guard = EchoGuard(echoes=False)
    for k in range(2000):
        guard.sent(Frame(9, k.to_bytes(8, "little")), k / 1000)
        guard.is_echo(Frame(14, k.to_bytes(4, "little")), k / 1000)
    assert not guard.storm
