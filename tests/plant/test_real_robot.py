"""A robot that isn't emulated, in the record."""

from math import isnan

from bridge.network.messages import PoseFix
from bridge.network.telemetry import PLANT_ROW
from configs.sections import Pose
from plant.real_robot import RealRobot


def test_its_truth_is_what_was_said_last_of_its_pose_and_nothing_else() -> None:
    robot = RealRobot("r1", Pose(x_m=1.0, y_m=2.0, theta_rad=0.5))
    assert robot.row(0.25)[:4] == (0.25, 1.0, 2.0, 0.5)
    robot.receive_pose(PoseFix(3, 30, 4.0, 5.0, 0.6))
    row = robot.row(0.5)
    assert row[:4] == (0.5, 4.0, 5.0, 0.6)
    assert all(isnan(value) for value in row[4:])
    assert len(PLANT_ROW.pack(*row)) == PLANT_ROW.size
