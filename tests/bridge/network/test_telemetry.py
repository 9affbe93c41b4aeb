"""Rows and blocks of telemetry."""

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.controller_rows import SIGNALS

from bridge.frame import Frame
from bridge.network.telemetry import (
    BLOCK_FRAMES,
    BLOCK_TICKS,
    FRAME_ROW,
    FROM_DRIVE,
    PLANT_ROW,
    FrameBuffer,
    RowBuffer,
    RowLooks,
)
from configs.brief import ROWS_WITHIN_NS, UNWATCHED_ROWS_WITHIN_NS
from configs.signals import PLANT_SIGNALS


def test_signal_names_are_unique_and_have_units() -> None:
    for signals in (PLANT_SIGNALS, SIGNALS):
        names = [signal.name for signal in signals]
        assert len(set(names)) == len(names)
        assert all(signal.unit and signal.meaning for signal in signals)


def test_blocks_are_consecutive_whole_and_end_with_a_final_one() -> None:
    blocks: list[tuple[int, int, bytes, bool]] = []
    buffer = RowBuffer(PLANT_ROW, lambda *block: blocks.append(block))
    for tick in range(2 * BLOCK_TICKS + 3):
        buffer.add(tick, [float(tick)] * len(PLANT_SIGNALS))
    buffer.finish()
    assert [(first, count, final) for first, count, _, final in blocks] == [
        (0, BLOCK_TICKS, False),
        (BLOCK_TICKS, BLOCK_TICKS, False),
        (2 * BLOCK_TICKS, 3, True),
    ]
    rows = b"".join(block for _, _, block, _ in blocks)
    ticks = [row[0] for row in PLANT_ROW.iter_unpack(rows)]
    assert ticks == [float(k) for k in range(2 * BLOCK_TICKS + 3)]


@given(st.lists(st.lists(st.floats(), min_size=3, max_size=3), max_size=10))
def test_a_row_is_its_values_as_float64_bit_for_bit(values: list[list[float]]) -> None:
    row = struct.Struct("<3d")
    blocks: list[tuple[int, int, bytes, bool]] = []
    buffer = RowBuffer(row, lambda *block: blocks.append(block))
    for tick, of_tick in enumerate(values):
        buffer.add(tick, of_tick)
    buffer.finish()
    ((first, count, rows, final),) = blocks
    assert (first, count, final) == (0, len(values), True)
    assert rows == b"".join(row.pack(*of_tick) for of_tick in values)


@pytest.mark.parametrize("length", [0, 2, 4])
def test_a_row_of_another_length_than_the_tables_is_refused(length: int) -> None:
    buffer = RowBuffer(struct.Struct("<3d"), lambda *_: None)
    buffer.add(0, (1.0, 2.0, 3.0))
    with pytest.raises(ValueError, match=f"tick 1: a row of {length} values instead of 3"):
        buffer.add(1, [0.0] * length)


def test_before_an_absence_all_is_handed_on_and_the_end_of_the_run_is_named() -> None:
    blocks: list[tuple[int, int, bool]] = []
    buffer = RowBuffer(
        PLANT_ROW, lambda first, count, _, final: blocks.append((first, count, final))
    )
    for tick in range(5):
        buffer.add(tick, [0.0] * len(PLANT_SIGNALS))
    buffer.leave(2000, final=False)
    buffer.leave(2000, final=True)
    buffer.announce()
    buffer.add(5, [0.0] * len(PLANT_SIGNALS))
    buffer.finish()
    assert blocks == [
        *((0, 5, False), (2000, 0, False), (2000, 0, True)),
        *((5, 0, False), (5, 1, True)),
    ]


def handed_on(
    row_every_ns: int, within_ns: int, rows: int, *, watched: bool = True
) -> list[tuple[int, int, int]]:
    """When blocks are handed on, their first tick and length; rows and looks come evenly."""
    blocks: list[tuple[int, int, int]] = []
    now_ns = tick = 0
    buffer = RowBuffer(
        PLANT_ROW,
        lambda first, count, *_: blocks.append((now_ns, first, count)),
        within_ns,
        lambda: watched,
    )
    looks = RowLooks([buffer], within_ns)
    while tick < rows:
        now_ns = min(tick * row_every_ns, looks.next_ns)
        if now_ns == looks.next_ns:
            looks.look(now_ns)
        else:
            buffer.add(tick, [0.0] * len(PLANT_SIGNALS))
            tick += 1
    return blocks


