"""Effects of faults on one robot, before, while and after they act, by closed forms."""

from math import exp, pi, sqrt
from statistics import fmean, pstdev

import pytest
from support.fault_bench import COASTING, MIRRORED, REALISTIC, FaultBench

from bridge.drives.odrive.frames import AxisError, AxisState, Command
from configs.faults.kinds import KINDS
from plant.faults import EFFECTS, STRIKES

LASTS = "at_s=0.02, for_s=0.02"  # ticks 10 to 19
mountings = pytest.mark.parametrize("mounting", [(), MIRRORED], ids=["as_is", "mirrored"])
presets = pytest.mark.parametrize("preset", [(), REALISTIC], ids=["ideal", "realistic"])


def test_a_kind_has_an_effect_or_strikes_as_its_class_says() -> None:
    assert all(not KINDS[kind].INSTANT for kind in EFFECTS)
    assert all(KINDS[kind].INSTANT for kind in STRIKES)


# --- motors ---------------------------------------------------------------------------------------


@mountings
@presets
@pytest.mark.parametrize(
    ("kind", "while_it_acts"),
    [
        ("torque_stuck", 0.2),
        ("torque_half", 0.05),
        ("torque_zero", 0.0),
        ("torque_reversed", -0.1),
    ],
)
def test_a_wheel_gets_another_torque_than_is_asked_while_it_acts(
    kind: str, while_it_acts: float, preset: tuple[str, ...], mounting: tuple[str, ...]
) -> None:
    bench = FaultBench(f'{{kind="{kind}", {LASTS}, wheel="right"}}', overrides=(*preset, *mounting))
    bench.arm()
    bench.torque(0.2, 0.2)
    bench.run(10)
    near = {"rel": 2e-3, "abs": 1e-4}
    assert bench.torques == pytest.approx((0.2, 0.2), **near)
    bench.torque(0.1, 0.1)
    bench.run(10)
    assert bench.demands == pytest.approx((0.1, 0.1), rel=1e-6)
    assert bench.torques == pytest.approx((while_it_acts, 0.1), **near)
    bench.run(10)
    assert bench.torques == pytest.approx((0.1, 0.1), **near)


@presets
def test_a_torque_stays_stuck_where_it_was_whatever_else_begins_and_ends(
    preset: tuple[str, ...],
) -> None:
    bench = FaultBench(
        '{kind="torque_stuck", at_s=0.02, for_s=0.06}',
        '{kind="push", at_s=0.04, for_s=0.02, force_body_N=1.0}',
        '{kind="torque_half", at_s=0.06, for_s=0.01, wheel="left"}',
        overrides=preset,
    )
    bench.arm()
    bench.torque(0.2, 0.2)
    bench.run(10)
    bench.torque(0.1, 0.1)
    bench.run(22)
    assert bench.torques == pytest.approx((0.2, 0.1), rel=2e-3)
    bench.run(8)
    assert bench.torques == pytest.approx((0.2, 0.2), rel=2e-3)
    bench.run(10)
    assert bench.torques == pytest.approx((0.1, 0.1), rel=2e-3)


def test_faults_of_one_motor_act_together() -> None:
    halves = [f'{{kind="torque_half", {LASTS}}}', '{kind="torque_half", at_s=0.03, for_s=0.005}']
    bench = FaultBench(*halves, f'{{kind="torque_reversed", {LASTS}, wheel="left"}}')
    bench.arm()
    bench.torque(0.2, 0.2)
    seen = []
    for _ in range(21):
        bench.run(1)
        seen.append(tuple(round(torque, 3) for torque in bench.torques))
    assert seen[9:21] == [(0.2, 0.2)] + 5 * [(0.1, -0.1)] + 3 * [(0.05, -0.05)] + 2 * [
        (0.1, -0.1)
    ] + [(0.2, 0.2)]


