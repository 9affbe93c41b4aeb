"""One robot without a network: its controller, its two emulated drives, and what can go wrong."""

from dataclasses import replace

from agents.agent import Agent
from agents.guard import Phase
from agents.inputs import LoggedAgent
from bridge.drives.odrive.frames import AxisState, Command, identifier
from bridge.drives.odrive.model import AxisModel
from bridge.drives.odrive.node import OdriveNode
from bridge.frame import Frame
from bridge.network.inputs import InputBuffer
from bridge.network.messages import PathState, PoseFix
from bridge.network.telemetry import RowBuffer, row_of
from configs.brief import AgentBrief
from configs.connections import NetworkLink
from configs.loading import load
from configs.resolve import agent_brief, plant_brief
from configs.signals import controller_signals
from configs.ticks import Ticks

NOWHERE = NetworkLink("test", "", "", "")
AT_ONCE = "drive.boot_s=0.0"  # a reboot takes no time
BARE = AT_ONCE, "expect=[]"
SCENARIO = load("two_robots", BARE)
SET_TORQUE = 0x0E
ZERO = bytes(4)


class Bench:
    """An agent of two_robots with its two drives standing still, and its neighbour's voice."""

    def __init__(
        self, robot: str = "r2", *overrides: str, log: InputBuffer | None = None, **changes
    ) -> None:
        scenario = load("two_robots", (*BARE, *overrides)) if overrides else SCENARIO
        brief: AgentBrief = agent_brief(scenario, robot, network=NOWHERE, bus=())
        brief = replace(brief, **changes)
        model = AxisModel.of(plant_brief(scenario, network=NOWHERE).robots[0].drive)
        self.rows: list[tuple[float, ...]] = []
        signals = controller_signals(brief.law.load().SIGNALS, scenario.aged(robot))
        self._row = row_of(signals)
        rows = RowBuffer(self._row, self._keep)
        self.agent = Agent(brief, rows) if log is None else LoggedAgent(brief, rows, log)
        self.axes = [OdriveNode(model, 0, 1), OdriveNode(model, 1, 2)]
        self.schedule = brief.schedule
        self.tick_now = -brief.schedule.countdown_ticks
        self.silent: set[int] = set()  # drives that neither say nor hear anything
        self.mute: set[tuple[int, Command]] = set()  # what drives don't say
        self.pose: tuple[float, float, float] | None = (1.95, 0.05, 1.57)  # None: it is silent
        self.agent.receive_pose(PoseFix(-1, 0, 1.95, 0.05, 1.57))
        self.agent.receive_path_state(
            "r1", PathState(-1, -brief.schedule.period_ns, 0.0, 0.6)
        ) if any(edge.speaker == "r1" for edge in brief.hears) else None

    def _keep(self, _first: int, _count: int, rows: bytes, _final: bool) -> None:
        self.rows += self._row.iter_unpack(rows)

    @property
    def now_ns(self) -> int:
        """Bus time of the tick that comes next."""
        return Ticks(self.schedule).bus_time_ns(self.tick_now)

    @property
    def phase(self) -> Phase:
        return self.agent.phase

    @property
    def why(self) -> str:
        return self.agent.guard.stop_reason

    def tick(self) -> list[Frame]:
        """One period: what drives and localisation say, the controller's answer."""
        self.speak()
        frames = list(self.agent.step(self.tick_now))
        self.answer(frames)
        self.tick_now += 1
        return frames

    def speak(self) -> None:
        """What is on the bus and the network before the controller computes."""
        tick, now_ns = self.tick_now, self.now_ns
        for axis in self.axes:
            frames = axis.due(now_ns)
            for frame in frames:
                command = Command(frame.can_id & 0x1F)
                node = axis.node_id
                if node not in self.silent and (node, command) not in self.mute:
                    self.agent.on_frame(frame.can_id, frame.data, now_ns)
        if self.pose is not None and Ticks(self.schedule).localises(tick):
            self.agent.receive_pose(PoseFix(tick, tick * self.schedule.period_ns, *self.pose))

    def answer(self, frames: list[Frame]) -> None:
        """The drives hear the controller."""
        for frame in frames:
            for axis in self.axes:
                if axis.node_id not in self.silent:
                    axis.on_frame(frame, self.now_ns)

    def run(self, ticks: int) -> list[list[Frame]]:
        """Some periods: what was sent in each."""
        return [self.tick() for _ in range(ticks)]

    def until(self, phase: Phase, within: int = 5000) -> list[list[Frame]]:
        """Periods until the controller is in this phase: what was sent in each."""
        sent = []
        while self.phase is not phase:
            assert len(sent) < within, f"{self.phase}: {self.why}"
            sent.append(self.tick())
        return sent

    def drive(self, ticks: int = 1) -> None:
        """The countdown and some ticks of control."""
        self.run(self.schedule.countdown_ticks + ticks)
        assert self.phase is Phase.DRIVING, self.why

    def estop(self, node: int, *, heard: bool = False) -> None:
        """Somebody stops a drive, on the bus or by its own input."""
        frame = Frame(identifier(node, Command.ESTOP), b"")
        self.axes[node].on_frame(frame, self.now_ns)
        if heard:
            self.agent.on_frame(frame.can_id, frame.data, self.now_ns)

    def reboot(self, node: int) -> None:
        """A drive loses its power for a moment: idle, without an error, limits forgotten."""
        axis = self.axes[node]
        axis.on_frame(Frame(identifier(node, Command.SET_AXIS_STATE), b"\1\0\0\0"), self.now_ns)
        axis.on_frame(Frame(identifier(node, Command.REBOOT), b"\0"), self.now_ns)

    def torques(self) -> tuple[float, float]:
        """What the drives ask of their motors."""
        right, left = (axis.torque_demand_shaft(0.0) for axis in self.axes)
        return right, left

    def closed(self) -> list[bool]:
        """Which drives are in closed loop."""
        return [axis.state is AxisState.CLOSED_LOOP_CONTROL for axis in self.axes]


def set_points(frames: list[Frame]) -> list[bytes]:
    """Data of the torque set-points in what was sent."""
    return [frame.data for frame in frames if frame.can_id & 0x1F == SET_TORQUE]


def commands(frames: list[Frame]) -> list[Command]:
    """What was commanded, drive by drive, in order."""
    return [Command(frame.can_id & 0x1F) for frame in frames]
