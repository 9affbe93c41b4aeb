"""The counters of ISO 11898-1, event by event."""

from hypothesis import given
from hypothesis import strategies as st

from bridge.wire.confinement import Confinement, NodeState


def after(*, failed: int = 0, sent: int = 0) -> Confinement:
    node = Confinement()
    for _ in range(failed):
        node.send_failed()
    for _ in range(sent):
        node.sent()
    return node


def test_a_sender_warns_after_12_failures_is_passive_after_16_and_off_after_32() -> None:
    states = [after(failed=n).state for n in range(33)]
    assert states.index(NodeState.ERROR_WARNING) == 12
    assert states.index(NodeState.ERROR_PASSIVE) == 16
    assert states.index(NodeState.BUS_OFF) == 32


def test_eight_frames_sent_make_up_for_one_that_failed() -> None:
    assert after(failed=1, sent=8).tec == 0
    assert after(failed=1, sent=20).tec == 0
    assert after(failed=16, sent=1).state is NodeState.ERROR_WARNING


def test_without_acknowledgement_a_node_ends_passive_and_never_off() -> None:
    node = Confinement()
    for _ in range(1000):
        node.not_acknowledged()
    assert (node.tec, node.state) == (128, NodeState.ERROR_PASSIVE)


def test_a_receiver_that_always_complains_first_is_passive_after_15_frames() -> None:
    node = Confinement()
    frames = 0
    while node.state is not NodeState.ERROR_PASSIVE:
        node.receive_failed(first=True)
        frames += 1
    assert frames == 15


def test_one_good_frame_makes_a_passive_receiver_active_again() -> None:
    node = Confinement()
    for _ in range(300):
        node.receive_failed()
    assert node.state is NodeState.ERROR_PASSIVE
    node.received()
    assert 119 <= node.rec <= 127


@given(st.lists(st.integers(0, 4)))
def test_counters_stay_positive_and_receiving_takes_nobody_off(
    events: list[int],
) -> None:
    node = Confinement()
    for event in events:
        match event:
            case 0:
                node.sent()
            case 1:
                node.received()
            case 2:
                node.receive_failed()
            case 3:
                node.receive_failed(first=True)
            case _:
                node.not_acknowledged()
        assert min(node.tec, node.rec) >= 0
        assert node.state is not NodeState.BUS_OFF


def test_a_restarted_node_starts_from_nothing() -> None:
    node = after(failed=40)
    node.restart()
    assert (node.tec, node.rec, node.state) == (0, 0, NodeState.ERROR_ACTIVE)
