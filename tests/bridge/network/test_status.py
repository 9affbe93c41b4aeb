"""Statuses in progress messages: there and back, and bounded decoding of anything at all."""

from math import inf, nan

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.network.messages import MOST_BYTES, Progress
from bridge.network.status import (
    MAX_NAME,
    MAX_WORDS,
    BusStatus,
    ControllerStatus,
    DriveStatus,
    Heard,
    PlantStatus,
)

counts = st.integers(0, 2**62)
values = st.none() | st.floats(allow_nan=False, allow_infinity=False)
shares = st.none() | st.floats(0.0, 1e9)
shown = st.characters(categories=["L", "N", "P"])
words = st.text(shown, max_size=MAX_WORDS)
names = st.text(shown, max_size=MAX_NAME)
controllers = st.builds(
    ControllerStatus,
    *(words, values, values, values, values, values),
    st.lists(st.builds(Heard, names, values), max_size=5).map(tuple),
)
plants = st.builds(
    PlantStatus,
    st.lists(st.builds(BusStatus, names, counts, shares, shares), max_size=5).map(tuple),
    st.lists(st.builds(DriveStatus, names, words, words), max_size=5).map(tuple),
    st.lists(names, max_size=5).map(tuple),
)


@given(st.builds(Progress, counts, counts, counts, controllers | plants | st.none()))
def test_progress_survives_the_wire_with_its_status(progress: Progress) -> None:
    assert Progress.decode(progress.encode()) == progress


junk = st.recursive(
    st.none() | st.booleans() | counts | st.floats() | st.text(max_size=70) | st.binary(max_size=5),
    lambda inner: st.lists(inner, max_size=9),
    max_leaves=12,
)


@given(controllers | plants, st.integers(0, 7), st.integers(0, 3), junk)
def test_a_status_with_anything_in_any_place_of_it_is_one_or_none(
    status, at, inside, value
) -> None:
    fields = status.fields()
    at %= len(fields)
    if isinstance(fields[at], list) and fields[at]:
        fields[at][0] = list(fields[at][0])
        fields[at][0][inside % len(fields[at][0])] = value
    else:
        fields[at] = value
    read = Progress.decode(msgpack.packb([1, 7, 7, 7, fields]))
    assert read is None or Progress.decode(read.encode()) == read


@pytest.mark.parametrize("number", [nan, inf])
def test_a_number_that_is_not_finite_travels_as_one_that_is_not_known(number: float) -> None:
    said = ControllerStatus("driving", number, 0.1, 0.2, 0.3, number, ())
    progress = Progress.decode(Progress(1, 1, 0, said).encode())
    assert progress is not None
    assert progress.status == ControllerStatus("driving", None, 0.1, 0.2, 0.3, None, ())


def test_a_status_that_is_too_long_never_keeps_the_progress_from_being_heard() -> None:
    drives = tuple(DriveStatus("r" * MAX_NAME, "x" * 200, "x" * 200) for _ in range(1000))
    payload = Progress(5, 6, 7, PlantStatus((), drives)).encode()
    assert len(payload) <= MOST_BYTES["progress"]
    assert Progress.decode(payload) == Progress(5, 6, 7)


def test_the_largest_scenario_fits() -> None:
    names = [f"robot_number_{n}" for n in range(256)]
    drives = tuple(DriveStatus(name, "CLOSED_LOOP_CONTROL", "x" * 200) for name in names)
    buses = tuple(BusStatus(name, 2**60, 4000.5, 0.7) for name in names)
    read = Progress.decode(Progress(5, 6, 7, PlantStatus(buses, drives)).encode())
    assert read is not None
    assert isinstance(read.status, PlantStatus)
    assert read.status.drives[255].left == "x" * MAX_WORDS
    heard = tuple(Heard(name, 0.25) for name in names)
    said = ControllerStatus("driving", 0.1, 0.1, 0.1, 0.1, 0.1, heard)
    assert Progress.decode(Progress(5, 6, 7, said).encode()) == Progress(5, 6, 7, said)


def test_what_a_terminal_would_obey_is_replaced() -> None:
    said = ControllerStatus("\x1b[2J", None, None, None, None, None, (Heard("r\n1", None),))
    progress = Progress.decode(Progress(1, 1, 0, said).encode())
    assert progress is not None
    assert isinstance(progress.status, ControllerStatus)
    assert progress.status.phase.isprintable()
