"""The rigid body (2)-(4) and its integration, against closed forms and conservation."""

from dataclasses import replace
from math import cos, exp, inf, nan, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from configs.brief import WheelDisturbance
from configs.sections import Body
from plant.body import RigidBody, State
from plant.divergence import FARTHEST, FASTEST_WHEEL_RAD_S
from plant.integrate import rk4

ETSRO = Body()
UNDISTURBED = WheelDisturbance(amplitude_wheel_N_m=0.0, rate_rad_s=0.5, phase_rad=0.0)
REST = State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def run(
    robot: RigidBody, state: State, right: float, left: float, seconds: float, step=0.001
) -> State:
    for k in range(round(seconds / step)):
        state = rk4(robot, state, right, left, k * step, step)
    return state


def test_derived_constants_are_those_of_the_paper_as_printed() -> None:
    robot = RigidBody(ETSRO, UNDISTURBED)
    mass, inertia = 2.58, 2.3 * 0.02**2 + 2 * 0.28 * 0.01 + 0.01 + 0.004
    m11 = 0.04**2 / 0.04 * (mass * 0.01 + inertia) + 0.0056
    m12 = 0.04**2 / 0.04 * (mass * 0.01 - inertia)
    assert robot.mbar_1 == pytest.approx(m11 + m12)
    assert robot.mbar_2 == pytest.approx(m11 - m12)
    assert robot.c == pytest.approx(0.04**2 * 2.3 * 0.02 / 0.2)


def test_the_second_wheel_may_count_in_the_mass() -> None:
    both = RigidBody(replace(ETSRO, wheels_in_mass=2), UNDISTURBED)
    extra = 0.04**2 / 4 * 0.28  # r² m_w / 4 in m11 and m12 each
    assert both.mbar_1 - RigidBody(ETSRO, UNDISTURBED).mbar_1 == pytest.approx(2 * extra)


def test_equal_torques_from_rest_give_the_closed_form_of_a_first_order_lag() -> None:
    body = replace(ETSRO, com_offset_m=0.0)
    robot = RigidBody(body, UNDISTURBED)
    end = run(robot, REST, 0.05, 0.05, 2.0)
    rate = 0.02 / robot.mbar_1
    final = 0.04 * 0.05 / 0.02
    assert end.v == pytest.approx(final * (1 - exp(-rate * 2.0)), rel=1e-9)
    assert end.x == pytest.approx(final * (2.0 - (1 - exp(-rate * 2.0)) / rate), rel=1e-9)
    assert (end.y, end.theta, end.omega) == (0.0, 0.0, 0.0)
    assert end.right_wheel_rad == pytest.approx(end.x / 0.04, rel=1e-12)


def test_opposite_torques_turn_on_the_spot_with_the_centre_of_mass_on_the_axle() -> None:
    robot = RigidBody(replace(ETSRO, com_offset_m=0.0), UNDISTURBED)
    end = run(robot, REST, 0.05, -0.05, 1.0)
    assert (end.x, end.y, end.v) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    rate = 0.02 / robot.mbar_2
    assert end.omega == pytest.approx(0.04 / 0.1 * 0.05 / 0.02 * (1 - exp(-rate)), rel=1e-9)


@given(st.floats(-2, 2), st.floats(-5, 5))
def test_without_damping_and_torque_energy_stays(v: float, omega: float) -> None:
    robot = RigidBody(
        replace(ETSRO, damping_right_wheel_N_m_s=0.0, damping_left_wheel_N_m_s=0.0), UNDISTURBED
    )
    end = run(robot, REST._replace(v=v, omega=omega), 0.0, 0.0, 0.5)

    # Energy in body speeds: m̄_1 v² + b² m̄_2 ω², up to the factor 1/r².
    def energy(state: State) -> float:
        return robot.mbar_1 * state.v**2 + 0.01 * robot.mbar_2 * state.omega**2

    assert energy(end) == pytest.approx(
        energy(REST._replace(v=v, omega=omega)), rel=1e-6, abs=1e-12
    )


@given(st.floats(0, 0.1), st.floats(0, 0.1), st.floats(-2, 2), st.floats(-5, 5))
def test_damping_with_unequal_sides_never_adds_energy(right, left, v, omega) -> None:
    body = replace(ETSRO, damping_right_wheel_N_m_s=right, damping_left_wheel_N_m_s=left)
    robot = RigidBody(body, UNDISTURBED)
    dv, domega = robot.accelerations(v, omega, 0.0, 0.0)
    power = robot.mbar_1 * v * dv + 0.01 * robot.mbar_2 * omega * domega
    assert power <= 1e-12


