"""Current loop, heat and friction of a motor, against the closed forms of (1) to (6)."""

from dataclasses import replace
from math import copysign, exp, isfinite, isnan, log, sqrt
from random import Random
from statistics import fmean, pstdev

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.powertrain_parts import INERTIA, MODEL, motor, motor_model, supply

from configs.brief import WheelDisturbance
from configs.sections import Body
from plant.body import RigidBody, State
from plant.effects import WheelEffects
from plant.integrate import rk4
from plant.motor import Motor

FREE = {"viscous_friction_shaft_N_m_s": 0.0, "coulomb_friction_shaft_N_m": 0.0}
TAU_S, DELAY_S = 1e-3, 1.25e-4
STEPS_S = [0.00005, 0.0001, 0.000125, 0.0003, 0.0005, 0.001, 0.01]
EFFECTS = [
    WheelEffects(torque_stuck=True),
    WheelEffects(torque_factor=0.5),
    WheelEffects(torque_zero=True),
    WheelEffects(torque_factor=-1.0),
    WheelEffects(fet_rise_K=100.0, motor_rise_K=100.0),
]
ANY = st.floats(allow_nan=True, allow_infinity=True) | st.sampled_from([3e38, -3e38, 1e308])


def settled(made: Motor, demand: float, speed: float = 0.0) -> float:
    torque = 0.0
    for _ in range(100):
        torque = made.step(demand, speed, 0.001)
    return torque


# --- current loop ---------------------------------------------------------------------------------


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_step_of_demand_is_followed_after_the_delay_as_a_first_order_lag(step_s: float) -> None:
    made = motor(**FREE)
    for n in range(1, 200):
        made.step(0.2, 0.0, step_s)
        t = n * step_s - DELAY_S
        expected = 4.0 * (1.0 - exp(-t / TAU_S)) if t > 0.0 else 0.0
        assert made.current_A == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("step_s", STEPS_S)
def test_the_torque_of_a_step_is_its_mean_so_its_impulse_is_exact(step_s: float) -> None:
    made = motor(**FREE)
    impulse = sum(made.step(0.2, 0.0, step_s) for _ in range(200)) * step_s
    t = 200 * step_s - DELAY_S
    assert impulse == pytest.approx(0.2 * (t - TAU_S * (1.0 - exp(-t / TAU_S))), rel=1e-9)


@given(st.lists(st.floats(-0.4, 0.4), min_size=1, max_size=8), st.sampled_from([2, 3, 5, 16]))
def test_finer_steps_under_the_same_held_demands_give_the_same_current(
    demands: list[float], finer: int
) -> None:
    coarse, fine = motor(**FREE), motor(**FREE)
    for demand in demands:
        torque = coarse.step(demand, 0.0, 0.0008)
        mean = fmean(fine.step(demand, 0.0, 0.0008 / finer) for _ in range(finer))
        assert mean == pytest.approx(torque, abs=1e-12)
        assert fine.current_A == pytest.approx(coarse.current_A, abs=1e-10)
    assert fine.motor_C == pytest.approx(coarse.motor_C, abs=1e-7)


def test_no_demand_takes_the_current_above_its_limit() -> None:
    made = motor()
    for demand in (1.0, 3e38, float("inf"), -1.0, -3e38):
        settled(made, demand)
        assert made.current_A == pytest.approx(copysign(10.0, demand))


def test_a_wrong_torque_constant_in_the_drive_shows_at_the_wheel_and_not_in_its_estimate() -> None:
    made = motor(torque_constant_N_m_A=0.04, torque_noise_shaft_N_m=0.0, **FREE)
    assert settled(made, 0.2) == pytest.approx(0.16)
    assert made.measure()[0] == pytest.approx(0.2)


def test_above_its_no_load_speed_a_motor_can_not_push() -> None:
    made = motor(**FREE)
    no_load = sqrt(3.0) / 2.0 * 24.0 / 0.05
    assert settled(made, 0.2, 0.9 * no_load) == pytest.approx(0.2)
    assert settled(made, 0.2, no_load) == pytest.approx(0.0, abs=1e-9)
    assert settled(made, 0.2, 1.1 * no_load) < 0.0
    assert settled(made, -0.2, no_load) == pytest.approx(-0.2)