@pytest.mark.parametrize(
    ("kind", "bit"),
    [
        ("fet_over_temperature", AxisError.INVERTER_OVER_TEMP),
        ("motor_over_temperature", AxisError.MOTOR_OVER_TEMP),
    ],
)
def test_a_hot_thermistor_derates_the_drive_and_hotter_disarms_it(
    kind: str, bit: AxisError
) -> None:
    # By (1) of `health`: from 100 °C on the limit falls to nothing at 120 °C; 125 °C disarms.
    bench = FaultBench(
        f'{{kind="{kind}", {LASTS}, wheel="left", rise_K=90.0}}',
        f'{{kind="{kind}", at_s=0.06, for_s=0.02, wheel="left", rise_K=101.0}}',
        overrides=REALISTIC,
    )
    bench.arm()
    bench.torque(0.4, 0.4)
    bench.run(10)
    assert bench.demands == pytest.approx((0.4, 0.4), rel=1e-6)
    bench.run(10)
    assert bench.demands == pytest.approx((0.4, 0.25 * 0.5), rel=3e-2)
    bench.run(10)
    assert bench.demands == pytest.approx((0.4, 0.4), rel=1e-6)
    bench.run(10)
    assert bench.drives[1].errors == bit
    assert bench.closed == [True, False]
    bench.run(10)
    assert bench.drives[1].errors == bit
    bench.tell(1, Command.CLEAR_ERRORS)
    assert bench.drives[1].errors == AxisError(0)


@pytest.mark.parametrize(
    ("fault", "bit"),
    [
        ('kind="under_voltage"', AxisError.DC_BUS_UNDER_VOLTAGE),
        ('kind="over_voltage"', AxisError.DC_BUS_OVER_VOLTAGE),
    ],
)
def test_a_supply_out_of_its_range_disarms_both_drives_until_it_is_back(
    fault: str, bit: AxisError
) -> None:
    bench = FaultBench(f"{{{fault}, {LASTS}}}", overrides=REALISTIC)
    bench.arm()
    bench.run(10)
    assert bench.closed == [True, True]
    bench.run(10)
    assert bench.closed == [False, False]
    bench.tell(0, Command.CLEAR_ERRORS)
    assert [drive.errors for drive in bench.drives] == [bit, bit]
    bench.run(2)
    for node in (0, 1):
        bench.tell(node, Command.CLEAR_ERRORS)
    bench.arm()
    assert bench.closed == [True, True]


# --- encoders -------------------------------------------------------------------------------------

REV_S = 1.0 / (2.0 * pi * 0.04) * 0.4
"""Wheels of 4 cm at 0.4 m/s [rev/s]."""


def encoder_bench(fault: str, *overrides: str) -> FaultBench:
    bench = FaultBench(f"{{{fault}, wheel='right'}}", overrides=overrides, v_m_s=0.4)
    bench.run(10)
    (angle, speed), left = bench.wheels()
    assert (angle, speed) == pytest.approx((0.02 * REV_S, REV_S), rel=0.15)
    assert left == pytest.approx((angle, speed), rel=0.1)
    return bench


@mountings
@presets
def test_a_frozen_encoder_stands_still_and_then_counts_on_from_there(
    preset: tuple[str, ...], mounting: tuple[str, ...]
) -> None:
    bench = encoder_bench('kind="encoder_freeze", at_s=0.02, for_s=0.1', *preset, *mounting)
    before = bench.wheels()[0][0]
    bench.run(50)
    (angle, speed), (left, _) = bench.wheels()
    assert angle == pytest.approx(before, abs=0.02)
    assert speed == pytest.approx(0.0, abs=1e-3)
    assert left == pytest.approx(0.12 * REV_S, rel=0.02)
    bench.run(50)
    (later, speed), _ = bench.wheels()
    assert speed == pytest.approx(REV_S, rel=0.02)
    assert later == pytest.approx(angle + 0.1 * REV_S, abs=0.01)


@mountings
@presets
def test_a_flipped_encoder_runs_back_and_then_on_from_there(
    preset: tuple[str, ...], mounting: tuple[str, ...]
) -> None:
    bench = encoder_bench('kind="encoder_sign_flip", at_s=0.02, for_s=0.1', *preset, *mounting)
    bench.run(50)
    (angle, speed), (left, _) = bench.wheels()
    assert speed == pytest.approx(-REV_S, rel=0.02)
    assert angle == pytest.approx((0.02 - 0.1) * REV_S, abs=0.01)
    assert left == pytest.approx(0.12 * REV_S, rel=0.02)
    bench.run(50)
    (angle, speed), _ = bench.wheels()
    assert speed == pytest.approx(REV_S, rel=0.02)
    assert angle == pytest.approx(0.02 * REV_S, abs=0.01)


@mountings
@presets
def test_an_encoder_jumps_at_its_shaft_once_and_for_good(
    preset: tuple[str, ...], mounting: tuple[str, ...]
) -> None:
    bench = encoder_bench('kind="encoder_jump", at_s=0.02, shaft_rev=0.25', *preset, *mounting)
    for ticks in (50, 50):
        bench.run(ticks)
        (angle, speed), (left, left_speed) = bench.wheels()
        assert angle - left == pytest.approx(0.25 / bench.gears[0], abs=0.005)
        assert (speed, left_speed) == pytest.approx((REV_S, REV_S), rel=0.02)


