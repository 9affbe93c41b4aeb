"""The source equation (1) of `plant.supply`, its limits, and what braking does to the bus."""

from math import isfinite, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.powertrain_parts import supply

STEP_S = 0.0005
POWERS = st.floats(-1e9, 1e9)


def test_without_load_the_bus_has_the_open_circuit_voltage() -> None:
    bus = supply(standby_W=0.0)
    bus.step(0.0, 0.0, STEP_S)
    assert (bus.bus_V, bus.right_A, bus.left_A) == (24.0, 0.0, 0.0)


@given(st.floats(-700, 700), st.floats(-700, 700))
def test_what_the_source_gives_is_what_the_drives_take_and_the_resistance_burns(
    right: float, left: float
) -> None:
    bus = supply(standby_W=0.0)
    bus.step(right, left, STEP_S)
    current = bus.right_A + bus.left_A
    assert 24.0 * current == pytest.approx(right + left + 0.1 * current**2, abs=1e-9)
    assert bus.bus_V == pytest.approx(24.0 - 0.1 * current)


def test_the_root_is_the_one_that_holds_at_small_loads() -> None:
    bus = supply(standby_W=0.0)
    bus.step(60.0, 40.0, STEP_S)
    assert bus.bus_V == pytest.approx((24.0 + sqrt(24.0**2 - 40.0)) / 2.0)
    assert bus.right_A / bus.left_A == pytest.approx(1.5)


def test_standby_is_drawn_by_either_drive() -> None:
    bus = supply(standby_W=1.2)
    bus.step(0.0, 0.0, STEP_S)
    assert bus.right_A == bus.left_A == pytest.approx(1.2 / 24.0, rel=1e-3)


def test_at_the_power_limit_the_bus_is_at_half_the_open_circuit_voltage() -> None:
    bus = supply(standby_W=0.0)
    bus.step(720.0, 720.0, STEP_S)  # V_0² / (4 R) = 1440 W
    assert bus.bus_V == pytest.approx(12.0)


def test_beyond_the_power_limit_the_bus_collapses_along_the_line_of_the_source() -> None:
    bus = supply(standby_W=0.0)
    voltages = []
    for power in (1441.0, 1800.0, 2880.0, 1e6):
        bus.step(power, 0.0, STEP_S)
        voltages.append(bus.bus_V)
        assert bus.bus_V == pytest.approx(12.0 * 1440.0 / power)
    assert voltages == sorted(voltages, reverse=True)
    assert voltages[0] == pytest.approx(12.0, rel=1e-2)
    assert voltages[-1] < 0.1
    bus.step(0.0, 0.0, STEP_S)
    assert bus.bus_V == 24.0


def test_a_battery_takes_back_what_braking_gives() -> None:
    bus = supply(standby_W=0.0)
    bus.step(-30.0, -30.0, STEP_S)
    assert bus.bus_V == pytest.approx(24.25, abs=0.01)
    assert bus.right_A < 0.0


def test_a_source_that_does_not_absorb_goes_over_voltage_by_the_energy_of_braking() -> None:
    bus = supply(absorbs=False, standby_W=0.0)
    energy = 0.0
    while bus.bus_V < 30.0:
        bus.step(-20.0, -20.0, STEP_S)
        energy += 40.0 * STEP_S
        assert bus.bus_V**2 == pytest.approx(24.0**2 + 2.0 * energy / 1e-3)
    assert energy == pytest.approx(0.162, abs=40.0 * STEP_S)  # C (30² − 24²) / 2


def test_the_energy_on_the_capacitor_is_drawn_before_the_source_is() -> None:
    bus = supply(absorbs=False, standby_W=1.0)
    for _ in range(8):
        bus.step(-20.0, -20.0, STEP_S)
    high = bus.bus_V
    steps = 0
    while bus.bus_V > 24.0:
        bus.step(0.0, 0.0, STEP_S)
        steps += 1
    assert steps * STEP_S * 2.0 == pytest.approx(0.5e-3 * (high**2 - 24.0**2), abs=4.0 * STEP_S)
    bus.step(0.0, 0.0, STEP_S)
    assert bus.bus_V == pytest.approx(24.0, abs=0.01)


@given(st.booleans(), st.lists(st.tuples(POWERS, POWERS), max_size=20))
def test_the_bus_is_never_negative_nor_anything_but_a_number(
    absorbs: bool, powers: list[tuple[float, float]]
) -> None:
    bus = supply(absorbs=absorbs)
    for right, left in powers:
        bus.step(right, left, STEP_S)
        assert bus.bus_V >= 0.0
        assert all(map(isfinite, (bus.bus_V, bus.right_A, bus.left_A)))


def test_a_stiff_source_does_not_sag() -> None:
    bus = supply(resistance_ohm=0.0)
    bus.step(1e6, 0.0, STEP_S)
    assert bus.bus_V == 24.0


def test_under_and_over_voltage_come_and_go() -> None:
    bus = supply(standby_W=0.0)
    bus.apply(9.0)
    bus.step(0.0, 0.0, STEP_S)
    assert bus.bus_V == 9.0
    bus.apply(32.5)
    bus.step(0.0, 0.0, STEP_S)
    assert bus.bus_V == 32.5
    bus.apply(None)
    bus.step(0.0, 0.0, STEP_S)
    assert bus.bus_V == 24.0
