"""Torque along the path against closed forms, and what limits leave of it."""

from math import pi

import numpy as np
import pytest

from configs.loading import loads
from configs.scenario import Scenario
from fleetloop.check.coordination import forecast
from fleetloop.check.course import courses
from fleetloop.check.finding import Finding
from fleetloop.check.torque import needed, torque_findings
from fleetloop.torque_limits import limits

FILE = """schema = 1
name = "x"
duration_s = 20.0
clock = { control_period_s = 0.01, countdown_s = 0.6 }
control = { law = "adaptive_dsc_robust", k4 = 0.18 }
coordination = { v_hat_0 = 0.6 }
path = { kind = "line" }
robot = [{ name = "r1", pose = { x_m = 0.0, y_m = 0.0 } }]
"""
LIMITED = (
    "drive = { preset = 'limited', velocity_limit_shaft_rev_s = 1000.0, current_limit_A = %s }\n"
)


def scenario_of(*lines: str, path: str = '{ kind = "line" }', law: str = "") -> Scenario:
    return loads("file.toml", scenario_text(*lines, path=path, law=law))


def scenario_text(*lines: str, path: str = '{ kind = "line" }', law: str = "") -> str:
    text = FILE.replace('path = { kind = "line" }', f"path = {path}")
    text = text.replace("k4 = 0.18", f"k4 = 0.18{law}")
    return text + "\n".join(lines)


def finding_of(scenario: Scenario) -> Finding:
    found = torque_findings(scenario, courses(scenario, forecast(scenario)))
    return next(finding for finding in found if finding.title.startswith("wheel torque"))


def most(scenario: Scenario) -> float:
    (course,) = courses(scenario, forecast(scenario))
    return float(needed(scenario, course).torque_wheel_N_m.max())


def test_on_a_line_it_is_damping_times_speed_over_radius() -> None:
    assert most(scenario_of()) == pytest.approx(0.02 * 0.6 / 0.04)


def test_on_a_circle_the_outer_wheel_has_d_v_plus_b_omega_over_r() -> None:
    circle = '{ kind = "circle", radius_m = 2.0 }'
    steady = 0.02 * (0.6 + 0.1 * 0.3) / 0.04
    assert most(scenario_of(path=circle)) == pytest.approx(steady, rel=0.01)  # and centripetal


def test_friction_is_counted_through_the_gear_and_the_disturbance_at_its_largest() -> None:
    geared = scenario_of(
        "mounting = { gear_ratio = 3.0 }",
        "motor = { coulomb_friction_shaft_N_m = 0.01, viscous_friction_shaft_N_m_s = 1e-3 }",
        "drive = { preset = 'realistic' }",
        "disturbance = { amplitude_wheel_N_m = 0.05 }",
    )
    assert most(geared) == pytest.approx(0.3 + 3 * 0.01 + 9 * 1e-3 * 15.0 + 0.05)


def test_a_gear_that_leaves_a_third_of_the_need_is_an_error_with_the_numbers() -> None:
    finding = finding_of(scenario_of(LIMITED % 8.0, "mounting = { gear_ratio = 0.25 }"))
    assert (finding.level, finding.key, finding.robots) == (
        "error",
        "drive.current_limit_A",
        ("r1",),
    )
    assert finding.value.startswith("0.3 N·m at 0.6 m/s")
    assert finding.limit.startswith("≤ 0.1 N·m, gear 0.25")


def test_a_gear_of_ten_is_no_error() -> None:
    strong = scenario_of(LIMITED % 3.0, "mounting = { gear_ratio = 10.0 }")
    assert finding_of(strong).level == "ok"


def test_a_velocity_limit_below_the_speed_is_an_error_that_says_what_it_allows() -> None:
    finding = finding_of(
        scenario_of("drive = { preset = 'limited', velocity_limit_shaft_rev_s = 2.2 }")
    )
    assert (finding.level, finding.key) == ("error", "drive.velocity_limit_shaft_rev_s")
    assert "it allows 0.553 m/s of 0.6" in finding.text


def test_a_velocity_limit_just_above_the_speed_leaves_too_little_torque() -> None:
    # 2.39 rev/s at 0.6 m/s; the limiter leaves (2.6 − 2.39)/6 N·m of the needed 0.3.
    near = scenario_of("drive = { preset = 'limited', velocity_limit_shaft_rev_s = 2.6 }")
    assert finding_of(near).level == "error"


def test_the_laws_and_the_hosts_limits_count_with_ideal_drives_too() -> None:
    assert finding_of(scenario_of(law=", torque_limit_wheel_N_m = 0.2")).level == "error"
    assert (
        finding_of(scenario_of("host = { torque_limit_wheel_N_m = 0.25 }")).key
        == "host.torque_limit_wheel_N_m"
    )
    assert finding_of(scenario_of()).level == "ok"


def test_twice_the_need_is_the_margin() -> None:
    assert finding_of(scenario_of(law=", torque_limit_wheel_N_m = 0.5")).level == "warning"
    assert finding_of(scenario_of(law=", torque_limit_wheel_N_m = 0.61")).level == "ok"


def test_a_bend_that_is_too_tight_for_a_moment_is_a_warning() -> None:
    eight = '{ kind = "figure_eight", half_length_m = 2.0, half_width_m = 1.0 }'
    scenario = scenario_of(path=eight, law=", torque_limit_wheel_N_m = 0.4")
    assert most(scenario) > 0.4
    assert finding_of(scenario).level == "warning"


def test_supply_and_limiter_take_from_the_torque_as_the_shaft_speeds_up() -> None:
    scenario = scenario_of("drive = { preset = 'realistic' }", "mounting = { gear_ratio = 2.0 }")
    by_key = {limit.key: limit for limit in limits(scenario, scenario.robot[0])}
    velocity = by_key["drive.velocity_limit_shaft_rev_s"]
    assert velocity.speed_m_s == pytest.approx(10.0 * 2 * pi / 2.0 * 0.04)
    at_limit = velocity.torque_wheel_N_m - velocity.slope_wheel_N_m_s * velocity.speed_m_s / 0.04
    assert at_limit == pytest.approx(0.0, abs=1e-12)
    supply = by_key["supply.voltage_V"]
    assert supply.torque_wheel_N_m == pytest.approx(2.0 * 0.05 * np.sqrt(0.75) * 24.0 / 0.22)


@pytest.mark.parametrize(("duration_s", "level"), [("20.0", "ok"), ("60.0", "warning")])
def test_motors_that_grow_too_hot_before_the_end_are_warned_of(duration_s: str, level: str) -> None:
    # 0.308 N·m at 0.05 N·m/A, 15 K/W × 0.3 Ω: 171 K in all, the first 75 K after 35 s.
    text = scenario_text("drive = { preset = 'realistic' }\nmotor.winding_resistance_ohm = 0.3\n")
    hot = loads("file.toml", text.replace("duration_s = 20.0", f"duration_s = {duration_s}"))
    found = torque_findings(hot, courses(hot, forecast(hot)))
    (finding,) = [finding for finding in found if finding.title == "motor temperature"]
    assert finding.level == level
    assert "to 100 °C, where derating begins, after 35 s" in finding.text
    # 10 A (120 − T) / 20 K meets T = 25 + 4.5 i² at 4.38 A.
    assert "leaves 0.219 N·m" in finding.text
