"""Counts and the drive's estimator, against the vendor's figures, closed forms and bounds."""

from collections.abc import Callable
from math import exp, floor, isfinite, pi, sin
from statistics import fmean, pstdev

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.powertrain_parts import encoder

from plant.effects import WheelEffects
from plant.encoder import Encoder

TURN = 2.0 * pi
LOOP_S = 1.0 / 8000.0
STEPS_S = [0.00005, 0.0001, 0.000125, 0.0003, 0.0005, 0.001, 0.0033, 0.01]
SPEEDS = (0.05, 0.3, 0.5, 1.0, 1.5, 2.37, 3.18, 3.98, 5.0, 7.3)
COUNT = 1.0 / 8192.0
FROZEN, FLIPPED = WheelEffects(encoder_frozen=True), WheelEffects(encoder_flipped=True)
EFFECTS = {
    "encoder_frozen": True,
    "encoder_flipped": True,
    "encoder_kept": 0.99,
    "encoder_noise_counts": 2.0,
}


def turn_to(made: Encoder, angle: Callable[[float], float], seconds: float, step_s: float) -> None:
    for n in range(1, round(seconds / step_s) + 1):
        made.step(angle(n * step_s), step_s)


def noise(counts: int, bandwidth: float, rev_s: float) -> float:
    """Velocity error [rev/s rms] at every loop of the drive, from power-up on, once settled."""
    made = encoder(counts_per_shaft_rev=counts, pll_bandwidth_rad_s=bandwidth)
    errors = []
    for n in range(1, 12_000):
        _, speed = made.step(TURN * rev_s * n * LOOP_S, LOOP_S)
        if n > 4000:
            errors.append(speed - rev_s)
    return fmean(error * error for error in errors) ** 0.5


# --- the estimator --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("counts", "bandwidth", "least", "most"),
    [
        (8192, 1000.0, 0.006, 0.012),
        (8192, 200.0, 0.0001, 0.0004),
        (2048, 1000.0, 0.02, 0.05),
        (2048, 200.0, 0.0005, 0.0015),
    ],
)
def test_velocity_noise_is_that_of_the_firmware(
    counts: int, bandwidth: float, least: float, most: float
) -> None:
    figures = [noise(counts, bandwidth, speed) for speed in SPEEDS]
    assert least <= fmean(figures) <= most
    assert max(figures) <= 1.2 * most


@pytest.mark.parametrize("step_s", STEPS_S)
@pytest.mark.parametrize("bandwidth", [200.0, 1000.0, 3900.0])
def test_a_steady_speed_is_found_at_every_step_and_without_bias(
    step_s: float, bandwidth: float
) -> None:
    made = encoder(pll_bandwidth_rad_s=bandwidth)
    speeds = []
    for n in range(1, round(0.6 / step_s)):
        _, speed = made.step(TURN * 3.98 * n * step_s, step_s)
        assert abs(speed) < 10.0
        if n * step_s > 0.2:
            speeds.append(speed)
    assert fmean(speeds) == pytest.approx(3.98, abs=1e-5 * bandwidth)


def test_a_step_of_speed_is_followed_as_two_poles_at_the_bandwidth() -> None:
    made = encoder(counts_per_shaft_rev=1 << 22, pll_bandwidth_rad_s=200.0)
    for n in range(1, 400):
        _, speed = made.step(TURN * 2.0 * n * LOOP_S, LOOP_S)
        wt = 200.0 * n * LOOP_S
        assert speed == pytest.approx(2.0 * (1.0 - exp(-wt) * (1.0 + wt)), abs=0.02)


@pytest.mark.parametrize(("bandwidth", "seconds"), [(200.0, 1.0), (1000.0, 0.5)])
def test_a_ramp_of_speed_is_followed_with_the_lag_of_a_double_integrator_loop(
    bandwidth: float, seconds: float
) -> None:
    made, rate = encoder(counts_per_shaft_rev=1 << 22, pll_bandwidth_rad_s=bandwidth), 5.0  # rev/s²
    lags, behind = [], []
    for n in range(1, round(seconds / LOOP_S)):
        t = n * LOOP_S
        position, speed = made.step(TURN * 0.5 * rate * t * t, LOOP_S)
        if n * LOOP_S > 0.5 * seconds:
            lags.append(rate * t - speed)
            behind.append(0.5 * rate * t * t - position)
    assert fmean(lags) == pytest.approx(2.0 * rate / bandwidth, abs=2.0 * rate * LOOP_S)
    assert fmean(behind) == pytest.approx(rate / bandwidth**2, rel=0.3, abs=2e-7)


