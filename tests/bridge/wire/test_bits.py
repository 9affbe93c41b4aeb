"""Frame lengths against documented figures, and against a bit-by-bit reading of the standard."""

import itertools
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.frame import EFF, ERR, RTR, Frame
from bridge.wire import bits

identifiers = st.one_of(
    st.integers(0, 0x7FF),
    st.integers(0, 0x7FF).map(lambda n: n | RTR),
    st.integers(0, 0x1FFF_FFFF).map(lambda n: n | EFF),
    st.integers(0, 0x1FFF_FFFF).map(lambda n: n | EFF | RTR),
)
frames = st.builds(Frame, identifiers, st.binary(max_size=8))


def destuffed(wire: str) -> str:
    """What a receiver keeps: the bit after five equal ones is a stuff bit, and must differ."""
    kept, last, run, skip = [], "1", 0, False
    for bit in wire:
        run = run + 1 if bit == last else 1
        last = bit
        if skip:
            assert run == 1, "six equal bits"
            skip = False
            continue
        kept.append(bit)
        skip = run == 5
    return "".join(kept)


def remainder(text: str) -> int:
    """Of the division by x¹⁵ + x¹⁴ + x¹⁰ + x⁸ + x⁷ + x⁴ + x³ + 1, as long division."""
    divisor = 1 << 15 | 1 << 14 | 1 << 10 | 1 << 8 | 1 << 7 | 1 << 4 | 1 << 3 | 1
    value = int(text, 2)
    for shift in range(len(text) - 16, -1, -1):
        if value >> shift + 15 & 1:
            value ^= divisor << shift
    return value


@pytest.mark.parametrize(
    ("length", "least", "most"), [(0, 47, 55), (4, 79, 95), (5, 87, 105), (8, 111, 135)]
)
def test_an_11_bit_frame_is_as_long_as_the_literature_says(
    length: int, least: int, most: int
) -> None:
    assert bits.least_bits(length) == least
    assert bits.most_bits(length) == most


def test_a_29_bit_frame_of_8_bytes_has_131_to_160_bits() -> None:
    assert bits.least_bits(8, extended=True) == 131
    assert bits.most_bits(8, extended=True) == 160


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        (Frame(0x080, b""), 51),  # CANopen SYNC
        (Frame(0x009, bytes(8)), 125),  # encoder at a standstill
        (Frame(0x001, bytes.fromhex("0000000008000000")), 125),  # heartbeat in closed loop
    ],
)
def test_known_frames_have_their_known_lengths(frame: Frame, expected: int) -> None:
    assert bits.frame_bits(frame) == expected


def test_frames_of_a_moving_robot_are_as_long_as_was_measured() -> None:
    encoder = [
        bits.frame_bits(Frame(0x009, struct.pack("<ff", 0.01 * k, 2.4 + 0.003 * k)))
        for k in range(1000)
    ]
    torque = [
        bits.frame_bits(Frame(0x00E, struct.pack("<f", 0.0002 * k - 0.1))) for k in range(1000)
    ]
    assert sum(encoder) / 1000 == pytest.approx(116, abs=1)
    assert sum(torque) / 1000 == pytest.approx(83, abs=1)


@given(frames)
def test_a_frame_is_within_the_bounds(frame: Frame) -> None:
    length = 0 if frame.can_id & RTR else len(frame.data)
    extended = bool(frame.can_id & EFF)
    counted = bits.frame_bits(frame)
    assert bits.least_bits(length, extended=extended) <= counted
    assert counted <= bits.most_bits(length, extended=extended)


@given(frames)
def test_what_is_counted_is_what_is_on_the_wire(frame: Frame) -> None:
    assert bits.frame_bits(frame) == len(bits.stuffed_bits(frame)) + 1 + 1 + 1 + 7 + 3


@given(frames)
def test_a_receiver_finds_identifier_length_data_and_a_valid_crc(frame: Frame) -> None:
    wire = destuffed(bits.stuffed_bits(frame))
    assert remainder(wire) == 0
    remote = "1" if frame.can_id & RTR else "0"
    if frame.can_id & EFF:
        identifier = f"{frame.can_id & 0x1FFF_FFFF:029b}"
        head = f"0{identifier[:11]}11{identifier[11:]}{remote}00"
    else:
        head = f"0{frame.can_id & 0x7FF:011b}{remote}00"
    data = b"" if frame.can_id & RTR else frame.data
    content = f"{head}{len(frame.data):04b}" + "".join(f"{byte:08b}" for byte in data)
    assert wire[:-15] == content


@given(identifiers, identifiers)
def test_the_key_decides_as_the_wire_does_bit_by_bit(one: int, other: int) -> None:
    first, second = (bits.stuffed_bits(Frame(can_id, b"")) for can_id in (one, other))
    by_key = bits.arbitration_key(one) < bits.arbitration_key(other)
    if one == other:
        assert bits.arbitration_key(one) == bits.arbitration_key(other)
        return
    # Dominant wins: of two that are alike so far, the one that sends 0 where the other sends 1.
    assert by_key is (first < second)


@pytest.mark.parametrize(
    ("winner", "loser"),
    [
        (0x009, 0x00E),
        (0x123, 0x123 | RTR),
        (0x123, 0x123 << 18 | EFF),
        (0x123 | RTR, 0x123 << 18 | EFF),
        (0x122 << 18 | EFF, 0x123),
        (0x1234567 | EFF, 0x1234567 | EFF | RTR),
    ],
)
def test_data_beats_remote_and_11_bits_beat_29_of_the_same_base(winner: int, loser: int) -> None:
    assert bits.arbitration_key(winner) < bits.arbitration_key(loser)


def test_the_data_of_a_remote_frame_are_not_on_the_wire() -> None:
    lengths = {bits.frame_bits(Frame(0x009 | RTR, bytes(n))) for n in range(9)}
    assert max(lengths) <= bits.most_bits(0)


@pytest.mark.parametrize(
    ("frame", "says"),
    [(Frame(0x00E, bytes(12)), "12 bytes"), (Frame(ERR | 4, bytes(8)), "error frame")],
)
def test_what_no_classic_frame_can_be_is_refused_by_name(frame: Frame, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        bits.frame_bits(frame)


def test_two_frames_that_differ_have_different_bits() -> None:
    wires = [bits.stuffed_bits(Frame(0x009, bytes([n, 0]))) for n in range(16)]
    assert all(a != b for a, b in itertools.combinations(wires, 2))
