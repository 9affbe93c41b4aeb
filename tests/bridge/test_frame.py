"""Frames as values, and their bytes."""

import struct

from hypothesis import given
from hypothesis import strategies as st
from librt.strings import BytesWriter

from bridge.frame import Frame, write_frame

identifiers = st.integers(0, 2**32 - 1)
contents = st.binary(max_size=8)
pairs = st.tuples(identifiers, contents)


@given(pairs, pairs)
def test_frames_are_equal_and_ordered_as_their_identifiers_and_data(
    one: tuple[int, bytes], other: tuple[int, bytes]
) -> None:
    assert (Frame(*one) == Frame(*other)) == (one == other)
    assert (Frame(*one) < Frame(*other)) == (one < other)


@given(st.lists(pairs))
def test_frames_are_sorted_in_the_order_of_arbitration(made: list[tuple[int, bytes]]) -> None:
    frames = sorted(Frame(*pair) for pair in made)
    assert [(frame.can_id, frame.data) for frame in frames] == sorted(made)


@given(identifiers, contents)
def test_equal_frames_are_one_key_and_a_frame_is_nothing_else(can_id: int, data: bytes) -> None:
    frame = Frame(can_id, data)
    assert {frame: 1}[Frame(can_id, bytes(data))] == 1
    assert frame != (can_id, data)


def test_a_frame_shows_its_identifier_and_data() -> None:
    assert repr(Frame(0x29, b"ab")) == "Frame(0x29, b'ab')"


@given(st.lists(st.tuples(identifiers, contents, st.integers(0, 255)), max_size=5))
def test_a_frame_has_the_bytes_of_linux_can_frame_and_its_flags(
    written: list[tuple[int, bytes, int]],
) -> None:
    out = BytesWriter()
    for can_id, data, flags in written:
        write_frame(out, Frame(can_id, data), flags)
    packed = [struct.pack("<IBB2x8s", i, len(data), flags, data) for i, data, flags in written]
    assert out.getvalue() == b"".join(packed)
