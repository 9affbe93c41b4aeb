"""Equations (1) and (2) of `agents.limits`."""

from math import inf, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.limits import EncoderCheck, TorqueLimiter

H = 0.005
torques = st.floats(-1e6, 1e6)


@given(st.lists(st.tuples(torques, torques), max_size=30))
def test_both_limits_hold_for_any_sequence(asked) -> None:
    limiter = TorqueLimiter(0.5, 4.0, H)
    last = (0.0, 0.0)
    for pair in asked:
        sent = limiter(*pair)
        for torque, before in zip(sent, last, strict=True):
            assert abs(torque) <= 0.5
            assert abs(torque - before) <= 4.0 * H + 1e-12
        last = sent


@given(torques, torques)
def test_without_limits_nothing_changes(right: float, left: float) -> None:
    limiter = TorqueLimiter(inf, inf, H)
    assert not limiter.active
    assert limiter(right, left) == (right, left)


def test_a_step_is_a_ramp_of_the_slew_rate_and_begins_at_0_after_a_reset() -> None:
    limiter = TorqueLimiter(inf, 4.0, H)
    ramp = [limiter(1.0, -1.0) for _ in range(60)]
    assert ramp[0] == pytest.approx((0.02, -0.02))
    assert ramp[48] == pytest.approx((0.98, -0.98))
    assert ramp[50:] == [(1.0, -1.0)] * 10
    limiter.reset()
    assert limiter(1.0, 0.0) == pytest.approx((0.02, 0.0))


def motions(seconds: float):
    """Right wheel: φ = 3 sin 2t; left wheel: −2 t."""
    for k in range(round(seconds / H)):
        t = k * H
        yield 3.0 * sin(2 * t), -2.0 * t, 6.0 * sin(2 * t + pi / 2), -2.0


def test_a_healthy_encoder_is_believed() -> None:
    check = EncoderCheck(0.01, H)
    assert [check(motion) for motion in motions(5.0)] == [None] * 1000


@pytest.mark.parametrize(
    ("spoilt", "within_s"),
    [
        (lambda m: (m[0] + 0.5, *m[1:]), H),  # jump
        (lambda m: (m[0], 0.0, *m[2:]), H),  # jump to 0 that stays
        (lambda m: (-m[0], m[1], -m[2], m[3]), 0.3),  # flipped sign
        (lambda m: (*m[:3], -m[3]), 0.15),  # speed flipped alone
    ],
)
def test_an_encoder_that_disagrees_with_itself_is_found(spoilt, within_s) -> None:
    check = EncoderCheck(0.3, H)
    healthy = 300
    found = None
    for k, motion in enumerate(motions(5.0)):
        said = check(motion if k < healthy else spoilt(motion))
        if k < healthy:
            assert said is None
        elif said is not None:
            found = found or k
    assert found is not None
    assert (found - healthy + 1) * H <= within_s + 1e-9


def test_a_frozen_angle_with_a_speed_is_found() -> None:
    check = EncoderCheck(0.3, H)
    said = [check((1.0, 2.0, 0.0, 3.0)) for _ in range(100)]
    assert said[0] is None
    assert said[-1] is not None
    assert said[-1].startswith("left encoder: angle and speed disagree by 0.")
