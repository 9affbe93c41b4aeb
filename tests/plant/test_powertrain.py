"""The parts of one robot together: one bus for both motors, a noise of its own for each part."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.powertrain_parts import INERTIA, MODEL

from plant.powertrain import Powertrain, powertrain

STEP_S = 0.0005


def built(seed: int = 1, **changes: object) -> Powertrain:
    return powertrain(replace(MODEL, seed=seed, **changes), INERTIA)


def test_either_wheel_feels_its_own_demand() -> None:
    parts = built()
    for _ in range(100):
        torques = parts.step((0.2, -0.1), (0.0, 0.0), STEP_S)
    assert torques == pytest.approx((0.195, -0.095), rel=1e-3)


@given(
    st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
    st.tuples(st.floats(-60, 60), st.floats(-60, 60)),
)
def test_the_source_pays_for_motion_heat_and_standby_of_both_wheels(
    demands: tuple[float, float], speeds: tuple[float, float]
) -> None:
    parts = built()
    for _ in range(100):
        parts.step(demands, speeds, STEP_S)
    supply = parts.supply
    current = supply.right_A + supply.left_A
    power = 2.0 * MODEL.supply.standby_W
    for motor, speed in zip((parts.right_motor, parts.left_motor), speeds, strict=True):
        power += motor.torque_shaft_N_m * speed + 0.22 * motor.current_A**2
    assert MODEL.supply.voltage_V * current == pytest.approx(
        power + MODEL.supply.resistance_ohm * current**2, abs=1e-6
    )


def test_one_wheel_working_hard_lowers_the_bus_of_the_other() -> None:
    parts = built(supply=replace(MODEL.supply, resistance_ohm=2.0))
    parts.step((0.0, 0.0), (0.0, 0.0), STEP_S)
    idle = parts.supply.bus_V
    for _ in range(100):
        parts.step((0.5, 0.0), (40.0, 0.0), STEP_S)
    assert parts.supply.bus_V < idle - 3.0


def test_braking_into_a_source_that_does_not_absorb_ends_in_over_voltage() -> None:
    parts = built(supply=replace(MODEL.supply, absorbs=False))
    for _ in range(200):
        parts.step((-0.2, -0.2), (40.0, 40.0), STEP_S)
    assert parts.supply.bus_V > 30.0


def trace(parts: Powertrain) -> list[object]:
    seen: list[object] = []
    for n in range(50):
        parts.step((0.1, 0.1), (20.0, 20.0), STEP_S)
        seen.append(parts.right_motor.measure())
        seen.append(parts.right_encoder.step(20.0 * n * STEP_S, STEP_S))
    return seen


def test_a_run_is_the_same_by_seed() -> None:
    assert trace(built(5)) == trace(built(5)) != trace(built(6))


def test_no_source_of_noise_depends_on_how_often_another_is_asked() -> None:
    quiet, asked = built(), built()
    for _ in range(10):
        asked.left_motor.measure()
        asked.left_encoder.step(1.0, STEP_S)
    assert trace(quiet) == trace(asked)


def test_right_and_left_have_noises_of_their_own() -> None:
    parts = built()
    assert parts.right_motor.measure() != parts.left_motor.measure()
