"""Frames that an interface hands back, told from those of others."""

import pytest

from bridge.can_bus.echo import ECHO_S, Echoes, hands_back
from bridge.frame import Frame

A, B = Frame(1, b"a"), Frame(2, b"b")


def test_each_frame_is_taken_for_an_echo_as_often_as_it_was_sent() -> None:
    echoes = Echoes()
    echoes.sent(A, 0.0)
    echoes.sent(A, 0.5)
    assert [echoes.is_echo(A, 1.0) for _ in range(3)] == [True, True, False]
    assert not echoes.is_echo(B, 1.0)


def test_echoes_that_never_came_are_forgotten_and_take_no_room() -> None:
    echoes = Echoes()
    for k in range(1000):
        echoes.sent(Frame(1, k.to_bytes(2, "big")), k * 0.01)
    assert len(echoes._awaited) <= ECHO_S / 0.01 + 2
    assert not echoes.is_echo(Frame(1, bytes(2)), 10.0)


@pytest.mark.parametrize(
    ("settings", "answer"),
    [
        ((("interface", "udp_multicast"),), True),
        ((("interface", "socketcan"), ("receive_own_messages", True)), True),
        ((("interface", "socketcan"), ("receive_own_messages", False)), False),
        ((("channel", "r1"), ("interface", "fleetloop")), False),
    ],
)
def test_what_hands_back_is_known_by_its_settings(settings, answer: bool) -> None:
    assert hands_back(settings) is answer
