"""The window of a line: nobody runs ahead of what was given, and nobody waits for ever."""

from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.can_bus.flow_control import INITIAL_CREDIT_BYTES, LEAST_BYTES, Receiver, Sender, cost
from bridge.can_bus.packet import BYE, FRAMES, MAX_BYTES, encode_frames, encode_text
from bridge.frame import Frame

PACKETS = st.integers(1, MAX_BYTES).map(bytes)
ONE_FRAME = encode_frames(0, 0, (Frame(1, b"12345678"),))


def test_a_window_of_single_frames_is_a_few_hundred() -> None:
    sender, sent = Sender(), 0
    while sender.has_credit():
        sender.spend(ONE_FRAME)
        sent += 1
    assert sent == INITIAL_CREDIT_BYTES // LEAST_BYTES == 512


@given(st.lists(PACKETS, max_size=200), st.randoms(use_true_random=False))
def test_all_packets_get_through_in_bounded_room_whatever_the_receivers_pace(
    packets: list[bytes], random
) -> None:
    sender, receiver = Sender(), Receiver()
    unsent, held, rooms, taken = list(packets), [], [], 0
    while taken < len(packets):
        moves = [m for m, able in enumerate((unsent and sender.has_credit(), held, rooms)) if able]
        assert moves, "everybody waits"
        match random.choice(moves):
            case 0:
                packet = unsent.pop(0)
                sender.spend(packet)
                assert receiver.arrive(packet)
                held.append(packet)
            case 1:
                taken += 1
                if (credit := receiver.consume(held.pop(0))) is not None:
                    rooms.append(credit)
            case 2:
                assert sender.grant(rooms.pop(0))
        assert sum(map(cost, held)) <= INITIAL_CREDIT_BYTES + MAX_BYTES


@pytest.mark.parametrize("way_s", [0.001, 0.01, 0.013])
def test_the_window_is_wide_enough_for_a_full_bus_at_the_far_end_of_a_slow_way(
    way_s: float,
) -> None:
    # 1 Mbit/s carries a frame of 4 bytes in 79 bit times at least.
    period_s, frame = 79e-6, encode_frames(0, 0, (Frame(1, b"1234"),))
    sender, receiver = Sender(), Receiver()
    on_the_way: deque[tuple[float, bytes]] = deque()
    for n in range(20_000):
        now_s = n * period_s
        while on_the_way and on_the_way[0][0] <= now_s:
            assert sender.grant(on_the_way.popleft()[1])
        assert sender.has_credit(), n
        sender.spend(frame)
        assert receiver.arrive(frame)
        if (credit := receiver.consume(frame)) is not None:
            on_the_way.append((now_s + 2.0 * way_s, credit))


def test_who_runs_ahead_is_found_out() -> None:
    receiver = Receiver()
    assert not all(receiver.arrive(ONE_FRAME) for _ in range(1000))


def test_room_that_was_never_taken_is_not_given() -> None:
    sender = Sender()
    for _ in range(512):
        sender.spend(ONE_FRAME)
    assert sender.grant(b"\x40" + bytes(7) + b"\xff" * 8)  # claims to have taken all there ever is
    for _ in range(512):
        assert sender.has_credit()
        sender.spend(ONE_FRAME)
    assert not sender.has_credit()


def test_packets_of_the_bus_are_no_room_packets() -> None:
    assert not any(Sender().grant(p) for p in (ONE_FRAME, encode_text(BYE), bytes((FRAMES,)), b""))
