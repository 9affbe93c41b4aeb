"""What robots and controllers hand each other beside their buses, by calls.

It goes through the same bytes as over the network, in the same order.
"""

from collections.abc import Iterable, Sequence

from agents.agent import Agent
from bridge.network.messages import PathState, PoseFix
from bridge.network.telemetry import RowBuffer
from configs.brief import Schedule
from configs.ticks import Ticks
from plant.robot import EmulatedRobot


class Exchange:
    """Between the robots of a run and their controllers.

    Args:
        schedule: of the run.
        robots: in the order of the scenario.
        agents: their controllers.
        truths: the buffers of their rows.
    """

    def __init__(
        self,
        schedule: Schedule,
        robots: Sequence[EmulatedRobot],
        agents: Sequence[Agent],
        truths: Sequence[RowBuffer],
    ) -> None:
        self._last_tick = schedule.ticks
        self._period_ns = schedule.period_ns
        self._ticks = Ticks(schedule)
        self._agents = list(agents)
        self._places = {
            robot.brief.robot: _Place(robot, agent, truth)
            for robot, agent, truth in zip(robots, agents, truths, strict=True)
        }
        for agent in agents:
            for located in agent.brief.located:
                self._places[located].others.append(agent)
            for edge in agent.brief.hears:
                self._places[edge.speaker].hearers.append(agent)

    def places(self, robots: Iterable[str]) -> "list[_Place]":
        """The places of robots, for `begin`."""
        return [self._places[robot] for robot in robots]

    def start(self) -> None:
        """Exchange what is due before the first tick."""
        self._share(-1)
        for place in self._places.values():
            place.localise(-1, 0)

    def share(self, tick: int) -> None:
        """Exchange path states, if they are due at this tick."""
        if self._ticks.shares(tick):
            self._share(tick)

    def _share(self, tick: int) -> None:
        for agent in self._agents:
            robot = agent.brief.robot
            state = PathState.decode(agent.share(tick).encode())
            if state is not None:
                for hearer in self._places[robot].hearers:
                    hearer.receive_path_state(robot, state)

    def begin(self, places: "list[_Place]", tick: int) -> None:
        """Begin a tick as a plant's process does: rows of the robots, and poses that are due."""
        t_ns = tick * self._period_ns
        for place in places:
            if 0 <= tick < self._last_tick:
                place.robot.record(place.truth, tick, t_ns * 1e-9)
            if self._ticks.localises(tick):
                place.localise(tick, t_ns)


class _Place:
    """One robot, its controller, and who is told where it is and what its path variable is."""

    def __init__(self, robot: EmulatedRobot, agent: Agent, truth: RowBuffer) -> None:
        self.robot = robot
        self.agent = agent
        self.truth = truth
        self.others: list[Agent] = []
        self.hearers: list[Agent] = []

    def localise(self, tick: int, t_ns: int) -> None:
        """Tell where the robot is."""
        fix = PoseFix.decode(self.robot.pose_fix(tick, t_ns).encode())
        if fix is not None:
            self.agent.receive_pose(fix)
            for other in self.others:
                other.receive_place(self.robot.brief.robot, fix)