@pytest.mark.parametrize("angle", [0.1 + 0.3 * COUNT * n for n in range(7)])
def test_a_wheel_that_stopped_reads_exactly_zero_speed(angle: float) -> None:
    made = encoder(pll_bandwidth_rad_s=700.0)  # gains that floats don't hold exactly
    turn_to(made, lambda t: TURN * min(t, angle), 0.15, LOOP_S)
    assert {made.step(TURN * angle, LOOP_S)[1] for _ in range(2000)} == {0.0}


def test_a_start_in_motion_has_no_transient() -> None:
    made = encoder()
    made.reset(1.0, TURN * 2.0)
    for n in range(1, 100):
        position, speed = made.step(1.0 + TURN * 2.0 * n * 0.0005, 0.0005)
        assert speed == pytest.approx(2.0, abs=0.05)
        assert position == pytest.approx(1.0 / TURN + 2.0 * n * 0.0005, abs=2.0 * COUNT)


def test_between_two_loops_of_the_drive_the_estimate_stays() -> None:
    made = encoder()
    first = [made.step(TURN * 0.01 * n, 0.00005)[0] for n in range(1, 8)]
    assert first[0] == first[1] != first[2]
    assert first[2:4] == [first[2]] * 2


@given(st.lists(st.sampled_from(STEPS_S), min_size=20, max_size=60))
def test_steps_of_any_pattern_see_the_same_motion(pattern: list[float]) -> None:
    made, t = encoder(), 0.0
    for step_s in [*pattern, *[0.001] * 50]:
        t += step_s
        position, speed = made.step(TURN * 2.0 * t, step_s)
    assert speed == pytest.approx(2.0, abs=0.05)
    assert position == pytest.approx(2.0 * t, abs=3.0 * COUNT)


# --- counts ---------------------------------------------------------------------------------------


@given(st.floats(-1e4, 1e4), st.integers(0, 1000))
def test_the_count_is_the_angle_to_less_than_a_count(angle: float, seed: int) -> None:
    made = encoder(seed)
    made.step(angle, 0.001)
    assert abs(made.count - angle / TURN * 8192) <= 1.0 + 1e-6


@given(st.floats(-100, 100), st.floats(-5, 5), st.integers(0, 1000))
def test_the_estimated_position_is_within_two_counts_at_steady_speed(
    angle: float, rev_s: float, seed: int
) -> None:
    made = encoder(seed)
    made.reset(angle, TURN * rev_s)
    for n in range(1, 40):
        position, _ = made.step(angle + TURN * rev_s * n * 0.0005, 0.0005)
        # The estimate is as old as the last loop of the drive.
        late = abs(rev_s) * LOOP_S
        assert position == pytest.approx(angle / TURN + rev_s * n * 0.0005, abs=2.0 * COUNT + late)


def test_the_phase_within_a_count_differs_between_seeds_and_not_between_runs() -> None:
    def edge(seed: int) -> int:
        made = encoder(seed)
        for n in range(1000):
            made.step(TURN * COUNT * n / 1000.0, 0.001)
            if made.count:
                return n
        return 1000

    assert edge(1) == edge(1)
    assert len({edge(seed) for seed in range(8)}) > 4


def test_the_same_seed_gives_the_same_estimates_under_noise() -> None:
    def run(seed: int) -> list[tuple[float, float]]:
        made = encoder(seed, noise_counts=1.5)
        return [made.step(TURN * n * 0.001, 0.001) for n in range(50)]

    assert run(7) == run(7) != run(8)


@given(
    st.lists(
        st.tuples(
            st.floats(allow_nan=True, allow_infinity=True)
            | st.sampled_from([3e38, -3e38, 1e308, 1e15]),
            st.sampled_from(STEPS_S),
        ),
        max_size=20,
    ),
    st.sets(st.sampled_from(list(EFFECTS))),
    st.booleans(),
)
def test_no_angle_makes_the_estimate_anything_but_finite(
    steps: list[tuple[float, float]], faults: set[str], index: bool
) -> None:
    made = encoder(index=index)
    made.apply(WheelEffects(**{name: EFFECTS[name] for name in faults}))
    for angle, step_s in steps:
        assert all(map(isfinite, made.step(angle, step_s)))


# --- faults ---------------------------------------------------------------------------------------


def at_speed(rev_s: float = 2.0, **changes: bool) -> Encoder:
    made = encoder(**changes)
    turn_to(made, lambda t: TURN * rev_s * t, 0.1, 0.0005)
    return made