@mountings
@presets
def test_an_encoder_that_slips_loses_its_share_and_does_not_find_it_again(
    preset: tuple[str, ...], mounting: tuple[str, ...]
) -> None:
    slip = 'kind="encoder_slip", at_s=0.02, for_s=0.4, share=0.2'
    bench = encoder_bench(slip, *preset, *mounting)
    bench.run(200)
    (angle, speed), (left, _) = bench.wheels()
    assert left - angle == pytest.approx(0.2 * 0.4 * REV_S, rel=0.03)
    if not preset:
        assert speed == pytest.approx(0.8 * REV_S)
    bench.run(50)
    (later, speed), (left, _) = bench.wheels()
    assert speed == pytest.approx(REV_S, rel=0.02)
    assert left - later == pytest.approx(0.2 * 0.4 * REV_S, rel=0.03)


def speeds(bench: FaultBench, ticks: int) -> list[float]:
    found = []
    for _ in range(ticks):
        bench.run(1)
        found.append(bench.wheels()[0][1])
    return found


@presets
def test_noise_of_an_encoder_is_what_the_estimator_passes_on(preset: tuple[str, ...]) -> None:
    # σ_v = σ/N √(w³ T / 4) with w = 200 rad/s: (1) of `plant.exact`.
    bench = encoder_bench(
        'kind="encoder_noise", at_s=0.02, for_s=2.4, counts_rms=20.0',
        "encoder.pll_bandwidth_rad_s=200.0",
        *preset,
    )
    bench.run(10)
    wanted = 20.0 / 8192.0 * sqrt(200.0**3 / 8000.0 / 4.0)
    noisy = speeds(bench, 1100)
    assert pstdev(noisy) == pytest.approx(wanted, rel=0.12)
    assert fmean(noisy) == pytest.approx(REV_S, abs=0.2 * wanted)
    bench.run(150)
    assert pstdev(speeds(bench, 20)) < 0.05 * wanted
    (angle, _), (left, _) = bench.wheels()
    assert angle == pytest.approx(left, abs=0.01)


# --- drives ---------------------------------------------------------------------------------------


def armed(fault: str) -> FaultBench:
    bench = FaultBench(f'{{{fault}, at_s=0.02, wheel="left"}}')
    bench.arm()
    bench.torque(0.2, 0.2)
    bench.run(10)
    assert bench.closed == [True, True]
    bench.run(1)
    assert bench.closed == [True, False]
    assert bench.torques == pytest.approx((0.2, 0.0))
    assert bench.drives[0].errors == AxisError(0)
    return bench


@pytest.mark.parametrize(
    ("fault", "bit"),
    [
        ('kind="drive_estop"', AxisError.ESTOP_REQUESTED),
        ('kind="drive_watchdog"', AxisError.WATCHDOG_TIMER_EXPIRED),
        ('kind="drive_error"', AxisError.DRV_FAULT),
        ('kind="drive_error", error="SPINOUT_DETECTED"', AxisError.SPINOUT_DETECTED),
    ],
)
def test_a_drive_disarms_with_its_error_until_that_is_cleared(fault: str, bit: AxisError) -> None:
    bench = armed(fault)
    left = bench.drives[1]
    assert left.errors == bit
    assert bit in left.disarm_reason
    bench.arm()
    assert bench.closed == [True, False]
    bench.tell(1, Command.CLEAR_ERRORS)
    bench.arm()
    assert bench.closed == [True, True]


def test_a_drive_that_reboots_is_silent_for_its_time_and_then_idle_without_an_error() -> None:
    bench = armed('kind="drive_reboot"')
    left, began_ns = bench.drives[1], bench.bus_ns - bench.ticks.period_ns
    assert left.due(began_ns + 499_999_999) == ()
    assert len(left.due(began_ns + 500_000_000)) == 2
    assert (left.state, left.errors) == (AxisState.IDLE, AxisError(0))
    assert left.input_torque_shaft == 0.0


# --- bodies ---------------------------------------------------------------------------------------


def inertia_kg(bench: FaultBench) -> float:
    """½ v² (m + 2 I_w / r²) is the kinetic energy: the inertia of a force along the axis."""
    return 2.0 * bench.body.mbar_1 / bench.body.r**2