def test_a_bus_without_voltage_gives_no_current() -> None:
    source = supply()
    source.apply(0.0)
    source.step(0.0, 0.0, 0.001)
    made = motor(supply=source, **FREE)
    assert settled(made, 0.5) == 0.0


# --- power and heat -------------------------------------------------------------------------------


@given(st.floats(-0.6, 0.6), st.floats(-60.0, 60.0))
def test_electrical_power_is_mechanical_power_and_heat(demand: float, speed: float) -> None:
    made = motor()
    settled(made, demand, speed)
    heat = 0.22 * made.current_A**2
    assert made.power_W == pytest.approx(0.05 * made.current_A * speed + heat, abs=1e-9)


def test_braking_feeds_the_bus() -> None:
    made = motor()
    settled(made, -0.2, 40.0)
    assert made.power_W == pytest.approx(-0.2 * 40.0 + 0.22 * 16.0)


def test_at_the_rated_current_the_windings_settle_where_derating_begins() -> None:
    made = motor()
    for _ in range(1000):
        made.step(0.25, 0.0, 1.0)
    assert made.motor_C == pytest.approx(25.0 + 15.0 * 0.2 * 25.0)
    assert made.motor_C == pytest.approx(100.0)
    assert made.fet_C == pytest.approx(25.0 + 30.0 * 0.02 * 25.0)


@pytest.mark.parametrize("step_s", [0.0005, 0.01])
def test_heat_rises_and_falls_as_a_first_order_lag_of_a_minute(step_s: float) -> None:
    made = motor(motor_thermal_time_s=2.0, fet_thermal_time_s=1.0)
    settled(made, 0.5)  # let the current settle first
    start = made.motor_C, made.fet_C
    for _ in range(round(2.0 / step_s)):
        made.step(0.5, 0.0, step_s)
    windings, fets = 25.0 + 15.0 * 20.0, 25.0 + 30.0 * 2.0
    assert made.motor_C == pytest.approx(windings + (start[0] - windings) * exp(-1.0), rel=1e-6)
    assert made.fet_C == pytest.approx(fets + (start[1] - fets) * exp(-2.0), rel=1e-6)
    assert (MODEL.motor.motor_thermal_time_s, MODEL.motor.fet_thermal_time_s) == (60.0, 60.0)


def test_at_the_current_limit_it_takes_seventeen_seconds_to_where_derating_begins() -> None:
    made, seconds = motor(), 0.0
    while made.motor_C < 100.0:
        made.step(0.5, 0.0, 0.01)
        seconds += 0.01
    assert seconds == pytest.approx(60.0 * log(300.0 / 225.0), abs=0.05)


# --- friction -------------------------------------------------------------------------------------


def test_a_turning_wheel_loses_coulomb_and_viscous_friction() -> None:
    made = motor()
    assert settled(made, 0.1, 20.0) == pytest.approx(0.1 - 5e-3 - 2e-4 * 20.0, abs=5e-6)
    assert settled(made, 0.1, -20.0) == pytest.approx(0.1 + 5e-3 + 2e-4 * 20.0, abs=5e-6)


@given(st.floats(-4.9e-3, 4.9e-3))
def test_a_resting_wheel_sticks_under_any_torque_below_coulomb_friction(demand: float) -> None:
    assert settled(motor(), demand) == 0.0


def test_a_resting_wheel_breaks_away_with_what_is_above_coulomb_friction() -> None:
    assert settled(motor(), 0.02) == pytest.approx(0.015, rel=1e-3)


@given(st.floats(-50, 50), st.sampled_from(STEPS_S), st.floats(1.0, 20.0))
def test_friction_brings_a_coasting_wheel_to_rest_and_never_reverses_it(
    speed: float, step_s: float, heavier: float
) -> None:
    made = motor()
    for _ in range(50):
        torque = made.step(0.0, speed, step_s)
        after = speed + step_s * torque / (heavier * INERTIA)
        assert abs(after) <= abs(speed)
        assert after * speed >= -1e-15
        speed = after


