"""What an axis makes of its measurements: derating, and why it disarms."""

from math import inf, nan

import pytest
from support.odrive_axis import (
    HEALTHY,
    MS,
    arm,
    ask_state,
    asked,
    axis,
    beat,
    floats,
    healthy,
    modes,
    tell,
    torque,
)

from bridge.drives.odrive.frames import AxisError, AxisState, Command, ControlMode, ProcedureResult
from bridge.drives.odrive.node import OdriveNode


def driven(**changes) -> OdriveNode:
    node = arm(axis(watchdog_ns=0, **changes))
    torque(node, 5.0)
    node.update_measurements(HEALTHY)
    return node


@pytest.mark.parametrize(
    ("celsius", "factor"), [(25.0, 1.0), (100.0, 1.0), (105.0, 0.75), (110.0, 0.5), (120.0, 0.0)]
)
@pytest.mark.parametrize("which", ["fet_C", "motor_C"])
def test_the_current_limit_falls_linearly_with_temperature(which, celsius, factor) -> None:
    node = driven()
    node.update_measurements(healthy(**{which: celsius}))
    assert node.torque_demand_shaft(0.001) == pytest.approx(0.5 * factor)
    assert node.state is AxisState.CLOSED_LOOP_CONTROL
    node.update_measurements(HEALTHY)
    assert node.torque_demand_shaft(0.001) == pytest.approx(0.5)


def test_limits_set_while_hot_are_derated() -> None:
    node = driven()
    node.update_measurements(healthy(fet_C=110.0))
    floats(node, Command.SET_LIMITS, 10.0, 4.0)
    assert node.torque_demand_shaft(0.001) == pytest.approx(4.0 * 0.5 * 0.05)


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"fet_C": 125.0}, AxisError.INVERTER_OVER_TEMP),
        ({"motor_C": 125.0}, AxisError.MOTOR_OVER_TEMP),
        ({"fet_C": nan}, AxisError.THERMISTOR_DISCONNECTED),
        ({"bus_V": 9.9}, AxisError.DC_BUS_UNDER_VOLTAGE),
        ({"bus_V": nan}, AxisError.DC_BUS_UNDER_VOLTAGE),
        ({"bus_V": 30.1}, AxisError.DC_BUS_OVER_VOLTAGE),
        ({"current_A": 18.1}, AxisError.CURRENT_LIMIT_VIOLATION),
        ({"current_A": -18.1}, AxisError.CURRENT_LIMIT_VIOLATION),
        ({"current_A": nan}, AxisError.CURRENT_LIMIT_VIOLATION),
    ],
)
def test_what_leaves_its_range_disarms_and_keeps_from_arming_while_it_lasts(changes, error) -> None:
    node = driven()
    node.update_measurements(healthy(**changes))
    assert node.torque_demand_shaft(0.001) == 0.0
    assert beat(node)[:3] == (error, AxisState.IDLE, ProcedureResult.DISARMED)
    tell(node, Command.CLEAR_ERRORS)
    ask_state(node, AxisState.CLOSED_LOOP_CONTROL)
    assert beat(node)[:2] == (error, AxisState.IDLE)
    node.update_measurements(HEALTHY)
    assert beat(node).errors == error  # latched
    tell(node, Command.CLEAR_ERRORS)
    arm(node)


@pytest.mark.parametrize(
    "changes", [{"fet_C": 124.9}, {"bus_V": 10.0}, {"bus_V": 30.0}, {"current_A": 18.0}]
)
def test_what_is_just_within_its_range_does_not_disarm(changes) -> None:
    node = driven()
    node.update_measurements(healthy(**changes))
    assert node.state is AxisState.CLOSED_LOOP_CONTROL


def test_measurements_are_told_on_the_bus() -> None:
    node = driven()
    node.update_encoder(0.0, 2.0)
    node.update_measurements(
        healthy(torque_shaft_N_m=0.4, current_A=8.0, bus_V=23.5, bus_A=2.0, motor_C=41.0)
    )
    node.torque_demand_shaft(0.001)
    assert asked(node, Command.GET_TEMPERATURE) == pytest.approx((30.0, 41.0))
    assert asked(node, Command.GET_BUS_VOLTAGE_CURRENT) == pytest.approx((23.5, 2.0))
    assert asked(node, Command.GET_IQ) == pytest.approx((10.0, 8.0))
    assert asked(node, Command.GET_TORQUES) == pytest.approx((0.5, 0.4))
    assert asked(node, Command.GET_POWERS) == pytest.approx((47.0, 0.4 * 2.0 * 6.2831853))


def test_a_motor_without_thermistor_has_no_temperature() -> None:
    node = driven()
    fet, motor = asked(node, Command.GET_TEMPERATURE)
    assert fet == 30.0
    assert motor != motor


def felt_for(node: OdriveNode, seconds: float, velocity: float, watts: float) -> None:
    """Told to push with 0.5 N·m at an encoder that says `velocity`, drawing `watts`."""
    for k in range(round(seconds * 1000)):
        node.update_encoder(velocity * k * 0.001, velocity)
        node.torque_demand_shaft(0.001)
        node.update_measurements(healthy(torque_shaft_N_m=0.5, current_A=10.0, bus_A=watts / 24.0))


def test_an_encoder_whose_sign_flips_is_found_by_spinout_detection() -> None:
    node = driven()
    felt_for(node, 0.5, -8.0, 30.0)
    assert beat(node)[:2] == (AxisError.SPINOUT_DETECTED, AxisState.IDLE)


def test_without_spinout_detection_it_keeps_driving() -> None:
    node = driven(spinout_power_W=0.0)
    felt_for(node, 0.5, -8.0, 30.0)
    assert node.torque_demand_shaft(0.001) == pytest.approx(0.5)


def test_neither_driving_nor_braking_is_a_spinout() -> None:
    for velocity, watts in ((8.0, 30.0), (-8.0, -20.0)):
        node = driven()
        felt_for(node, 0.5, velocity, watts)
        assert node.state is AxisState.CLOSED_LOOP_CONTROL


def test_an_encoder_that_freezes_goes_unnoticed_and_velocity_mode_pushes_on() -> None:
    node = axis(watchdog_ns=0)
    modes(node, ControlMode.VELOCITY)
    floats(arm(node), Command.SET_INPUT_VEL, 2.0, 0.0)
    for t in range(3000):
        node.update_encoder(1.0, 0.0)
        node.due(t * MS)
        demand = node.torque_demand_shaft(0.001)
    assert demand == pytest.approx(0.5)
    assert node.state is AxisState.CLOSED_LOOP_CONTROL


def test_an_encoder_that_jumps_goes_unnoticed_in_torque_mode() -> None:
    node = arm(axis())
    torque(node, 0.2)
    node.update_encoder(1000.0, 0.0)
    node.due(MS)
    assert node.torque_demand_shaft(0.001) == pytest.approx(0.2)


def test_an_encoder_that_jumps_too_fast_is_an_overspeed() -> None:
    node = arm(axis())
    node.update_encoder(1000.0, -12.1)
    assert node.torque_demand_shaft(0.001) == 0.0
    assert node.errors == AxisError.VELOCITY_LIMIT_VIOLATION


@pytest.mark.parametrize("motion", [(nan, 0.0), (0.0, nan), (inf, 0.0), (0.0, -inf)])
def test_an_encoder_without_a_number_is_a_missing_estimate(motion) -> None:
    node = arm(axis())
    torque(node, 0.2)
    node.update_encoder(*motion)
    assert node.torque_demand_shaft(0.001) == 0.0
    assert node.errors == AxisError.MISSING_ESTIMATE