def on(made: Encoder, rev_s: float, seconds: float, since: float = 0.1) -> tuple[float, float]:
    """Go on at a speed from where `at_speed` left off."""
    turn_to(made, lambda t: TURN * rev_s * (since + t), seconds, 0.0005)
    return made.step(TURN * rev_s * (since + seconds + 0.0005), 0.0005)


def test_a_frozen_encoder_stays_where_it_was_and_reads_no_speed() -> None:
    made = at_speed()
    count = made.count
    made.apply(FROZEN)
    position, speed = on(made, 2.0, 0.1)
    assert made.count == count
    assert (position, speed) == (pytest.approx(0.2, abs=2.0 * COUNT), 0.0)


def test_a_frozen_encoder_that_recovers_goes_on_from_where_it_froze() -> None:
    made = at_speed()
    made.apply(FROZEN)
    on(made, 2.0, 0.1)
    made.apply(WheelEffects())
    position, speed = on(made, 2.0, 0.1, since=0.2005)
    assert speed == pytest.approx(2.0, abs=0.05)
    assert position == pytest.approx(0.4, abs=0.005)


def test_a_jump_moves_the_position_once_and_kicks_the_speed() -> None:
    made = at_speed()
    made.jump(0.25)
    _, kicked = made.step(TURN * 2.0 * 0.1005, 0.0005)
    assert kicked > 50.0
    position, speed = on(made, 2.0, 0.1, since=0.1005)
    assert speed == pytest.approx(2.0, abs=0.05)
    assert position == pytest.approx(2.0 * 0.201 + 0.25, abs=3.0 * COUNT)


def test_a_flipped_sign_runs_back_from_where_it_happened() -> None:
    made = at_speed()
    made.apply(FLIPPED)
    position, speed = on(made, 2.0, 0.1)
    assert speed == pytest.approx(-2.0, abs=0.05)
    assert position == pytest.approx(0.2 - 2.0 * 0.1005, abs=3.0 * COUNT)


@pytest.mark.parametrize("rev_s", [2.0, -2.0])
def test_lost_counts_make_position_and_speed_fall_short_by_their_fraction(rev_s: float) -> None:
    made = at_speed(rev_s)
    made.apply(WheelEffects(encoder_kept=0.9))
    position, _ = on(made, rev_s, 1.0)
    assert position == pytest.approx(rev_s * (0.1 + 0.9 * 1.0005), abs=0.01)


def test_counts_lost_by_a_flipped_encoder_make_it_fall_short_the_other_way() -> None:
    made = at_speed()
    made.apply(WheelEffects(encoder_flipped=True, encoder_kept=0.9))
    position, _ = on(made, 2.0, 1.0)
    assert position == pytest.approx(0.2 - 0.9 * 2.0 * 1.0005, abs=0.01)


def test_all_counts_lost_is_a_frozen_encoder() -> None:
    made = at_speed()
    made.apply(WheelEffects(encoder_kept=0.0))
    assert on(made, 2.0, 0.2)[1] == 0.0


def test_noise_disturbs_the_speed_and_keeps_the_position() -> None:
    made = at_speed()
    made.apply(WheelEffects(encoder_noise_counts=5.0))
    speeds = []
    for n in range(1, 2000):
        position, speed = made.step(TURN * 2.0 * (0.1 + n * 0.0005), 0.0005)
        speeds.append(speed)
    assert 0.02 < pstdev(speeds) < 0.2
    assert fmean(speeds) == pytest.approx(2.0, abs=0.02)
    assert position == pytest.approx(2.0 * (0.1 + 1999 * 0.0005), abs=20.0 * COUNT)


def test_an_index_finds_lost_counts_again_where_its_mark_passes() -> None:
    blind, indexed = at_speed(), at_speed(index=True)
    for made in (blind, indexed):
        made.apply(WheelEffects(encoder_kept=0.95))
        on(made, 2.0, 0.38)
        made.apply(WheelEffects())
        on(made, 2.0, 0.2, since=0.4805)
    assert abs(indexed.count - floor(2.0 * 0.681 * 8192)) <= 1
    assert blind.count < indexed.count - 200


def test_an_index_does_not_see_whole_turns() -> None:
    made = at_speed(index=True)
    made.jump(1.05)
    position, _ = on(made, 2.0, 0.5)
    assert position == pytest.approx(1.0 + 2.0 * 0.6005, abs=3.0 * COUNT)


def test_a_flipped_encoder_with_an_index_counts_back_from_its_mark() -> None:
    made = encoder(index=True)
    made.apply(FLIPPED)
    made.jump(0.05)
    turn_to(made, lambda t: 0.2 * TURN * sin(100.0 * t), 2.0, 0.0005)
    assert made.count == pytest.approx(-0.2 * sin(200.0) * 8192, abs=2.0)
