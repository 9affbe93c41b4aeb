"""Derived signals against geometry."""

import numpy as np
import pytest

from configs.loading import load
from fleetloop.record.schema import PLANT_SIGNALS
from fleetloop.results.derived import distance, path_distance, polygon_distance

TYPE = np.dtype([("tick", "<i8"), *((signal.name, "<f8") for signal in PLANT_SIGNALS)])


def plant(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    rows = np.zeros(len(x), TYPE)
    rows["x_m"], rows["y_m"] = x, y
    return rows


def test_a_distance_goes_as_far_as_both_records() -> None:
    one = plant(np.array([0.0, 1.0, 2.0]), np.zeros(3))
    other = plant(np.array([3.0, 1.0]), np.array([4.0, 2.0]))
    assert distance(one, other).tolist() == [5.0, 2.0]


def test_the_distance_from_a_polygon_is_that_from_its_nearest_side() -> None:
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]])
    places = np.array([[2.0, 1.0], [-3.0, -4.0], [5.0, 1.0], [4.0, 9.0], [3.9, 0.2]])
    assert polygon_distance(places, corners) == pytest.approx([1.0, 5.0, 1.0, 6.0, 0.1])


def test_a_robot_beside_a_circle_is_as_far_from_it_as_its_radius_differs() -> None:
    scenario = load("two_robots")  # r1 without, r2 with an offset
    path = scenario.path
    assert path.kind == "circle"
    s = np.linspace(0.0, 2.0, 500)
    for robot in ("r1", "r2"):
        from agents.paths import robot_path
        from configs.curves import formation_offset, reference_path

        (own,) = (one for one in scenario.robot if one.name == robot)
        curve = robot_path(reference_path(path), formation_offset(own.offset))
        on = np.array([tuple(curve(float(at)))[:3] for at in s])
        left = np.stack([-np.sin(on[:, 2]), np.cos(on[:, 2])], axis=1)
        for apart in (0.0, 0.05, -0.05):
            x, y = (on[:, :2] + apart * left).T
            found = path_distance(scenario, robot, plant(x, y), s)
            assert found == pytest.approx(np.full(500, abs(apart)), abs=2e-5)


def test_of_a_robot_without_path_variable_nothing_is_known() -> None:
    rows = plant(np.zeros(3), np.zeros(3))
    found = path_distance(load("two_robots"), "r1", rows, np.full(3, np.nan))
    assert np.isnan(found).all()
