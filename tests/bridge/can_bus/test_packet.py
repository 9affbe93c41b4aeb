"""Packets between hub and clients."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.can_bus.packet import (
    BYE,
    FRAMES,
    HELLO,
    LOST,
    MORE,
    REFUSED,
    WELCOME,
    Stamped,
    decode,
    encode_frames,
    encode_lost,
    encode_stamped,
    encode_text,
    frames_in,
    split,
)
from bridge.frame import EFF, ERR, ID_MASK_11, ID_MASK_29, RTR, Frame

identifiers = st.one_of(
    st.integers(0, ID_MASK_11),
    st.integers(0, ID_MASK_29).map(EFF.__or__),
    st.integers(0, ID_MASK_29).map(ERR.__or__),
)
frames = st.builds(Frame, identifiers, st.binary(max_size=8)) | st.builds(
    Frame, st.integers(0, ID_MASK_11).map(RTR.__or__), st.integers(0, 8).map(bytes)
)
stamps = st.integers(-(2**63), 2**63 - 1)


@given(st.integers(0, 7), stamps, st.lists(frames, max_size=20))
def test_frames_survive_a_packet_in_order(flags: int, stamp: int, sent: list[Frame]) -> None:
    packet = decode(encode_frames(flags, stamp, sent))
    assert packet is not None
    assert (packet.kind, packet.flags, packet.stamp_ns) == (FRAMES, flags, stamp)
    assert list(packet.frames) == sent


@given(
    st.integers(0, 7),
    st.integers(0, 2**62),
    st.lists(st.tuples(st.integers(0, 2**32 - 1), frames), max_size=20),
    st.integers(0, 2**32 - 1),
)
def test_frames_that_ended_at_different_times_keep_their_times(
    flags: int, stamp: int, sent: list[tuple[int, Frame]], credit: int
) -> None:
    stamped = [Stamped(stamp - before, frame) for before, frame in sent]
    packet = decode(encode_stamped(flags, stamp, stamped, credit))
    assert packet is not None
    assert (packet.stamp_ns, packet.credit) == (stamp, credit)
    assert list(packet.frames) == [frame for _, frame in sent]
    assert list(packet.before_ns) == [before for before, _ in sent]


@given(st.sampled_from([HELLO, WELCOME, REFUSED, BYE]), st.text(max_size=50))
def test_texts_survive_a_packet(kind: int, text: str) -> None:
    packet = decode(encode_text(kind, text, flags=3, count=1, stamp_ns=9))
    assert packet is not None
    assert (packet.kind, packet.flags, packet.number) == (kind, 3, 1)
    assert (packet.stamp_ns, packet.frames, packet.text) == (9, (), text)


@given(st.binary(max_size=120))
def test_no_bytes_raise(data: bytes) -> None:
    decode(data)


@given(stamps, st.lists(frames, min_size=1, max_size=3), st.data())
def test_a_cut_packet_is_none(stamp: int, sent: list[Frame], data) -> None:
    packet = encode_frames(0, stamp, sent)
    assert decode(packet[: data.draw(st.integers(0, len(packet) - 1))]) is None


def test_a_frame_has_the_layout_of_linux_can_frame() -> None:
    packet = encode_frames(0, 5, [Frame(0x123, b"\1\2\3"), Frame(1, b""), Frame(2, b"x")])
    assert packet[16:32] == struct.pack("=IB3x8s", 0x123, 3, b"\1\2\3")


@pytest.mark.parametrize(
    ("can_id", "length"),
    [(0x123, 9), (0x123, 255), (0x800, 1), (0x802, 4), (RTR | 0x800, 0), (ERR | RTR, 8), (EFF, 9)],
)
@pytest.mark.parametrize("place", [0, 1, 2])
def test_what_is_no_classic_frame_is_left_out_and_takes_no_neighbour_with_it(
    can_id: int, length: int, place: int
) -> None:
    good = [Frame(1, b"a"), Frame(2, b"bc")]
    for count in (0, 1, 2):
        neighbours = good[:count]
        packet = bytearray(encode_frames(0, 5, neighbours))
        at = 16 + 16 * min(place, count)
        packet[at:at] = struct.pack("<IB3x8s", can_id, length, b"12345678")
        packet[2] = count + 1
        decoded = decode(bytes(packet))
        assert decoded is not None
        assert (list(decoded.frames), decoded.flawed) == (neighbours, 1)


def test_what_is_left_out_takes_its_time_with_it() -> None:
    sent = [Stamped(10, Frame(1, b"")), Stamped(20, Frame(0x800, b"")), Stamped(30, Frame(2, b""))]
    packet = decode(encode_stamped(0, 50, sent, 0))
    assert packet is not None
    assert [frame.can_id for frame in packet.frames] == [1, 2]
    assert packet.before_ns == (40, 20)


def test_a_remote_frame_carries_a_length_and_no_data() -> None:
    packet = decode(encode_frames(0, 5, [Frame(RTR | 1, b"abc")]))
    assert packet is not None
    assert packet.frames == (Frame(RTR | 1, bytes(3)),)


@pytest.mark.parametrize("count", [0, 1, 1024, 1025, 2048, 66_000])
def test_any_number_of_frames_travels_in_packets_that_all_decode(count: int) -> None:
    sent = [Stamped(n, Frame(n % 0x800, b"")) for n in range(count)]
    packets = [decode(data) for data in split(0, count, sent, 7)]
    frames = [frame for packet in packets if packet is not None for frame in packet.frames]
    assert frames == [stamped.frame for stamped in sent]
    flags = [packet.flags for packet in packets if packet is not None]
    assert flags == [MORE] * (len(packets) - 1) + [0]


def test_a_loss_survives_a_packet_with_its_count() -> None:
    packet = decode(encode_lost(12_345))
    assert packet is not None
    assert (packet.kind, packet.credit) == (LOST, 12_345)
    assert frames_in(encode_lost(12_345)) == 12_345
    assert frames_in(encode_frames(0, 0, [Frame(1, b"")] * 300)) == 300
