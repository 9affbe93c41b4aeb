"""The primitives against what they stand for, corners too, uncompiled and compiled."""

import bisect
import math
import struct

import numba
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.drives.odrive import client, parameters
from fleetloop.sweep.kernel import loop, primitives

LEAST, MOST = numba.njit(primitives.least), numba.njit(primitives.most)
FLOAT32 = numba.njit(primitives.float32)
ANY = st.floats() | st.sampled_from([0.0, -0.0, math.nan, math.inf, -math.inf])


def bits(value: float) -> bytes:
    return struct.pack("<d", value)


@given(ANY, ANY)
def test_least_and_most_are_pythons_min_and_max(a: float, b: float) -> None:
    for found in (primitives.least(a, b), LEAST(a, b)):
        assert bits(found) == bits(min(a, b))
    for found in (primitives.most(a, b), MOST(a, b)):
        assert bits(found) == bits(max(a, b))


@given(st.floats(allow_nan=False))
@pytest.mark.filterwarnings("ignore:overflow")
def test_float32_is_what_four_bytes_carry_or_infinite_where_they_refuse(value: float) -> None:
    try:
        (wanted,) = struct.unpack("<f", struct.pack("<f", value))
    except OverflowError:
        wanted = math.copysign(math.inf, value)
    assert primitives.float32(value) == wanted
    assert FLOAT32(value) == wanted


@given(st.lists(st.floats(-10, 10), max_size=8), st.floats(-11, 11))
def test_bisect_right_is_that_of_python(values: list[float], value: float) -> None:
    ordered = sorted(values)
    assert primitives.bisect_right(ordered, value) == bisect.bisect_right(ordered, value)


def test_a_torque_saturates_at_the_number_of_the_client() -> None:
    assert loop.SATURATED == client.FLOAT32_MAX
    assert primitives.FLOAT32_MOST == parameters.FLOAT32_MAX
