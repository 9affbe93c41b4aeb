"""A bus of any interface in frames: an emulated one below python-can, others by their messages."""

import can
import pytest

from bridge.can_bus.frame_bus import MessageBus, in_frames
from bridge.frame import EFF, ERR, RTR, Frame

FRAMES = [
    Frame(0x009, b"12345678"),
    Frame(0x1ABCDEF | EFF, b""),
    Frame(0x004 | ERR, bytes(8)),
    Frame(0x123 | RTR, b""),
]


@pytest.mark.parametrize("frame", FRAMES)
def test_a_foreign_interface_carries_a_frame_with_its_flags(frame: Frame) -> None:
    options = {"interface": "virtual", "channel": "frames"}
    with can.Bus(**options) as sender, can.Bus(**options) as hearer:
        in_frames(sender).send(frame)
        assert in_frames(hearer).receive_frames(5.0) == (frame,)
        assert in_frames(hearer).receive_frames(0.0) is None


def test_an_emulated_bus_hands_out_the_frames_of_an_instant_together(running, join) -> None:
    bus = in_frames(join(batched=True))
    sent = [Frame(0x009, b"12345678"), Frame(0x029, b"87654321")]
    running.deliver(*sent, stamp_ns=2_500_000)
    assert [*(bus.receive_frames(5.0) or ())] == sent
    assert bus.receive_frames(0.0) is None
    bus.send(Frame(0x00E, b"abcd"))
    assert bus.receive_frames(0.0) is None  # what is batched goes with it
    assert running.taken(1) == [Frame(0x00E, b"abcd")]


def test_filters_of_an_emulated_bus_hold_for_its_frames_too(running, join) -> None:
    bus = in_frames(join(can_filters=[{"can_id": 0x029, "can_mask": 0x7FF}]))
    assert isinstance(bus, MessageBus)
    running.deliver(Frame(0x009, bytes(8)), Frame(0x029, bytes(8)), stamp_ns=1)
    assert bus.receive_frames(5.0) == (Frame(0x029, bytes(8)),)
    assert bus.receive_frames(0.0) is None
