"""The port of a bus in one process: its clients are controllers, called when they are asked."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from agents.agent import Agent
from agents.bus_clock import BusClock
from bridge.can_bus.packet import Key, Submitted, Transmitted
from bridge.frame import Frame


class Controller(NamedTuple):
    """A controller and its clock."""

    agent: Agent
    clock: BusClock

    @classmethod
    def of(cls, agent: Agent) -> "Controller":
        """A controller before its first tick."""
        return cls(agent, BusClock(agent.brief.schedule, agent.feedback_since))

    def react(self, received: Sequence[tuple[int, Frame]], asked_ns: int) -> list[Frame]:
        """The answer to a question of a bus time: frames with their bus times."""
        agent, clock = self
        said: list[Frame] = []
        on_frame, due = agent.on_frame, clock.due
        for at_ns, frame in received:
            on_frame(frame.can_id, frame.data, at_ns)
            tick = due(at_ns)
            if tick is not None:
                said += agent.step(tick)
        tick = clock.due_at_end(asked_ns)
        if tick is not None:
            said += agent.step(tick)
        return said


class ControllerPort:
    """The port of a bus whose clients are its robots' controllers, called when they are asked."""

    __slots__ = ("_asked", "_controllers", "_frames", "_pending", "_stamp_ns")

    def __init__(self, controllers: Mapping[str, Controller]) -> None:
        self._controllers = controllers
        self._stamp_ns = 0
        self._frames: Sequence[Frame] = ()
        self._pending: dict[str, list[tuple[int, Frame]]] = {robot: [] for robot in controllers}
        self._asked = ""

    def deliver(self, stamp_ns: int, frames: Sequence[Frame]) -> None:
        """Keep frames for the controllers that are asked next."""
        self._stamp_ns, self._frames = stamp_ns, frames

    def receive(self) -> list[Frame]:
        """The answers of all controllers to the frames that were delivered."""
        stamp_ns, frames = self._stamp_ns, self._frames
        answers: list[Frame] = []
        for agent, clock in self._controllers.values():
            on_frame = agent.on_frame
            tick = None
            for frame in frames:
                on_frame(frame.can_id, frame.data, stamp_ns)
                if tick is None:
                    tick = clock.due(stamp_ns)
                    if tick is not None:
                        answers += agent.step(tick)
            if tick is None:
                tick = clock.due_at_end(stamp_ns)
                if tick is not None:
                    answers += agent.step(tick)
        return answers

    def forward(self, stamp_ns: int, ended: Sequence[Transmitted], asked: str | None) -> None:
        """Keep what each controller hears of frames that ended, and which one is asked."""
        for robot, pending in self._pending.items():
            pending += [p.as_heard_by(robot) for p in ended if p.heard_by(robot)]
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
