"""A real robot beside emulated ones: its pose from the localisation system is its truth.

Its rows in the record have its last pose, and NaN for everything that isn't measured.
"""

from math import nan

from bridge.network.messages import PoseFix
from configs.reach import within_world
from configs.sections import Pose
from configs.signals import PLANT_SIGNALS

_UNKNOWN = (nan,) * (len(PLANT_SIGNALS) - 4)


class RealRobot:
    """The last pose of one real robot."""

    __slots__ = ("_pose", "robot")

    def __init__(self, robot: str, start: Pose) -> None:
        self.robot = robot
        self._pose = start.x_m, start.y_m, start.theta_rad

    def receive_pose(self, fix: PoseFix | None) -> None:
        """Store a pose of the localisation system; one beyond the world is ignored."""
        if fix is not None and within_world(fix.x_m, fix.y_m, fix.theta_rad):
            self._pose = fix.x_m, fix.y_m, fix.theta_rad

    def row(self, t_s: float) -> tuple[float, ...]:
        """The signals of `configs.signals.PLANT_SIGNALS` at this instant."""
        return (t_s, *self._pose, *_UNKNOWN)
