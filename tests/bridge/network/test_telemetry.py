"""Rows and blocks of telemetry."""

from support.controller_rows import SIGNALS

from bridge.network.telemetry import BLOCK_TICKS, PLANT_ROW, RowBuffer
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