def test_the_step_is_of_fourth_order() -> None:
    robot = RigidBody(
        replace(ETSRO, damping_left_wheel_N_m_s=0.01),
        WheelDisturbance(amplitude_wheel_N_m=0.02, rate_rad_s=9.0, phase_rad=0.3),
    )
    start = REST._replace(v=0.5, omega=2.0)
    fine = run(robot, start, 0.06, 0.02, 0.512, 0.001)
    errors = [abs(run(robot, start, 0.06, 0.02, 0.512, step).y - fine.y) for step in (0.064, 0.032)]
    assert 10 < errors[0] / errors[1] < 26


def test_wheel_angles_follow_from_what_the_body_did() -> None:
    robot = RigidBody(ETSRO, UNDISTURBED)
    end = run(robot, REST, 0.06, 0.01, 1.0)
    assert 0.5 * 0.04 / 0.1 * (end.right_wheel_rad - end.left_wheel_rad) == pytest.approx(end.theta)


def test_the_disturbance_is_a_sine_and_a_cosine_from_t_0_on() -> None:
    robot = RigidBody(
        ETSRO, WheelDisturbance(amplitude_wheel_N_m=0.1, rate_rad_s=0.5, phase_rad=2.0)
    )
    assert robot.disturbance(3.0) == pytest.approx((0.1 * sin(3.5), 0.1 * cos(3.5)))
    assert robot.disturbance(-0.1) == (0.0, 0.0)


def test_a_disturbance_acts_like_the_opposite_torque() -> None:
    held = WheelDisturbance(
        amplitude_wheel_N_m=0.05, rate_rad_s=0.0, phase_rad=pi / 4
    )  # constant, equal on both wheels
    torque = 0.05 * sin(pi / 4)
    pushed = run(RigidBody(ETSRO, held), REST, 0.0, 0.0, 1.0)
    driven = run(RigidBody(ETSRO, UNDISTURBED), REST, -torque, -torque, 1.0)
    assert pushed.v == pytest.approx(driven.v, rel=1e-12)


@pytest.mark.parametrize(
    ("v", "omega"), [(1e308, 1e308), (4.1e4, 0.0), (0.0, 4.1e5), (inf, 0.0), (nan, 0.0)]
)
def test_a_step_that_leaves_the_bounds_of_a_motion_leads_nowhere(v: float, omega: float) -> None:
    robot = RigidBody(
        replace(ETSRO, damping_right_wheel_N_m_s=0.0, damping_left_wheel_N_m_s=0.0), UNDISTURBED
    )
    assert rk4(robot, REST._replace(v=v, omega=omega), 0.0, 0.0, 1.5, 0.001) is None


def test_the_fastest_motion_is_that_of_the_fastest_wheel() -> None:
    robot = RigidBody(replace(ETSRO, com_offset_m=0.0, damping_right_wheel_N_m_s=0.0), UNDISTURBED)
    fastest = REST._replace(v=0.0399 * FASTEST_WHEEL_RAD_S)
    assert rk4(robot, fastest, 0.0, 0.0, 0.0, 0.001) is not None
    assert rk4(robot, fastest, 200.0, 200.0, 0.0, 1.0) is None


def test_nobody_drives_further_than_numbers_reach() -> None:
    far = REST._replace(x=FARTHEST, v=1.0)
    assert rk4(RigidBody(ETSRO, UNDISTURBED), far, 0.0, 0.0, 0.0, 0.001) is None


@pytest.mark.parametrize("right_damping", [0.02, 0.05])
def test_wheel_torques_are_the_inverse_of_the_accelerations(right_damping: float) -> None:
    body = RigidBody(replace(ETSRO, damping_right_wheel_N_m_s=right_damping), UNDISTURBED)
    for v, omega, right, left in ((0.6, 0.3, 0.2, -0.1), (-0.4, 2.0, -0.3, 0.5)):
        rates = body.accelerations(v, omega, right, left)
        assert body.wheel_torques(v, omega, *rates) == pytest.approx((right, left))


# --- pushes and wheels that slip ------------------------------------------------------------------

ROLLED = st.tuples(st.floats(0.05, 1.0), st.floats(0.05, 1.0))
MOTION = st.tuples(st.floats(-2, 2), st.floats(-5, 5))
TORQUES = st.tuples(st.floats(-1, 1), st.floats(-1, 1))
MASS_KG, INERTIA_KG_M2, AXLE_KG_M2 = 2.58, 2.3 * 0.02**2 + 2 * 0.28 * 0.01 + 0.01 + 0.004, 0.0056


def energy_J(robot: RigidBody, v: float, omega: float) -> float:
    right, left = robot.wheel_speeds(v, omega)
    rolling = MASS_KG * v * v + INERTIA_KG_M2 * omega * omega
    return 0.5 * (rolling + AXLE_KG_M2 * (right * right + left * left))