def test_a_coasting_wheel_comes_to_rest_in_the_time_of_the_closed_form_and_stays() -> None:
    made, speed, seconds = motor(), 5.0, 0.0
    while abs(speed) > 1e-12:
        speed += 0.0005 * made.step(0.0, speed, 0.0005) / INERTIA
        seconds += 0.0005
    # J ν' = −F − b ν from ν_0: t = J/b ln(1 + b ν_0 / F)
    assert seconds == pytest.approx(INERTIA / 2e-4 * log(1.0 + 2e-4 * 5.0 / 5e-3), abs=0.005)
    assert made.step(0.0, 0.0, 0.0005) == 0.0


@given(st.floats(-0.6, 0.6), st.floats(-5, 5) | st.floats(-0.1, 0.1), st.sampled_from(STEPS_S))
def test_friction_never_pushes_a_wheel_the_way_it_goes(
    demand: float, speed: float, step_s: float
) -> None:
    made = motor()
    for _ in range(20):
        torque = made.step(demand, speed, step_s)
        friction = made.torque_shaft_N_m - torque
        speed += step_s * torque / INERTIA
        assert friction * speed >= -1e-15
        assert abs(friction) <= 5e-3 + 2e-4 * abs(speed) + 1e-12


ETSRO = Body(com_offset_m=0.0, damping_right_wheel_N_m_s=0.0, damping_left_wheel_N_m_s=0.0)


@pytest.mark.parametrize("com_offset_m", [0.0, 0.02])
@given(st.floats(-1, 1), st.floats(-8, 8), st.sampled_from(STEPS_S))
def test_friction_at_both_wheels_of_a_body_never_adds_energy(
    com_offset_m: float, v: float, omega: float, step_s: float
) -> None:
    robot = RigidBody(
        replace(ETSRO, com_offset_m=com_offset_m),
        WheelDisturbance(phase_rad=0.0),
    )
    inertia = min(robot.mbar_1, robot.mbar_2)
    model, source = motor_model(coulomb_friction_shaft_N_m=0.05), supply()
    right = Motor(model, inertia, source, Random(1))
    left = Motor(model, inertia, source, Random(2))
    state = State(0.0, 0.0, 0.0, v, omega, 0.0, 0.0)

    def energy(body: State) -> float:
        return robot.mbar_1 * body.v**2 + 0.01 * robot.mbar_2 * body.omega**2

    for _ in range(30):
        speeds = robot.wheel_speeds(state.v, state.omega)
        torques = right.step(0.0, speeds[0], step_s), left.step(0.0, speeds[1], step_s)
        after = rk4(robot, state, *torques, 0.0, step_s)
        assert energy(after) <= energy(state) * (1.0 + 1e-7) + 1e-18
        state = after


def test_a_robot_on_two_wheels_stops_and_does_not_chatter() -> None:
    robot = RigidBody(ETSRO, WheelDisturbance(phase_rad=0.0))
    inertia = min(robot.mbar_1, robot.mbar_2)
    wheels = [Motor(motor_model(), inertia, supply(), Random(n)) for n in (1, 2)]
    state = State(0.0, 0.0, 0.0, 0.2, 1.0, 0.0, 0.0)
    for _ in range(40_000):
        speeds = robot.wheel_speeds(state.v, state.omega)
        torques = [w.step(0.002, speed, 0.0005) for w, speed in zip(wheels, speeds, strict=True)]
        state = rk4(robot, state, *torques, 0.0, 0.0005)
    assert (state.v, state.omega) == pytest.approx((0.0, 0.0), abs=1e-12)


# --- what the drive feels -------------------------------------------------------------------------


def test_the_estimate_is_noisy_and_the_current_comes_in_steps() -> None:
    made = motor()
    settled(made, 0.1234)
    samples = [made.measure() for _ in range(4000)]
    torques = [torque for torque, _ in samples]
    assert fmean(torques) == pytest.approx(0.1234, abs=1e-4)
    assert pstdev(torques) == pytest.approx(1e-3, rel=0.05)
    assert {current for _, current in samples} == {0.01 * 247}
    assert made.current_A == pytest.approx(2.468)