def test_a_push_accelerates_the_body_by_force_over_mass_while_it_lasts() -> None:
    bench = FaultBench('{kind="push", at_s=0.1, for_s=0.2, robots=["r1"], force_body_N=3.0}')
    bench.run(50)
    assert bench.robot.state.v == 0.0
    bench.run(100)
    assert bench.robot.state.v == pytest.approx(3.0 * 0.2 / inertia_kg(bench), rel=1e-9)
    bench.run(50)
    assert bench.robot.state.v == pytest.approx(3.0 * 0.2 / inertia_kg(bench), rel=1e-9)
    assert bench.torques == (0.0, 0.0)


def test_a_pushed_torque_turns_the_body() -> None:
    bench = FaultBench('{kind="push", at_s=0.0, force_body_N=0.0, torque_body_N_m=0.1}')
    bench.run(100)
    inertia_kg_m2 = 2.0 * bench.body.mbar_2 * bench.body.b**2 / bench.body.r**2
    assert bench.robot.state.omega == pytest.approx(0.1 * 0.2 / inertia_kg_m2, rel=1e-9)
    assert bench.robot.state.v == pytest.approx(0.0, abs=1e-12)


def test_two_pushes_add_and_the_end_of_one_leaves_the_other() -> None:
    bench = FaultBench(
        '{kind="push", at_s=0.0, force_body_N=3.0}',
        '{kind="push", at_s=0.0, for_s=0.1, force_body_N=-3.0}',
    )
    bench.run(50)
    assert bench.robot.state.v == pytest.approx(0.0, abs=1e-12)
    bench.run(50)
    assert bench.robot.state.v == pytest.approx(3.0 * 0.1 / inertia_kg(bench), rel=1e-9)


def test_a_load_makes_the_body_slower_to_accelerate_and_keeps_its_speed() -> None:
    bench = FaultBench(f'{{kind="payload", {LASTS}, mass_kg=2.0}}')
    bench.arm()
    bench.torque(0.2, 0.2)
    gained = []
    for _ in range(3):
        before = bench.robot.state.v
        bench.run(10)
        gained.append(bench.robot.state.v - before)
    alone = inertia_kg(bench)
    force = 2.0 * 0.2 / 0.04
    wanted = [force * 0.02 / (alone + more) for more in (0.0, 2.0, 0.0)]
    assert gained == pytest.approx(wanted, rel=1e-6)


def test_inertia_and_centre_of_mass_of_a_load_are_felt_in_turns() -> None:
    fault = '{kind="payload", at_s=0.0, for_s=0.1, mass_kg=0.0, inertia_kg_m2=0.02}'
    off_centre = '{kind="payload", at_s=0.2, mass_kg=0.5, com_offset_m=0.03}'
    bench = FaultBench(fault, off_centre)
    free = bench.body.mbar_2
    bench.run(1)
    assert bench.body.mbar_2 == pytest.approx(free + 0.04**2 / (2.0 * 0.1**2) * 0.02)
    bench.run(49)
    bench.run(1)
    assert bench.body.mbar_2 == free
    bench.run(60)
    assert bench.body.c == pytest.approx(0.04**2 * (2.3 + 0.5) * 0.03 / (2.0 * 0.1))


def test_friction_brakes_by_its_factor_on_its_wheel() -> None:
    damped = tuple(text.replace("0.0", "0.02") for text in COASTING[1:])
    fault = '{kind="friction", at_s=0.2, for_s=0.2, factor=4.0}'
    bench = FaultBench(fault, overrides=damped, v_m_s=0.4)
    rate = 0.02 / bench.body.mbar_1
    for factor in (1.0, 4.0, 1.0):
        before = bench.robot.state.v
        bench.run(100)
        assert bench.robot.state.v == pytest.approx(before * exp(-factor * rate * 0.2), rel=1e-6)


def test_friction_of_one_wheel_turns_the_body_to_its_side() -> None:
    damped = tuple(text.replace("0.0", "0.02") for text in COASTING[1:])
    fault = '{kind="friction", at_s=0.0, factor=10.0, wheel="right"}'
    bench = FaultBench(fault, overrides=damped, v_m_s=0.4)
    bench.run(20)
    assert bench.robot.state.omega < -0.1


@presets
def test_a_seized_wheel_is_a_stiff_equation_and_stays_stable(preset: tuple[str, ...]) -> None:
    damped = tuple(text.replace("0.0", "0.02") for text in COASTING[1:])
    bench = FaultBench(
        '{kind="friction", at_s=0.0, factor=1000.0}', overrides=(*damped, *preset), v_m_s=0.4
    )
    bench.run(1)
    assert 0.0 <= bench.robot.state.v < 0.1
    bench.run(50)
    assert bench.robot.divergence is None
    assert bench.robot.state.v == pytest.approx(0.0, abs=1e-6)


