"""The controller of an axis: the modes against closed forms, on a wheel that only has inertia."""

from math import exp, pi

import pytest
from drive_bench import MODEL

from bridge.drives.odrive.control import Control
from bridge.drives.odrive.frames import ControlMode, InputMode

DT = 0.001
INERTIA = 0.0074 * 2 * pi  # N·m per rev/s²


def control(mode: ControlMode, how: InputMode = InputMode.PASSTHROUGH) -> Control:
    made = Control(MODEL)
    made.set_modes(mode, how)
    return made


class Wheel:
    """An inertia that the controller turns."""

    def __init__(self, by: Control) -> None:
        self.by = by
        self.position = self.velocity = 0.0
        by.reset(0.0, 0.0)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / DT)):
            torque = self.by.demand(DT, self.position, self.velocity, 1.0)
            self.velocity += DT * torque / INERTIA
            self.position += DT * self.velocity


def test_velocity_control_reaches_its_set_point_at_the_rate_of_its_gain() -> None:
    by = control(ControlMode.VELOCITY)
    by.velocity_integrator_gain = 0.0
    wheel = Wheel(by)
    by.input_velocity = 1.0
    wheel.run(0.3)
    assert wheel.velocity == pytest.approx(1.0 - exp(-0.3 * by.velocity_gain / INERTIA), abs=0.01)
    wheel.run(4.0)
    assert wheel.velocity == pytest.approx(1.0, abs=1e-3)


def test_the_integral_overcomes_a_constant_load() -> None:
    by = control(ControlMode.VELOCITY)
    wheel = Wheel(by)
    by.input_velocity = 1.0
    for _ in range(10_000):
        torque = by.demand(DT, wheel.position, wheel.velocity, 1.0) - 0.05
        wheel.velocity += DT * torque / INERTIA
    assert wheel.velocity == pytest.approx(1.0, abs=1e-3)


def test_position_control_goes_to_its_set_point_and_stays() -> None:
    by = control(ControlMode.POSITION)
    by.position_gain = 2.0
    by.velocity_integrator_gain = 0.0
    wheel = Wheel(by)
    by.input_position = 0.5
    wheel.run(8.0)
    assert wheel.position == pytest.approx(0.5, abs=1e-3)
    assert wheel.velocity == pytest.approx(0.0, abs=1e-3)


def test_a_velocity_ramp_rises_at_its_rate() -> None:
    by = control(ControlMode.VELOCITY, InputMode.VEL_RAMP)
    by.velocity_ramp_rate, by.input_velocity = 2.0, 3.0
    for _ in range(500):
        by.demand(DT, 0.0, 0.0, 1.0)
    assert by.velocity == pytest.approx(1.0)
    for _ in range(2000):
        by.demand(DT, 0.0, 0.0, 1.0)
    assert by.velocity == 3.0


def test_a_torque_ramp_rises_at_its_rate() -> None:
    by = control(ControlMode.TORQUE, InputMode.TORQUE_RAMP)
    by.torque_ramp_rate, by.input_torque = 0.1, 0.4
    demands = [by.demand(DT, 0.0, 0.0, 1.0) for _ in range(5000)]
    assert demands[999] == pytest.approx(0.1)
    assert demands[-1] == pytest.approx(0.4)


@pytest.mark.parametrize(("distance", "seconds"), [(10.0, 10 / 2 + 2 / 0.5), (2.0, 2 * 2.0)])
def test_a_trapezoidal_trajectory_takes_the_time_that_its_limits_give(
    distance: float, seconds: float
) -> None:
    by = control(ControlMode.POSITION, InputMode.TRAP_TRAJ)
    by.input_position, by.arrived = distance, False
    fastest, steps = 0.0, 0
    while not by.arrived and steps < 20_000:
        by.demand(DT, by.position, by.velocity, 1.0)
        fastest = max(fastest, by.velocity)
        steps += 1
    assert steps * DT == pytest.approx(seconds, rel=0.03)
    assert fastest <= 2.0
    assert by.position == distance


@pytest.mark.parametrize("dt", [0.0005, 0.005, 0.02])
def test_the_position_filter_is_critically_damped_at_any_step(dt: float) -> None:
    by = control(ControlMode.POSITION, InputMode.POS_FILTER)
    by.filter_bandwidth, by.input_position = 5.0, 1.0
    places = []
    for _ in range(round(3.0 / dt)):
        by.demand(dt, by.position, by.velocity, 1.0)
        places.append(by.position)
    assert max(places) <= 1.0 + 1e-6
    assert places[-1] == pytest.approx(1.0, abs=1e-3)


def test_in_torque_control_speed_limits_torque_and_current_limits_it_silently() -> None:
    by = control(ControlMode.TORQUE)
    by.input_torque = 5.0
    assert by.demand(DT, 0.0, 0.0, 1.0) == pytest.approx(10.0 * 0.05)
    assert by.demand(DT, 0.0, 9.7, 1.0) == pytest.approx((10.0 - 9.7) / 6)
    assert by.demand(DT, 0.0, 12.0, 1.0) == pytest.approx((10.0 - 12.0) / 6)
    assert by.demand(DT, 0.0, 0.0, 0.25) == pytest.approx(0.125)


def test_arming_forgets_the_integral_and_stays_where_the_wheel_is() -> None:
    by = control(ControlMode.POSITION)
    by.input_position = 5.0
    for _ in range(100):
        by.demand(DT, 0.0, 0.0, 1.0)
    by.reset(2.0, 0.0)
    assert by.demand(DT, 2.0, 0.0, 1.0) == pytest.approx(0.0)