@given(row_every_ns=st.integers(200_000, 100_000_000), watched=st.booleans())
@settings(max_examples=40)
def test_a_row_is_handed_on_within_a_time_and_no_row_is_lost(
    row_every_ns: int, watched: bool
) -> None:
    blocks = handed_on(row_every_ns, ROWS_WITHIN_NS, 2 * BLOCK_TICKS, watched=watched)
    expected = 0
    for at_ns, first, count in blocks:
        assert first == expected
        within_ns = ROWS_WITHIN_NS if watched else UNWATCHED_ROWS_WITHIN_NS
        assert at_ns - first * row_every_ns <= within_ns
        expected += count
    assert 2 * BLOCK_TICKS - expected < BLOCK_TICKS


def test_rows_that_nobody_watches_travel_in_larger_blocks() -> None:
    few, many = (
        handed_on(4_000_000, ROWS_WITHIN_NS, 2 * BLOCK_TICKS, watched=watched)
        for watched in (False, True)
    )
    assert 5 * len(few) < len(many)


def test_whether_somebody_watches_is_asked_once_a_block() -> None:
    asked: list[bool] = []
    blocks: list[int] = []

    def nobody_watches() -> bool:
        asked.append(True)
        return False

    buffer = RowBuffer(
        PLANT_ROW, lambda _, count, *__: blocks.append(count), ROWS_WITHIN_NS, nobody_watches
    )
    for tick in range(200):  # 0.8 s
        buffer.add(tick, [0.0] * len(PLANT_SIGNALS))
        buffer.look(tick * 4_000_000)
    assert len(blocks) == 3
    assert len(asked) in (len(blocks), len(blocks) + 1)


def test_blocks_that_fill_in_time_are_not_divided() -> None:
    every_ns = 29_000_000 // BLOCK_TICKS
    assert {count for _, _, count in handed_on(every_ns, 40_000_000, 4 * BLOCK_TICKS)} == {
        BLOCK_TICKS
    }


any_frame = st.builds(Frame, st.integers(0, 2**32 - 1), st.binary(max_size=8))
crossings = st.lists(
    st.tuples(
        st.integers(-(2**63), 2**63 - 1),
        st.lists(any_frame, max_size=5),
        st.sampled_from([0, FROM_DRIVE, 255]),
    ),
    max_size=20,
)


@given(crossings)
def test_every_frame_that_crossed_a_bus_is_one_row(
    crossed: list[tuple[int, list[Frame], int]],
) -> None:
    blocks: list[tuple[int, int, bytes, bool]] = []
    buffer = FrameBuffer(lambda *block: blocks.append(block))
    for end_ns, frames, flags in crossed:
        buffer.add(end_ns, frames, flags)
    buffer.finish()
    ((first, count, rows, final),) = blocks
    expected = [
        (end_ns, frame.can_id, len(frame.data), flags, frame.data.ljust(8, b"\0"))
        for end_ns, frames, flags in crossed
        for frame in frames
    ]
    assert (first, count, final) == (0, len(expected), True)
    assert list(FRAME_ROW.iter_unpack(rows)) == expected


@given(st.integers(1, 7), st.integers(0, 3 * BLOCK_FRAMES // 7))
@settings(max_examples=20)
def test_blocks_of_frames_are_full_but_the_last_and_lose_nothing(together: int, times: int) -> None:
    blocks: list[tuple[int, int, bytes, bool]] = []
    buffer = FrameBuffer(lambda *block: blocks.append(block))
    for k in range(times):
        buffer.add(k, [Frame(n, bytes(n)) for n in range(together)], FROM_DRIVE)
    buffer.finish()
    firsts = [first for first, *_ in blocks]
    assert firsts == [n * BLOCK_FRAMES for n in range(len(blocks))]
    assert {count for _, count, *_ in blocks[:-1]} <= {BLOCK_FRAMES}
    assert [final for *_, final in blocks] == [False] * (len(blocks) - 1) + [True]
    rows = list(FRAME_ROW.iter_unpack(b"".join(rows for _, _, rows, _ in blocks)))
    assert [row[:3] for row in rows] == [(k, n, n) for k in range(times) for n in range(together)]