def test_noise_and_steps_may_be_switched_off() -> None:
    made = motor(torque_noise_shaft_N_m=0.0, current_quantum_A=0.0)
    settled(made, 0.1234)
    assert made.measure() == pytest.approx((0.1234, 2.468))


def test_the_same_seed_gives_the_same_noise_and_another_one_another() -> None:
    def noise(seed: int) -> list[float]:
        made = motor(seed)
        return [made.measure()[0] for _ in range(5)]

    assert noise(3) == noise(3) != noise(4)


@given(st.lists(st.tuples(ANY, ANY, st.sampled_from(STEPS_S)), max_size=30), st.data())
def test_nothing_that_is_asked_of_a_motor_makes_it_anything_but_finite(
    steps: list[tuple[float, float, float]], data: st.DataObject
) -> None:
    source = supply(absorbs=data.draw(st.booleans()))
    made = motor(supply=source)
    made.apply(data.draw(st.sampled_from(EFFECTS)), INERTIA)
    for demand, speed, step_s in steps:
        torque = made.step(demand, speed, step_s)
        source.step(made.power_W, made.power_W, step_s)
        values = (torque, made.current_A, made.power_W, made.fet_C, made.motor_C, *made.measure())
        assert all(map(isfinite, values))
        assert not isnan(source.bus_V)
        assert abs(made.current_A) <= 10.0 + 1e-9


# --- faults ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("effects", "torque", "current"),
    [
        (WheelEffects(torque_stuck=True), 0.1, 2.0),
        (WheelEffects(torque_factor=0.5), 0.1, 4.0),
        (WheelEffects(torque_zero=True), 0.0, 0.0),
        (WheelEffects(torque_factor=-1.0), -0.2, 4.0),
        (WheelEffects(fet_rise_K=100.0), 0.2, 4.0),
        (WheelEffects(motor_rise_K=100.0), 0.2, 4.0),
    ],
)
def test_a_fault_changes_what_the_wheel_feels_until_it_is_cleared(
    effects: WheelEffects, torque: float, current: float
) -> None:
    made = motor(**FREE)
    settled(made, 0.1)
    made.apply(effects, INERTIA)
    assert settled(made, 0.2) == pytest.approx(torque)
    assert made.current_A == pytest.approx(current)
    made.apply(WheelEffects(), INERTIA)
    assert settled(made, 0.2) == pytest.approx(0.2)
    assert made.current_A == pytest.approx(4.0)


def test_a_stuck_torque_stays_whatever_is_asked() -> None:
    made = motor(**FREE)
    settled(made, -0.3)
    made.apply(WheelEffects(torque_stuck=True), INERTIA)
    for demand in (0.0, 0.5, 3e38):
        assert settled(made, demand) == pytest.approx(-0.3)


def test_a_motor_under_a_fault_still_balances_its_power() -> None:
    for factor in (0.5, -1.0):
        made = motor(**FREE)
        made.apply(WheelEffects(torque_factor=factor), INERTIA)
        torque = settled(made, 0.2, 30.0)
        assert made.power_W == pytest.approx(torque * 30.0 + 0.22 * 16.0)


def test_an_over_temperature_is_felt_at_once_and_heats_nothing() -> None:
    made = motor()
    made.apply(WheelEffects(fet_rise_K=100.0, motor_rise_K=85.0), INERTIA)
    assert (made.fet_C, made.motor_C) == (125.0, 110.0)
    made.step(0.0, 0.0, 0.001)
    assert (made.fet_C, made.motor_C) == (125.0, 110.0)
    made.apply(WheelEffects(), INERTIA)
    assert (made.fet_C, made.motor_C) == (25.0, 25.0)


def test_a_shaft_behind_a_gear_is_faster_than_any_wheel() -> None:
    # Beyond 10⁶ rad/s, a wheel's bound, the back-EMF goes on growing: full braking current.
    made, slower = motor(**FREE), motor(**FREE)
    made.step(0.0, 4.5e6, 0.001)
    slower.step(0.0, 1.5e6, 0.001)
    assert made.power_W < 2.5 * slower.power_W < 0.0
