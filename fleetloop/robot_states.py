"""What is to be seen of each robot of a run: its controller's words, its drives' and its bus's.

The terminal, `run.status` of the door, `--json-lines` and the live page show the same.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from bridge.network.messages import Progress
from bridge.network.status import BusStatus, ControllerStatus, DriveStatus, PlantStatus, Value
from configs.roles import AGENT, PLANT
from configs.scenario import Scenario


class RobotState(NamedTuple):
    """One robot; None, and "" of texts: not known."""

    robot: str
    phase: str
    """Of its controller: arming, ready, driving, stopped, rearming, left, done. Where the run goes
    on without the controller for a while, held; for good or until another one comes, absent."""
    tick: int | None  # that the controller's words are of
    x_e_m: Value  # path following errors (8)
    y_e_m: Value
    theta_e_rad: Value
    right_wheel_N_m: Value  # torques commanded
    left_wheel_N_m: Value
    neighbour_age_s: Value  # of the oldest of the path states that it has heard
    neighbours: Mapping[str, Value]  # ages by in-neighbour whose edge exists; None: not heard yet
    bus: str
    bus_frames_per_s: Value  # of bus time
    bus_load: Value  # 0 to 1; None: no bit timing
    right_drive: str  # in the words of its protocol
    left_drive: str

    def as_dict(self) -> dict[str, Any]:
        """For JSON, without its name."""
        return {key: value for key, value in self._asdict().items() if key != "robot"}


class RobotBoard:
    """Keeps the last that was said of every robot.

    Args:
        buses: the bus of each robot, in the order of the scenario.
    """

    def __init__(self, buses: Mapping[str, str]) -> None:
        self.robots = tuple(buses)
        self._buses = dict(buses)
        self._said: dict[str, tuple[int, ControllerStatus]] = {}
        self._bus: dict[str, BusStatus] = {}
        self._drives: dict[str, DriveStatus] = {}

    def note(self, process: str, progress: Progress) -> None:
        """Take the progress of a process; what it says of others than itself is left out."""
        match progress.status:
            case ControllerStatus() as status:
                role, _, robot = process.partition("/")
                if role == AGENT.name and robot in self._buses:
                    self._said[robot] = progress.tick, status
            case PlantStatus() as status if process == PLANT.name:
                self._bus = {bus.bus: bus for bus in status.buses}
                self._drives = {drive.robot: drive for drive in status.drives}

    def states(self, absent: Mapping[str, str] | None = None) -> list[RobotState]:
        """All robots, in the order of the scenario.

        `absent`: words instead of the phase, of robots whose controllers don't speak.
        """
        return [self._state(robot, (absent or {}).get(robot, "")) for robot in self._buses]

    def _state(self, robot: str, absent: str) -> RobotState:
        tick, said = self._said.get(robot, (None, _SILENT))
        bus = self._bus.get(self._buses[robot])
        drives = self._drives.get(robot)
        ages_s = {one.neighbour: one.age_s for one in said.heard}
        return RobotState(
            robot=robot,
            phase=absent or said.phase,
            tick=tick,
            x_e_m=said.x_e_m,
            y_e_m=said.y_e_m,
            theta_e_rad=said.theta_e_rad,
            right_wheel_N_m=said.right_wheel_N_m,
            left_wheel_N_m=said.left_wheel_N_m,
            neighbour_age_s=max((a for a in ages_s.values() if a is not None), default=None),
            neighbours=ages_s,
            bus=self._buses[robot],
            bus_frames_per_s=None if bus is None else bus.frames_per_s,
            bus_load=None if bus is None else bus.load,
            right_drive="" if drives is None else drives.right,
            left_drive="" if drives is None else drives.left,
        )


def buses_of(scenario: Scenario) -> dict[str, str]:
    """The bus of each robot."""
    return {robot.name: scenario.bus_of(robot.name) for robot in scenario.robot}


_SILENT = ControllerStatus("", None, None, None, None, None, ())
