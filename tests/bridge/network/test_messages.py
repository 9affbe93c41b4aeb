"""Messages: there and back, and bounded decoding of anything at all."""

from itertools import pairwise
from math import inf, nan

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.network.messages import (
    Go,
    LeaderSpeed,
    Notice,
    PathState,
    PoseFix,
    Progress,
    Rows,
)
from bridge.network.packing import MAX_BYTES
from configs.events import MAX_EVENT_TEXT, Event
from configs.leader_speed import SpeedChange

ints = st.integers(-(2**62), 2**62)
floats = st.floats(allow_nan=False, allow_infinity=False)


@given(st.builds(PathState, ints, ints, floats, floats))
def test_a_path_state_survives_the_wire(state: PathState) -> None:
    assert PathState.decode(state.encode()) == state


@given(st.builds(PoseFix, ints, ints, floats, floats, floats))
def test_a_pose_survives_the_wire(fix: PoseFix) -> None:
    assert PoseFix.decode(fix.encode()) == fix


@given(
    st.lists(st.tuples(st.integers(0, 2**40), floats), min_size=1, max_size=5),
    st.floats(0.0, 1.0),
)
def test_a_leader_speed_survives_the_wire(said: list[tuple[int, float]], share: float) -> None:
    times = [t_ns for t_ns, _ in sorted(said)]
    gaps = [after - before for before, after in pairwise(times)] + [2**40]
    speeds = [speed for _, speed in said]
    ramps = [int(share * gap) for gap in gaps]
    speed = LeaderSpeed(tuple(map(SpeedChange, times, speeds, ramps)))
    assert LeaderSpeed.decode(speed.encode()) == speed


@given(st.integers(0, 2**40), st.integers(0, 20), st.booleans())
def test_rows_survive_the_wire(first: int, length: int, final: bool) -> None:
    rows = Rows(first, length, bytes(24 * length), final)
    assert Rows.decode(rows.encode(), 24) == rows
    assert (Rows.decode(rows.encode(), 16) is None) == (length > 0)


@given(st.builds(Progress, ints, ints, ints, st.none()))
def test_progress_survives_the_wire(progress: Progress) -> None:
    assert Progress.decode(progress.encode()) == progress


def test_a_go_survives_the_wire() -> None:
    assert Go.decode(Go(5, 400).encode()) == Go(5, 400)


def test_a_path_state_is_a_msgpack_array_that_begins_with_its_version() -> None:
    assert msgpack.unpackb(PathState(7, 7_000_000, 0.5, 0.6).encode()) == [
        1,
        7,
        7_000_000,
        0.5,
        0.6,
    ]


DECODERS = [
    PathState.decode,
    PoseFix.decode,
    LeaderSpeed.decode,
    lambda payload: Rows.decode(payload, 24),
    Progress.decode,
    Go.decode,
]


@pytest.mark.parametrize("decode", DECODERS)
@given(st.binary(max_size=200))
def test_no_bytes_raise(decode, payload: bytes) -> None:
    decode(payload)


junk = st.recursive(
    st.none() | st.booleans() | ints | st.floats() | st.text(max_size=5) | st.binary(max_size=5),
    lambda inner: st.lists(inner, max_size=6) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=12,
)


@pytest.mark.parametrize("decode", DECODERS)
@given(junk)
def test_no_well_formed_msgpack_raises(decode, value) -> None:
    decode(msgpack.packb(value))
    decode(msgpack.packb([1, value, value, value, value]))


@pytest.mark.parametrize(
    "fields",
    [
        [2, 0, 0, 0.0, 0.0],  # another version
        [1, 0, 0, 0.0],  # too short
        [1, 0, 0, 0.0, 0.0, 0.0],  # too long
        [1, 0, 0, nan, 0.0],
        [1, 0, 0, 0.0, inf],
        [1, 0, 0.5, 0.0, 0.0],  # a float where an int belongs
        [1, True, 0, 0.0, 0.0],
        [1, 0, 0, 1, 0.0],
        [1, 0, 0, "0.0", 0.0],
    ],
)
def test_a_path_state_that_is_not_exactly_one_is_none(fields) -> None:
    assert PathState.decode(msgpack.packb(fields)) is None


def test_what_is_too_long_is_not_even_looked_at() -> None:
    assert Notice.decode(msgpack.packb([1, "y" * MAX_BYTES])) is None


@pytest.mark.parametrize(
    "changes",
    [
        [[10, 0.4, 0], [0, 0.6, 0]],  # out of order
        [[0, 0.4, -1]],
        [[0, 0.4]],
        [[0, nan, 0]],
        [],
    ],
)
def test_changes_that_do_not_follow_each_other_are_no_leader_speed(changes) -> None:
    assert LeaderSpeed.decode(msgpack.packb([1, changes])) is None


@given(st.text(max_size=600))
def test_a_notice_is_one_line_that_a_terminal_can_show(text: str) -> None:
    notice = Notice.decode(Notice(Event(7, "r1", "stopped", text)).encode())
    assert notice is not None
    assert notice.event[:3] == (7, "r1", "stopped")
    assert notice.event.text.isprintable()
    assert len(notice.event.text) == min(len(text), MAX_EVENT_TEXT)


@pytest.mark.parametrize(
    "fields",
    [
        [7, "r1", "stopped", "x" * (MAX_EVENT_TEXT + 1)],
        [7, "r1", "exploded", ""],
        [7.0, "r1", "stopped", ""],
        [7, 1, "stopped", ""],
        [7, "r1", "stopped"],
    ],
)
def test_what_is_no_event_of_the_vocabulary_is_no_notice(fields: list[object]) -> None:
    assert Notice.decode(msgpack.packb([1, *fields])) is None
