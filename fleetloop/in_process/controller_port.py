"""The port of a bus in one process: its clients are controllers, called when they are asked."""

from collections.abc import Mapping, Sequence

from agents.agent import Agent
from agents.bus_clock import BusClock
from bridge.can_bus.packet import Key, Stamped, Submitted, Transmitted
from bridge.frame import Frame
from plant.bus.port import Port


class Controller:
    """A controller, and its clock before its first tick."""

    __slots__ = ("_agent", "_clock")

    def __init__(self, agent: Agent) -> None:
        self._agent = agent
        self._clock = BusClock(agent.brief.schedule, agent.guard.drives)

    def hear(self, stamp_ns: int, frames: list[Frame]) -> Sequence[Frame]:
        """The answer to frames of one bus time."""
        agent, clock = self._agent, self._clock
        said: Sequence[Frame] = ()
        tick = None
        for frame in frames:
            agent.on_frame(frame.can_id, frame.data, stamp_ns)
            if tick is None:
                tick = clock.due(stamp_ns)
                if tick is not None:
                    said = agent.step(tick)
        if tick is None:
            tick = clock.due_at_end(stamp_ns)
            if tick is not None:
                said = agent.step(tick)
        return said

    def react(self, received: Sequence[Stamped], asked_ns: int) -> list[Frame]:
        """The answer to a question of a bus time."""
        agent, clock = self._agent, self._clock
        said: list[Frame] = []
        for heard in received:
            frame, at_ns = heard.frame, heard.end_ns
            agent.on_frame(frame.can_id, frame.data, at_ns)
            tick = clock.due(at_ns)
            if tick is not None:
                said += agent.step(tick)
        tick = clock.due_at_end(asked_ns)
        if tick is not None:
            said += agent.step(tick)
        return said


class ControllerPort(Port):
    """The port of a bus whose clients are its robots' controllers, called when they are asked."""

    __slots__ = ("_asked", "_controllers", "_frames", "_in_order", "_pending", "_stamp_ns")

    def __init__(self, controllers: Mapping[str, Controller]) -> None:
        self._controllers = dict(controllers)
        self._in_order = list(controllers.values())
        self._stamp_ns = 0
        self._frames: list[Frame] = []
        self._pending: dict[str, list[Stamped]] = {robot: [] for robot in controllers}
        self._asked = ""

    def deliver(self, stamp_ns: int, frames: list[Frame]) -> None:
        """Keep frames for the controllers that are asked next."""
        self._stamp_ns, self._frames = stamp_ns, frames

    def receive(self) -> list[Frame]:
        """The answers of all controllers to the frames that were delivered."""
        answers: list[Frame] = []
        for controller in self._in_order:
            answers += controller.hear(self._stamp_ns, self._frames)
        return answers

    def forward(self, stamp_ns: int, ended: Sequence[Transmitted], asked: str | None) -> None:
        """Keep what each controller hears of frames that ended, and which one is asked."""
        for robot, pending in self._pending.items():
            for passed in ended:
                if passed.heard_by(robot):
                    pending.append(passed.as_heard_by(robot))
        self._stamp_ns, self._asked = stamp_ns, asked or ""

    def submitted(self) -> list[Submitted]:
        """The answer of the controller that is asked."""
        robot = self._asked
        received, self._pending[robot] = self._pending[robot], []
        said = self._controllers[robot].react(received, self._stamp_ns)
        return [Submitted(robot, frame) for frame in said]

    def departed(self) -> Sequence[Key]:
        """None: controllers stay."""
        return ()

    def return_credit(self, key: Key, count: int) -> None:
        """Not counted: a controller sends less in a tick than a queue holds."""
