"""Packets between hub and clients."""

import struct

from hypothesis import given
from hypothesis import strategies as st

from bridge.can_bus import packet as wire
from bridge.can_bus.traffic import Stamped
from bridge.frame import Frame

frames = st.builds(Frame, st.integers(0, 2**32 - 1), st.binary(max_size=8))
stamps = st.integers(-(2**63), 2**63 - 1)


@given(st.integers(0, 7), stamps, st.lists(frames, max_size=20))
def test_frames_survive_a_packet_in_order(flags: int, stamp: int, sent: list[Frame]) -> None:
    packet = wire.decode(wire.encode_frames(flags, stamp, sent))
    assert packet is not None
    assert (packet.kind, packet.flags, packet.stamp_ns) == (wire.FRAMES, flags, stamp)
    assert list(packet.frames) == sent


@given(
    st.integers(0, 7),
    st.integers(0, 2**62),
    st.lists(st.tuples(st.integers(0, 2**32 - 1), frames), max_size=20),
    st.integers(0, 2**32 - 1),
)
def test_frames_that_ended_at_different_times_keep_their_times(
    flags: int, stamp: int, sent: list[tuple[int, Frame]], room: int
) -> None:
    stamped = [Stamped(stamp - before, frame) for before, frame in sent]
    packet = wire.decode(wire.encode_stamped(flags, stamp, stamped, room))
    assert packet is not None
    assert (packet.stamp_ns, packet.room) == (stamp, room)
    assert list(packet.frames) == [frame for _, frame in sent]
    assert list(packet.before_ns) == [before for before, _ in sent]


@given(st.sampled_from([wire.HELLO, wire.WELCOME, wire.REFUSED, wire.BYE]), st.text(max_size=50))
def test_texts_survive_a_packet(kind: int, text: str) -> None:
    packet = wire.decode(wire.encode_text(kind, text, flags=3, count=1, stamp_ns=9))
    assert packet == wire.Packet(kind, 3, 1, 9, (), text)


@given(st.binary(max_size=120))
def test_no_bytes_raise(data: bytes) -> None:
    wire.decode(data)


@given(stamps, st.lists(frames, min_size=1, max_size=3), st.data())
def test_a_cut_packet_is_none(stamp: int, sent: list[Frame], data) -> None:
    packet = wire.encode_frames(0, stamp, sent)
    assert wire.decode(packet[: data.draw(st.integers(0, len(packet) - 1))]) is None


def test_a_frame_has_the_layout_of_linux_can_frame() -> None:
    packet = wire.encode_frames(0, 5, [Frame(0x123, b"\1\2\3"), Frame(1, b""), Frame(2, b"x")])
    assert packet[16:32] == struct.pack("=IB3x8s", 0x123, 3, b"\1\2\3")


def test_a_frame_longer_than_eight_bytes_is_none() -> None:
    packet = bytearray(wire.encode_frames(0, 5, [Frame(0x123, b"12345678")]))
    packet[16 + 4] = 9
    assert wire.decode(bytes(packet)) is None
