"""Regular paths, Assumption 2.4: found wherever they stand still, and nowhere else."""

from math import atan2, hypot

import pytest

from agents.paths import Reference
from configs.errors import ScenarioError
from configs.loading import load, loads
from fleetloop.check.coordination import forecast
from fleetloop.check.course import courses, refuse_irregular, slowest_place

CIRCLE = 'schema = 1\nname = "x"\n[path]\nkind = "circle"\nradius_m = 2.0\n'
ROBOT = '[[robot]]\nname = "r1"\npose = {{ x_m = 2.0, y_m = 0.0 }}\noffset = {}\n'


def refuse(text: str) -> None:
    scenario = loads("file.toml", text)
    refuse_irregular("file.toml", scenario, forecast(scenario))


def test_an_offset_to_the_centre_of_a_circle_is_refused_by_name() -> None:
    offset = '{ kind = "structure", left_m = 2.0 }'
    with pytest.raises(
        ScenarioError, match=r"robot.r1.offset.left_m = 2.0: r1's path stands still"
    ):
        refuse(CIRCLE + ROBOT.format(offset))


def test_an_option_that_moves_a_robot_to_the_centre_is_blamed() -> None:
    text = CIRCLE + ROBOT.format('{ kind = "structure", left_m = 1.0 }')
    overrides = ("path.radius_m=3", "robot.r1.offset.left_m=3")
    scenario = loads("file.toml", text, overrides)
    with pytest.raises(ScenarioError, match=r"^--set robot.r1.offset.left_m=3: r1's path stands"):
        refuse_irregular("file.toml", scenario, forecast(scenario), overrides)


@pytest.mark.parametrize("left_m", [-5.0, 0.0, 1.9, 2.1, 5.0])
def test_other_offsets_on_a_circle_are_regular(left_m: float) -> None:
    refuse(CIRCLE + ROBOT.format(f'{{ kind = "structure", left_m = {left_m} }}'))


def test_an_offset_beyond_the_curvature_of_a_cosine_has_cusps_between_any_samples() -> None:
    cosine = 'schema = 1\nname = "x"\n[path]\nkind = "cosine"\n'
    refuse(cosine + ROBOT.format('{ kind = "structure", left_m = 0.9 }'))
    with pytest.raises(ScenarioError, match="centre of curvature"):
        refuse(cosine + ROBOT.format('{ kind = "structure", left_m = 1.3 }'))


def test_a_spline_that_turns_back_on_a_point_is_blamed_on_its_points() -> None:
    text = 'schema = 1\nname = "x"\n[path]\nkind = "spline"\npoints_m = [[0,0],[1,0],[0,0]]\n'
    text = text.replace("0,0", "0.0, 0.0").replace("1,0", "1.0, 0.0")
    with pytest.raises(ScenarioError, match=r"path\.points_m"):
        refuse(text + ROBOT.format('{ kind = "world" }'))


def test_a_zero_between_two_places_is_found_by_halving() -> None:
    def path(s: float) -> Reference:
        dx, dy = s - 0.123456, 0.0
        return Reference(0.0, 0.0, atan2(dy, dx), hypot(dx, dy), 0.0)

    at, speed = slowest_place(path, [-1.0, 1.0])
    assert speed < 1e-3
    assert at == pytest.approx(0.123456, abs=1e-3)


def test_a_course_has_the_speeds_of_the_forecast() -> None:
    scenario = load("two_robots")
    ahead = forecast(scenario)
    for n, course in enumerate(courses(scenario, ahead)):
        assert course.v == pytest.approx(course.v_bar * ahead.s_dot[:, n])
        assert course.robot.name == scenario.names[n]
