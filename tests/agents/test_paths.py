"""Reference paths against closed forms and finite differences."""

from dataclasses import replace
from math import cos, hypot, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agents.paths import RobotPath, robot_path
from configs import paths
from configs.curves import formation_offset, reference_path
from configs.loading import load

GATE = load("spline_gate")

CIRCLE = paths.Circle(kind="circle", centre_m=(1.0, -1.0), radius_m=3.0, start_angle_rad=0.4)
PATHS = {
    "line": paths.Line(kind="line", start_m=(1.0, 2.0), heading_rad=0.7),
    "cosine": paths.Cosine(kind="cosine", start_m=(-3.5, 0.0)),
    "circle": CIRCLE,
    "clockwise": replace(CIRCLE, clockwise=True),
    "eight": paths.FigureEight(kind="figure_eight", half_length_m=3.0, half_width_m=1.5),
    "spline": reference_path(GATE.path),
}
OFFSETS = {
    "world": paths.World(kind="world", x_m=0.3, y_m=-2.0),
    "structure": paths.Structure(kind="structure", ahead_m=0.5, left_m=-0.4),
    "varying": formation_offset(GATE.robot[0].offset),
}


def difference(path: RobotPath, s: float, d: float = 1e-5) -> tuple[float, float]:
    a, c = path(s - d), path(s + d)
    return (c.x - a.x) / (2 * d), (c.y - a.y) / (2 * d)


def turned(a: float, b: float) -> float:
    return (b - a + pi) % (2 * pi) - pi


@pytest.mark.parametrize("offset", OFFSETS)
@pytest.mark.parametrize("path", PATHS)
@given(s=st.floats(-2.0, 25.0))
def test_heading_and_rates_are_the_derivatives_of_the_position(
    path: str, offset: str, s: float
) -> None:
    at = robot_path(PATHS[path], OFFSETS[offset])
    here = at(s)
    dx, dy = difference(at, s)
    assert here.v_bar == pytest.approx(hypot(dx, dy), abs=1e-6)  # (10)
    assert here.v_bar * cos(here.theta) == pytest.approx(dx, abs=1e-6)
    assert here.v_bar * sin(here.theta) == pytest.approx(dy, abs=1e-6)
    d = 1e-5
    rate = turned(at(s - d).theta, at(s + d).theta) / (2 * d)
    assert here.omega_bar == pytest.approx(rate, abs=1e-5)  # (11)


def test_the_papers_path_is_a_cosine_shifted_by_the_offset() -> None:
    at = robot_path(PATHS["cosine"], paths.World(kind="world", y_m=2.0))(1.25)
    assert (at.x, at.y) == pytest.approx((1.25 - 3.5, cos(1.25) + 2.0))


def test_a_circle_is_run_at_one_metre_of_arc_per_unit_of_s() -> None:
    at = robot_path(PATHS["circle"], paths.AT_CENTRE)
    assert at(0.7).v_bar == pytest.approx(1.0)
    assert at(0.7).omega_bar == pytest.approx(1 / 3)
    assert robot_path(PATHS["clockwise"], paths.AT_CENTRE)(0.7).omega_bar == pytest.approx(-1 / 3)
    lap = at(6 * pi)
    assert (lap.x, lap.y) == pytest.approx((at(0.0).x, at(0.0).y))


def test_on_a_circle_a_robot_to_the_left_runs_a_smaller_one() -> None:
    at = robot_path(PATHS["circle"], paths.Structure(kind="structure", left_m=1.0))
    for s in (0.0, 2.0, 9.0):
        here = at(s)
        assert hypot(here.x - 1.0, here.y + 1.0) == pytest.approx(2.0)
        assert here.v_bar == pytest.approx(2 / 3)


def test_a_world_offset_moves_the_path_and_nothing_else() -> None:
    plain, moved = (robot_path(PATHS["eight"], o) for o in (paths.AT_CENTRE, OFFSETS["world"]))
    for s in (0.0, 1.0, 5.0):
        assert moved(s).x - plain(s).x == pytest.approx(0.3)
        assert moved(s).y - plain(s).y == pytest.approx(-2.0)
        assert tuple(moved(s))[2:] == pytest.approx(tuple(plain(s))[2:])


def test_a_varying_offset_has_its_knots_values_and_is_constant_outside() -> None:
    line = paths.Line(kind="line")  # on it, the axes of the structure are the world's
    at = robot_path(line, OFFSETS["varying"])
    for knot in GATE.robot[0].offset.knots:
        here = at(knot.s_m)
        assert (here.x - knot.s_m, here.y) == pytest.approx((knot.ahead_m, knot.left_m), abs=1e-9)
    assert at(-30.0).y == pytest.approx(1.0)
    assert at(90.0).y == pytest.approx(1.0)


def test_a_closed_spline_comes_back_and_an_open_one_goes_on_straight() -> None:
    closed = robot_path(PATHS["spline"], paths.AT_CENTRE)
    length = PATHS["spline"].knots_m[-1]
    again, at = closed(1.0 + length), closed(1.0)
    assert (again.x, again.y) == pytest.approx((at.x, at.y))
    text = ("path={kind='spline', points_m=[[0,0],[5,0],[10,1]]}",)
    path = reference_path(load("two_robots", text).path)
    straight = robot_path(path, paths.AT_CENTRE)
    end = path.knots_m[-1]
    a, c, e = straight(end), straight(end + 1.0), straight(end + 2.0)
    assert (e.x - c.x, e.y - c.y) == pytest.approx((c.x - a.x, c.y - a.y))
    assert c.omega_bar == 0.0
