"""Regularity, turning radius and spacing, against circles and lines."""

import numpy as np
import pytest

from configs.loading import loads
from configs.scenario import Scenario
from fleetloop.check.coordination import forecast
from fleetloop.check.course import courses
from fleetloop.check.finding import Finding
from fleetloop.check.geometry import closest, geometry_findings

FILE = """schema = 1
name = "x"
duration_s = 20.0
clock = { control_period_s = 0.01, countdown_s = 0.6 }
control = { law = "adaptive_dsc_robust", k4 = 0.18 }
coordination = { v_hat_0 = 0.6 }
path = { kind = "circle", radius_m = 3.0 }
[[robot]]
name = "r1"
pose = { x_m = 3.0, y_m = 0.0 }
[[robot]]
name = "r2"
pose = { x_m = 2.0, y_m = 0.0 }
s_0 = %s
offset = { kind = "structure", left_m = %s }
"""


def scenario_of(left_m: float, s_0: float = 0.0) -> Scenario:
    return loads("file.toml", FILE % (s_0, left_m))


def found(scenario: Scenario) -> dict[tuple[str, tuple[str, ...]], Finding]:
    ahead = forecast(scenario)
    findings = geometry_findings(scenario, courses(scenario, ahead), ahead)
    return {(finding.title, finding.robots): finding for finding in findings}


def test_an_offset_to_the_inside_takes_its_length_from_the_radius() -> None:
    findings = found(scenario_of(1.0))
    assert findings["smallest turning radius", ("r1",)].value == "3 m"
    assert findings["smallest turning radius", ("r2",)].value == "2 m"
    assert findings["regular path", ("r2",)].value == "v̄_d ≥ 0.667"


def test_a_circle_smaller_than_the_robot_is_warned_of() -> None:
    radius = found(scenario_of(2.95))["smallest turning radius", ("r2",)]
    assert (radius.level, radius.key) == ("warning", "robot.r2.offset")


def test_offsets_are_the_spacing_and_discs_must_not_overlap() -> None:
    spacing = found(scenario_of(1.0))["spacing of robots", ()]
    assert (spacing.level, spacing.value.partition(";")[0]) == ("ok", "1 m at equal s")
    spacing = found(scenario_of(0.2))["spacing of robots", ()]
    assert (spacing.level, spacing.limit[:8]) == ("warning", "≥ 0.28 m")


def test_robots_one_behind_the_other_meet_where_they_come_abreast() -> None:
    spacing = found(scenario_of(0.0, s_0=1.0))["spacing of robots", ()]
    assert spacing.level == "warning"


def test_the_closest_pair_is_by_size() -> None:
    places = np.array([[[0.0, 0.0]], [[1.0, 0.0]], [[3.0, 0.0]]])
    assert closest(places, np.array([0.1, 0.1, 0.1])) == (1.0, (0, 1))
    assert closest(places, np.array([0.1, 0.1, 1.8])) == (2.0, (1, 2))
    assert closest(places[:, :, ::-1], np.array([0.1, 0.1, 0.1]))[0] == pytest.approx(1.0)