@given(MOTION, TORQUES)
def test_with_a_push_of_nothing_and_no_slip_the_general_equations_are_those_of_the_paper(
    motion: tuple[float, float], torques: tuple[float, float]
) -> None:
    plain = RigidBody(ETSRO, UNDISTURBED).accelerations(*motion, *torques)
    general = RigidBody(ETSRO, UNDISTURBED, push=(1e-300, 0.0)).accelerations(*motion, *torques)
    assert general == pytest.approx(plain, rel=1e-9, abs=1e-9)


@given(ROLLED, MOTION, TORQUES, st.tuples(st.floats(-9, 9), st.floats(-1, 1)))
def test_slip_turns_power_of_the_wheels_that_drive_into_heat_and_creates_none(
    rolled: tuple[float, float],
    motion: tuple[float, float],
    torques: tuple[float, float],
    push: tuple[float, float],
) -> None:
    robot = RigidBody(ETSRO, UNDISTURBED, rolled=rolled, push=push)
    v, omega = motion
    v_rate, omega_rate = robot.accelerations(v, omega, *torques)
    speeds, rates = robot.wheel_speeds(v, omega), robot.wheel_speeds(v_rate, omega_rate)
    gained_W = MASS_KG * v * v_rate + INERTIA_KG_M2 * omega * omega_rate
    gained_W += sum(AXLE_KG_M2 * nu * rate for nu, rate in zip(speeds, rates, strict=True))
    passed_on = [(torque - 0.02 * nu) * nu for torque, nu in zip(torques, speeds, strict=True)]
    heat_W = sum(
        (1.0 - share) * max(power, 0.0) for share, power in zip(rolled, passed_on, strict=True)
    )
    given_W = push[0] * v + push[1] * omega + sum(passed_on)
    assert gained_W == pytest.approx(given_W - heat_W, rel=1e-6, abs=1e-6)
    assert heat_W >= 0.0


@given(ROLLED, MOTION, st.floats(0.001, 0.1))
def test_wheels_that_slip_and_brake_take_no_more_than_the_body_had(
    rolled: tuple[float, float], motion: tuple[float, float], brake_N_m_s: float
) -> None:
    body = replace(ETSRO, damping_right_wheel_N_m_s=0.0, damping_left_wheel_N_m_s=0.0)
    robot = RigidBody(body, UNDISTURBED, rolled=rolled)
    state, step_s = REST._replace(v=motion[0], omega=motion[1]), 0.0005
    had = energy_J(robot, *motion)
    taken = 0.0
    for _ in range(100):
        speeds = robot.wheel_speeds(state.v, state.omega)
        before = state
        after = rk4(robot, state, *(-brake_N_m_s * nu for nu in speeds), 0.0, step_s)
        assert after is not None
        state = after
        turned = (
            state.right_wheel_rad - before.right_wheel_rad,
            state.left_wheel_rad - before.left_wheel_rad,
        )
        taken += sum(brake_N_m_s * nu * angle for nu, angle in zip(speeds, turned, strict=True))
    assert taken <= had * (1.0 + 1e-9) + 1e-9
    assert energy_J(robot, state.v, state.omega) <= had * (1.0 + 1e-9) + 1e-9


def test_the_angle_of_a_wheel_that_slips_is_the_integral_of_its_speed() -> None:
    robot = RigidBody(ETSRO, UNDISTURBED, rolled=(0.5, 1.0))
    end = run(robot, REST, 0.05, 0.08, 1.0)
    rolled = REST
    right = left = 0.0
    for k in range(1000):
        after = rk4(robot, rolled, 0.05, 0.08, k * 0.001, 0.001)
        assert after is not None
        speeds = [robot.wheel_speeds(one.v, one.omega) for one in (rolled, after)]
        right += 0.0005 * (speeds[0][0] + speeds[1][0])
        left += 0.0005 * (speeds[0][1] + speeds[1][1])
        rolled = after
    assert (end.right_wheel_rad, end.left_wheel_rad) == pytest.approx((right, left), rel=1e-5)


@given(ROLLED)
def test_no_wheel_turns_less_than_the_least_inertia(rolled: tuple[float, float]) -> None:
    # Kinetic energy in wheel speeds is νᵀ M ν / 2: its least eigenvalue, by a trace and a product.
    robot = RigidBody(ETSRO, UNDISTURBED, rolled=rolled)
    rho_right, rho_left = 0.04 * rolled[0], 0.04 * rolled[1]
    along, turning = MASS_KG / 4.0, INERTIA_KG_M2 / 0.04
    m_right = rho_right**2 * (along + turning) + AXLE_KG_M2
    m_left = rho_left**2 * (along + turning) + AXLE_KG_M2
    across = rho_right * rho_left * (along - turning)
    mean, half = 0.5 * (m_right + m_left), 0.5 * (m_right - m_left)
    least = mean - (half * half + across * across) ** 0.5
    assert robot.least_inertia_wheel_kg_m2 <= least * (1.0 + 1e-9)