def test_a_wheel_of_another_radius_turns_by_it_while_the_body_goes_on() -> None:
    bench = FaultBench(f'{{kind="wheel_radius", {LASTS}, factor=0.8}}', v_m_s=0.4)
    for factor in (1.0, 0.8, 1.0):
        before = bench.wheels()[0][0]
        bench.run(10)
        (angle, speed), _ = bench.wheels()
        assert bench.robot.state.v == pytest.approx(0.4)
        assert speed == pytest.approx(REV_S / factor)
        assert angle - before == pytest.approx(0.02 * REV_S / factor)


@mountings
def test_a_wheel_that_slips_turns_faster_than_it_rolls_and_drives_by_its_torque(
    mounting: tuple[str, ...],
) -> None:
    bench = FaultBench(f'{{kind="wheel_slip", {LASTS}, ratio=0.2}}', overrides=mounting, v_m_s=0.4)
    bench.arm()
    bench.torque(0.1, 0.1)
    bench.run(10)
    before = bench.robot.state.v
    bench.run(10)
    state = bench.robot.state
    # (4') of `plant.body`, both wheels driving: (m + 2 I_w/ρ²) v' = 2 τ/r, ρ = 0.8 r.
    inertia = 2.3 + 0.28 + 2.0 * 0.0056 / (0.8 * 0.04) ** 2
    assert state.v - before == pytest.approx(0.02 * 2.0 * 0.1 / 0.04 / inertia, rel=1e-6)
    for _, speed in bench.wheels():
        assert speed == pytest.approx(state.v / 0.4 * REV_S / 0.8)
    bench.run(10)
    for _, speed in bench.wheels():
        assert speed == pytest.approx(bench.robot.state.v / 0.4 * REV_S)


def test_one_wheel_that_slips_turns_the_body_to_its_side() -> None:
    bench = FaultBench('{kind="wheel_slip", at_s=0.0, ratio=0.3, wheel="right"}', v_m_s=0.4)
    bench.arm()
    bench.torque(0.2, 0.2)
    bench.run(50)
    assert bench.robot.state.omega < -0.01
    (right, _), (left, _) = bench.wheels()
    assert right > left


# --- localisation ---------------------------------------------------------------------------------


def poses(bench: FaultBench, ticks: int) -> list[tuple[float, float, float]]:
    """What is told at each tick less the truth."""
    found = []
    for _ in range(ticks):
        tick = bench.now
        bench.faults.begin(tick)
        state = bench.robot.state
        _, _, x, y, theta = bench.robot.pose_fix(tick, tick * bench.ticks.period_ns)
        found.append((x - state.x, y - state.y, theta - state.theta))
        bench.run(1)
    return found


def close(value: tuple[float, ...]) -> object:
    return pytest.approx(value, abs=1e-12)


def test_biased_poses_are_off_by_the_same_while_it_lasts_and_biases_add() -> None:
    bench = FaultBench(
        f'{{kind="localisation_bias", {LASTS}, x_m=0.3, y_m=-0.1, theta_rad=0.2}}',
        '{kind="localisation_bias", at_s=0.03, x_m=1.0}',
        v_m_s=0.4,
    )
    off = poses(bench, 30)
    assert off[9] == (0.0, 0.0, 0.0)
    assert off[10] == off[14] == close((0.3, -0.1, 0.2))
    assert off[19] == close((1.3, -0.1, 0.2))
    assert off[20] == close((1.0, 0.0, 0.0))


def test_a_pose_jumps_once() -> None:
    bench = FaultBench('{kind="localisation_jump", at_s=0.02, x_m=0.5, theta_rad=1.0}')
    off = poses(bench, 20)
    assert off[10] == close((0.5, 0.0, 1.0))
    assert off[:10] + off[11:] == 19 * [(0.0, 0.0, 0.0)]


def test_poses_drift_at_their_rate_and_are_right_again() -> None:
    bench = FaultBench(
        f'{{kind="localisation_drift", {LASTS}, x_m_s=0.5, y_m_s=-1.0, theta_rad_s=0.1}}'
    )
    off = poses(bench, 30)
    for n in range(10):
        since_s = n * bench.h
        assert off[10 + n] == close((0.5 * since_s, -since_s, 0.1 * since_s))
    assert off[20] == (0.0, 0.0, 0.0)
