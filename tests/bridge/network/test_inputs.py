"""The bytes of an input log: what was put in comes out, whatever is cut off its end."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.frame import Frame
from bridge.network.inputs import (
    BLOCK_BYTES,
    Input,
    InputBuffer,
    InputsError,
    Kind,
    entries,
)

FRAMES = st.builds(Frame, st.integers(0, 0xFFFF_FFFF), st.binary(max_size=8))
TICKS = st.integers(-(2**62), 2**62)


class Kept:
    """What a buffer handed on."""

    def __init__(self) -> None:
        self.blocks: list[tuple[int, bytes, bool]] = []
        self.buffer = InputBuffer(lambda *block: self.blocks.append(block))

    def log(self) -> bytes:
        self.buffer.finish()
        return b"".join(block for _, block, _ in self.blocks)


@given(frame=FRAMES, at_ns=TICKS)
def test_a_frame_comes_out_as_it_was(frame: Frame, at_ns: int) -> None:
    kept = Kept()
    kept.buffer.frame(frame.can_id, frame.data, at_ns)
    (entry,) = entries(kept.log())
    assert (entry.kind, entry.time_ns, entry.frame()) == (Kind.FRAME, at_ns, frame)


@given(tick=TICKS, now_ns=TICKS, sent=st.lists(FRAMES, max_size=6))
def test_a_tick_keeps_the_frames_that_answered_it(
    tick: int, now_ns: int, sent: list[Frame]
) -> None:
    kept = Kept()
    kept.buffer.tick(tick, now_ns, sent)
    kept.buffer.stop(sent)
    computed, stopped = entries(kept.log())
    assert (computed.tick(), computed.time_ns, computed.sent()) == (tick, now_ns, sent)
    assert (stopped.kind, stopped.sent()) == (Kind.STOP, sent)


@given(source=st.text("abcz_0129", max_size=9), content=st.binary(max_size=300))
def test_messages_may_hold_any_byte(source: str, content: bytes) -> None:
    kept = Kept()
    kept.buffer.named(Kind.PATH, source, content)
    (entry,) = entries(kept.log())
    assert entry.named() == (source, content)


def test_a_frame_has_the_documented_bytes() -> None:
    kept = Kept()
    kept.buffer.frame(0x29, bytes(range(8)), 1_000_000)
    head = "0c000000" + "01" + "40420f0000000000"
    assert kept.log() == bytes.fromhex(head + "29000000" + "0001020304050607")


def test_a_log_that_is_cut_anywhere_gives_the_entries_before() -> None:
    kept = Kept()
    kept.buffer.begin(rejoins=True)
    kept.buffer.clock(5, 0.25, -1.0)
    kept.buffer.about(Kind.CLOSING, 7)
    kept.buffer.frame(1, b"abc", 3)
    log = kept.log()
    whole = list(entries(log))
    assert [entry.kind for entry in whole] == [Kind.BEGIN, Kind.CLOCK, Kind.CLOSING, Kind.FRAME]
    assert whole[1].clock() == (5, 0.25, -1.0)
    for end in range(len(log)):
        cut = list(entries(log[:end]))
        assert cut == whole[: len(cut)]
        assert len(cut) < len(whole)


def test_a_begin_says_whether_and_where_a_controller_goes_on() -> None:
    kept = Kept()
    kept.buffer.begin(rejoins=False)
    kept.buffer.begin(rejoins=True, resumes_tick=250)
    assert [entry.begin() for entry in entries(kept.log())] == [(False, 0), (True, 250)]
    with pytest.raises(InputsError, match="none of this version"):
        Input(Kind.BEGIN, 0, b"\1").begin()


def test_an_unknown_kind_is_named_with_its_place() -> None:
    kept = Kept()
    kept.buffer.begin(rejoins=False)
    log = kept.log()
    assert list(entries(log)) == [Input(Kind.BEGIN, 0, bytes(9))]
    with pytest.raises(InputsError, match=f"byte {len(log)}: no entry has the kind 200"):
        list(entries(log + bytes(4) + b"\xc8" + bytes(8)))


def test_blocks_follow_one_another_and_none_is_long_whatever_a_message_is() -> None:
    kept = Kept()
    kept.buffer.named(Kind.LEADER, "", bytes(5 * BLOCK_BYTES))
    assert kept.blocks == []  # before the first tick nobody may listen
    for tick in range(1000):
        kept.buffer.tick(tick, tick, [Frame(1, b"1234")])
    log = kept.log()
    expected = 0
    for first, block, final in kept.blocks:
        assert first == expected
        assert len(block) < 2 * BLOCK_BYTES
        assert final is (first + len(block) == len(log))
        expected += len(block)
    assert len(list(entries(log))) == 1001
