"""One robot of the plant, its two drives armed, and the faults of a scenario that act on it."""

from itertools import count

from support.robot_bench import NOWHERE

from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisState, Command, identifier
from bridge.drives.odrive.node import OdriveNode
from bridge.fault_schedule import FaultSchedule
from bridge.frame import Frame
from configs.loading import load
from configs.resolve import plant_brief
from configs.ticks import Ticks
from plant.faults import BusFaults
from plant.robot import emulated_robot

COASTING = (
    "robot.r1.body.com_offset_m=0.0",
    "robot.r1.body.damping_right_wheel_N_m_s=0.0",
    "robot.r1.body.damping_left_wheel_N_m_s=0.0",
)
"""Nothing brakes or turns the body."""
REALISTIC = (
    'drive.preset="realistic"',
    "motor.coulomb_friction_shaft_N_m=0.0",
    "motor.viscous_friction_shaft_N_m_s=0.0",
)
MIRRORED = (
    "robot.r1.mounting.right_sign=-1",
    "robot.r1.mounting.gear_ratio=4.0",
)


class FaultBench:
    """r1 of two_robots without friction, at 500 Hz, from rest unless it is given a speed."""

    def __init__(self, *faults: str, overrides: tuple[str, ...] = (), v_m_s: float = 0.0) -> None:
        at_rest = (f"robot.r1.v_m_s={v_m_s}", "expect=[]")
        entries = ", ".join(faults)
        scenario = load("two_robots", (f"fault=[{entries}]", *at_rest, *COASTING, *overrides))
        brief = plant_brief(scenario, network=NOWHERE)
        self.robot = emulated_robot(brief.robots[0])
        self.faults = BusFaults(brief.faults, [self.robot], brief.schedule)
        self.ticks = brief.schedule
        self.h = brief.schedule.period_s
        self._count = count()
        self.now = 0
        """The tick that comes next."""
        mounting = brief.robots[0].mounting
        self.gears = (
            mounting.right_sign * mounting.gear_ratio,
            mounting.left_sign * mounting.gear_ratio,
        )

    @property
    def schedule(self) -> FaultSchedule:
        return self.faults.schedule

    @property
    def body(self):
        return self.robot._body

    @property
    def drives(self) -> tuple[OdriveNode, OdriveNode]:
        return self.robot.drives

    @property
    def torques(self) -> tuple[float, float]:
        """(right, left) torque at the wheels over the last tick."""
        return self.robot.row(0.0)[-2:]

    @property
    def demands(self) -> tuple[float, float]:
        """(right, left) torque at the wheels that was asked over the last tick."""
        return self.robot.row(0.0)[-4:-2]

    @property
    def closed(self) -> list[bool]:
        """Which drives are in closed loop."""
        return [drive.state is AxisState.CLOSED_LOOP_CONTROL for drive in self.drives]

    def wheels(self) -> list[tuple[float, float]]:
        """(angle [rev], speed [rev/s]) of each wheel, as its drive reads it."""
        self.robot.update_encoders()
        return [
            (drive.position / gear, drive.velocity / gear)
            for drive, gear in zip(self.drives, self.gears, strict=True)
        ]

    def arm(self) -> None:
        for node in (0, 1):
            self.tell(node, Command.SET_AXIS_STATE, f.ONE_U32.pack(8))

    def torque(self, right_wheel_N_m: float, left_wheel_N_m: float) -> None:
        for node, torque in enumerate((right_wheel_N_m, left_wheel_N_m)):
            data = f.ONE_FLOAT.pack(torque / self.gears[node])
            self.tell(node, Command.SET_INPUT_TORQUE, data)

    def tell(self, node: int, command: Command, data: bytes = b"") -> None:
        self.robot.on_frame(Frame(identifier(node, command), data), self.bus_ns)

    @property
    def bus_ns(self) -> int:
        return Ticks(self.ticks).bus_time_ns(self.now)

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            tick = self.now = next(self._count)
            self.faults.begin(tick)
            self.robot.advance(tick * self.h, self.h, 1)
        self.now += 1
