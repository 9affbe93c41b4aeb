"""What the recorder takes of what comes: the rest is refused and named, and memory is bounded."""

from pathlib import Path

import pytest
from support.controller_rows import ROW, SIGNALS
from support.robot_bench import NOWHERE, SCENARIO

from bridge.network.link import Arrival, Dropped
from bridge.network.messages import Rows
from bridge.network.telemetry import BLOCK_TICKS, FRAME_ROW
from configs.brief import RecorderBrief
from configs.loading import to_toml
from fleetloop.record.recorder import AHEAD_TICKS, _Recorder
from fleetloop.record.run_record import RunRecord

TICKS = 1 << 20
PERIOD_NS = 1_000_000


@pytest.fixture
def recorder(tmp_path: Path):
    brief = RecorderBrief(
        *(str(tmp_path / "r.mcap"), ("r1", "r2"), (SIGNALS, SIGNALS), ("r1",)),
        *(("blf",), to_toml(SCENARIO)),
        *(PERIOD_NS, 1.0, 0.02, NOWHERE, ""),
        ticks=TICKS,
        last_frame_ns=10**12,
    )
    with RunRecord(
        tmp_path / "r.mcap",
        dict.fromkeys(brief.robots, SIGNALS),
        brief.scenario_toml,
        PERIOD_NS,
        buses=("r1",),
    ) as record:
        yield _Recorder(brief, record)


def rows(first: int, count: int, *, final: bool = False) -> bytes:
    return Rows(first, count, bytes(ROW.size * count), final).encode()


def take(recorder: _Recorder, payload: bytes, tag: str = "controller/r1") -> list[str]:
    recorder.process(Arrival(tag, "key", payload))
    return recorder.refusals.lines()


def test_rows_are_taken_in_order_and_what_else_comes_is_named(recorder: _Recorder) -> None:
    assert take(recorder, rows(0, 0)) == []  # a hello
    assert take(recorder, rows(0, 128)) == []
    assert take(recorder, rows(0, 128)) == [
        "refused 1 row block of r1's controller: begins at tick 0, expected 128"
    ]
    assert take(recorder, rows(128, 5)) == recorder.refusals.lines()
    take(recorder, rows(2**40, 5))
    assert recorder.refusals.lines() == [
        "refused 2 row blocks of r1's controller: begins at tick 0, expected 128"
    ]
    take(recorder, rows(133, 0, final=True))
    assert take(recorder, rows(133, 5))[-1] == (
        "refused 1 row block of r1's controller: tick 133 after its last"
    )
    assert take(recorder, b"\xc1", "plant/r2")[-1] == (
        "refused 1 row block of the plant for r2: not well formed"
    )


def test_no_block_is_longer_than_an_honest_one(recorder: _Recorder) -> None:
    assert "rows from tick 0 on" in take(recorder, rows(0, BLOCK_TICKS + 1))[0]


def test_who_is_far_ahead_of_all_others_is_not_kept(recorder: _Recorder) -> None:
    for first in range(0, 2 * AHEAD_TICKS, BLOCK_TICKS):
        take(recorder, rows(first, BLOCK_TICKS))
    first, *_ = recorder.refusals.lines()
    assert f"ahead of others by more than {AHEAD_TICKS} ticks" in first
    assert recorder.ticks <= AHEAD_TICKS + 2 * BLOCK_TICKS


@pytest.mark.parametrize(
    ("stamp_ns", "length", "words"),
    [(0, 9, "9 bytes of data in a frame"), (10**13, 8, "a frame at 10000 s of bus time")],
)
def test_what_is_no_frame_of_the_run_is_refused(
    recorder: _Recorder, stamp_ns: int, length: int, words: str
) -> None:
    frame = FRAME_ROW.pack(stamp_ns, 0x123, length, 0, bytes(8))
    assert take(recorder, Rows(0, 1, frame, False).encode(), "can/r1") == [
        f"refused 1 frame block of bus r1: {words}"
    ]


def test_what_found_no_room_is_named(recorder: _Recorder) -> None:
    recorder.note_dropped([Dropped("controller/r2", "key", 7)])
    (line,) = recorder.refusals.lines()
    assert line.startswith("refused 7 row blocks of r2's controller: more of it waited")
