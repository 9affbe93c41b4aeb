"""Sections [motor], [encoder] and [supply]: defaults, what is refused, what the plant is told."""

from dataclasses import replace

import pytest
from support.scenario_text import changed

from bridge.drives.odrive.model import AxisModel
from configs.brief import PowertrainModel, RobotBrief
from configs.connections import NetworkLink
from configs.errors import ScenarioError
from configs.loading import load, loads
from configs.resolve import plant_brief

REALISTIC = "drive.preset='realistic'"
NETWORK = NetworkLink("t", "", "", "")


def robots(scenario: str, *overrides: str) -> tuple[RobotBrief, ...]:
    return plant_brief(load(scenario, overrides), network=NETWORK).robots


def model(*overrides: str) -> PowertrainModel:
    robot = robots("two_robots", REALISTIC, *overrides)[0]
    assert not robot.ideal_powertrain
    return robot.powertrain


def test_the_defaults_are_those_of_a_small_robot_on_odrives() -> None:
    motor, encoder, supply = model().motor, model().encoder, model().supply
    assert motor.torque_constant_N_m_A * motor.current_limit_A == pytest.approx(0.5)
    assert (motor.current_loop_s, motor.compute_delay_s) == (0.001, 0.000125)
    assert (motor.viscous_friction_shaft_N_m_s, motor.coulomb_friction_shaft_N_m) == (2e-4, 5e-3)
    assert (motor.torque_noise_shaft_N_m, motor.current_quantum_A) == (1e-3, 0.01)
    assert (motor.motor_thermal_time_s, motor.fet_thermal_time_s) == (60.0, 60.0)
    assert motor.ambient_C == 25.0
    assert (encoder.counts_per_shaft_rev, encoder.pll_bandwidth_rad_s) == (8192, 1000.0)
    assert encoder.pll_rate_Hz == 8000.0
    assert (supply.voltage_V, supply.resistance_ohm, supply.absorbs) == (24.0, 0.1, True)


@pytest.mark.parametrize("preset", ["ideal", "limited"])
def test_the_simpler_presets_have_ideal_motors_and_encoders(preset: str) -> None:
    assert all(robot.ideal_powertrain for robot in robots("paper", f"drive.preset='{preset}'"))


def test_the_realistic_preset_has_the_limits_of_the_limited_one() -> None:
    (limited, *_), (realistic, *_) = (
        robots("two_robots", f"drive.preset='{preset}'") for preset in ("limited", "realistic")
    )
    axis = AxisModel.of(realistic.drive)
    assert replace(axis, preset="limited") == AxisModel.of(limited.drive)
    assert axis.torque_limiters
    assert limited.drive.command_latency_ns == (0, 0)
    assert realistic.drive.command_latency_ns == (100_000, 1_100_000)


def test_the_motor_has_the_torque_constant_and_limit_of_its_drive_if_not_its_own() -> None:
    shared = model("drive.torque_constant_N_m_A=0.08", "drive.current_limit_A=5.0").motor
    assert shared.torque_constant_N_m_A == shared.assumed_torque_constant_N_m_A == 0.08
    assert shared.current_limit_A == 5.0
    own = model("motor.torque_constant_N_m_A=0.045", "motor.current_limit_A=20.0").motor
    assert (own.torque_constant_N_m_A, own.assumed_torque_constant_N_m_A) == (0.045, 0.05)
    assert own.current_limit_A == 20.0


def test_every_robot_of_every_seed_has_a_noise_of_its_own() -> None:
    seeds = [
        robot.powertrain.seed
        for seed in range(4)
        for robot in robots("twelve", REALISTIC, f"seed={seed}")
    ]
    assert len(set(seeds)) == len(seeds) == 48


@pytest.mark.parametrize(
    ("override", "key", "right"),
    [
        ("motor.current_loop_s=0", "motor.current_loop_s", "greater than 0"),
        ("motor.winding_resistance_ohm=-1.0", "motor.winding_resistance_ohm", "greater than 0"),
        ("motor.ambient_C=-300.0", "motor.ambient_C", "greater than -273.15"),
        ("motor.friction=1.0", "motor.friction", "unknown key"),
        ("encoder.counts_per_shaft_rev=0", "encoder.counts_per_shaft_rev", "must be 4 or more"),
        ("encoder.counts_per_shaft_rev=8192.5", "encoder.counts_per_shaft_rev", "whole number"),
        ("encoder.pll_bandwidth_rad_s=4000.0", "encoder.pll_bandwidth_rad_s", "below half"),
        ("encoder.pll_rate_Hz=1.0", "encoder.pll_rate_Hz", "must be 100 or more"),
        ("supply.voltage_V=0.0", "supply.voltage_V", "greater than 0"),
        ("supply.absorbs=1", "supply.absorbs", "true or false"),
        ("drive.preset='real'", "drive.preset", "realistic"),
    ],
)
def test_one_wrong_value_gives_one_line_with_key_and_what_is_right(
    override: str, key: str, right: str
) -> None:
    text = 'schema = 1\nname = "x"\n[[robot]]\nname = "r1"\npose = { x_m = 0.0, y_m = 0.0 }\n'
    with pytest.raises(ScenarioError) as caught:
        loads("file.toml", changed(text, override))
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"file.toml: {key} = ")
    assert right in line
