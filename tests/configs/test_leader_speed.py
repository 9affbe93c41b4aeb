"""The virtual leader's speed over time."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from configs.errors import ScenarioError
from configs.leader_speed import SpeedChange, corners, in_order, speed_at, with_change
from configs.loading import load

PROFILE = (
    SpeedChange(0, 0.6),
    SpeedChange(10, 0.4),
    SpeedChange(20, 0.0, 8),
    SpeedChange(28, 0.5, 4),
)


@pytest.mark.parametrize(
    ("t_ns", "speed"),
    [
        *((-5, 0.6), (0, 0.6), (9, 0.6), (10, 0.4), (20, 0.4), (22, 0.3), (26, 0.1)),
        *((28, 0.0), (29, 0.125), (32, 0.5), (99, 0.5)),
    ],
)
def test_speeds_hold_step_and_ramp(t_ns: int, speed: float) -> None:
    assert speed_at(PROFILE, t_ns) == pytest.approx(speed, abs=1e-15)


def test_between_corners_speeds_are_straight_lines() -> None:
    found = corners(PROFILE, 40)
    assert found == [0, 9, 10, 19, 20, 27, 28, 32, 40]
    for a, b in pairwise(found):
        ends = speed_at(PROFILE, a), speed_at(PROFILE, b)
        for t_ns in range(a, b + 1):
            share = (t_ns - a) / (b - a)
            straight = ends[0] + share * (ends[1] - ends[0])
            assert speed_at(PROFILE, t_ns) == pytest.approx(straight, abs=1e-15)
    assert corners(PROFILE, 22) == [0, 9, 10, 19, 20, 22]


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.integers(0, 1000), st.integers(0, 1200))
def test_a_ramp_stays_between_its_speeds(before, after, ramp_ns, t_ns) -> None:
    v_r = speed_at((SpeedChange(0, before), SpeedChange(100, after, ramp_ns)), t_ns)
    assert min(before, after) - 1e-12 <= v_r <= max(before, after) + 1e-12


def test_a_change_within_a_ramp_begins_from_the_speed_there() -> None:
    first = (SpeedChange(0, 0.6), SpeedChange(20, 0.2, 8))
    second = (*first, SpeedChange(24, 0.0, 16))
    third = (*second, SpeedChange(32, 1.0, 4))
    assert in_order(third)
    for t_ns in range(24):
        assert speed_at(third, t_ns) == speed_at(first, t_ns)
    assert speed_at(second, 24) == speed_at(first, 24)
    assert speed_at(second, 32) == pytest.approx(0.2)  # half way from 0.4 to 0
    assert speed_at(second, 40) == 0.0
    assert speed_at(third, 34) == pytest.approx(0.6)
    assert speed_at(third, 36) == 1.0
    assert not in_order((SpeedChange(0, 0.6), SpeedChange(20, 0.0), SpeedChange(19, 0.5)))


def test_thousands_of_ramps_within_each_other_have_a_speed() -> None:
    many = [SpeedChange(n, float(n % 2), 1 << 40) for n in range(5000)]
    assert 0.0 <= speed_at(many, 5000) <= 1.0


@given(st.integers(0, 60), st.integers(0, 40))
def test_one_more_change_is_in_order_and_changes_nothing_before(from_ns, ramp_ns) -> None:
    found = with_change(PROFILE, SpeedChange(from_ns, 0.3, ramp_ns))
    assert in_order(found)
    assert found[0] == PROFILE[0]
    assert [one for one in found if one.from_ns == from_ns][-1] == (from_ns, 0.3, ramp_ns)
    for t_ns in range(from_ns):
        assert speed_at(found, t_ns) == speed_at(PROFILE, t_ns)


def test_a_change_takes_the_place_of_one_at_its_time() -> None:
    assert with_change(PROFILE, SpeedChange(10, 0.1))[1] == SpeedChange(10, 0.1)
    assert len(with_change(PROFILE, SpeedChange(0, 0.1))) == len(PROFILE) + 1


@pytest.mark.parametrize(
    ("steps", "key", "remedy"),
    [
        ("{t_s=5.0, speed_m_s=0.2}, {t_s=5.0, speed_m_s=0.3}", "1.t_s", "t_s must increase"),
        ("{t_s=5.0, speed_m_s=0.2, ramp_s=-1.0}", "0.ramp_s", "must be 0 or more"),
    ],
)
def test_wrong_steps_are_refused_by_key_and_cause(steps, key, remedy) -> None:
    with pytest.raises(ScenarioError) as raised:
        load("paper", [f"leader.steps=[{steps}]"])
    assert f"leader.steps.{key}" in str(raised.value)
    assert remedy in str(raised.value)
