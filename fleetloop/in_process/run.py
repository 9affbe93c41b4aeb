"""The reference: the same buses, robots, agents and codecs as in the processes, in one plain loop.

What the processes do with sockets and sessions happens here by calls, in the same order and through
the same bytes, so a run over processes must leave the same record, bit for bit.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Protocol

from agents.agent import Agent
from agents.inputs import LoggedAgent
from agents.status import Narrator
from bridge.network.inputs import InputBuffer
from bridge.network.messages import LeaderSpeed, Progress
from bridge.network.telemetry import PLANT_ROW, FrameBuffer, RowBuffer, row_of
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import Stop, settled_memory
from configs.brief import AgentBrief, LeaderBrief, PlantBrief
from configs.edges import hearer
from configs.events import Event
from configs.faults.base import PlannedFault
from configs.roles import AGENT, PLANT
from fleetloop.in_process.controller_port import Controller, ControllerPort
from fleetloop.in_process.exchange import Exchange
from fleetloop.record.writer import Source
from fleetloop.robot_states import RobotBoard, RobotState
from plant.bus.build import build_buses
from plant.herald import Herald
from plant.robot import EmulatedRobot, emulated_robot
from plant.status import PlantMeter
from plant.troubles import diverged_robots, divergences

PROGRESS_EVERY_TICKS = 256


class Keeper(Protocol):
    """Takes rows and traffic as they come; a `BackgroundWriter` is one."""

    def add(self, robot: str, source: Source, first_tick: int, rows: bytes) -> None:
        """Take the rows of consecutive ticks."""

    def end(self, robot: str, source: Source) -> None:
        """Nothing follows from this source."""

    def traffic(self, bus: str, frames: bytes) -> None:
        """Take what crossed a bus."""

    def inputs(self, robot: str, first: int, block: bytes, final: bool) -> None:
        """Take a block of a controller's input log."""


class InProcessRun:
    """All robots of a scenario in this process, without network or bus."""

    def __init__(
        self,
        plant: PlantBrief,
        agents: list[AgentBrief],
        leader: LeaderBrief,
        writer: Keeper,
        on_progress: Callable[[Progress], None],
        on_event: Callable[[Event], None] = lambda _: None,
        *,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._board = RobotBoard({brief.robot: brief.bus for brief in plant.robots})
        self._clock = clock
        self._schedule = plant.schedule
        self._robots = [emulated_robot(brief) for brief in plant.robots]
        self._truths = [
            RowBuffer(PLANT_ROW, partial(_write, writer, robot.brief.robot, "plant"))
            for robot in self._robots
        ]
        self._telemetry = [
            RowBuffer(row_of(brief.signals), partial(_write, writer, brief.robot, "controller"))
            for brief in agents
        ]
        self._inputs = {
            brief.robot: InputBuffer(partial(writer.inputs, brief.robot))
            for brief in agents
            if brief.logs_inputs
        }
        self._agents = [
            LoggedAgent(brief, rows, self._inputs[brief.robot])
            if brief.logs_inputs
            else Agent(brief, rows)
            for brief, rows in zip(agents, self._telemetry, strict=True)
        ]
        for agent in self._agents:
            agent.guard.announce = on_event
        period_ns = plant.schedule.period_ns
        self._herald = Herald(lambda _: divergences(self._robots, period_ns), on_event)
        self._on_progress = on_progress
        self._exchange = exchange = Exchange(
            plant.schedule, self._robots, self._agents, self._truths
        )

        def begin(group: Sequence[EmulatedRobot]) -> Callable[[int], None]:
            return partial(exchange.begin, exchange.places(robot.brief.robot for robot in group))

        controllers = {agent.brief.robot: Controller(agent) for agent in self._agents}

        def port(_: str, group: Sequence[EmulatedRobot]) -> ControllerPort:
            return ControllerPort({r.brief.robot: controllers[r.brief.robot] for r in group})

        names = dict.fromkeys(robot.brief.bus for robot in self._robots) if plant.traffic else {}
        self._logs = {bus: FrameBuffer(partial(_write_traffic, writer, bus)) for bus in names}
        self._buses = build_buses(plant, self._robots, port, begin, self._logs)
        for bus in self._buses.values():
            bus.faults.note = self._herald.note
        self._meter = PlantMeter(self._buses, self._robots)
        self._narrators = {agent.brief.robot: Narrator(agent) for agent in self._agents}
        self._steps = [bus.steps() for bus in self._buses.values()]
        for agent in self._agents:
            if agent.brief.leader_link is not None:
                agent.receive_leader_speed(LeaderSpeed(leader.speed_changes))
        self.ticks = 0
        self.wall_s = 0.0
        self._next_tick = -self._schedule.countdown_ticks
        self._start_ns = 0

    def robots(self) -> list[RobotState]:
        """What is to be seen of each robot now, in the order of the scenario."""
        tick, board = self._next_tick - 1, self._board
        board.note(PLANT.name, Progress(tick, 0, 0, self._meter.status()))
        for robot, narrator in self._narrators.items():
            board.note(AGENT.process(robot), narrator.progress(tick))
        return board.states()

    @property
    def frames(self) -> dict[str, int]:
        """Frames that would have crossed each bus."""
        return {name: bus.crossed for name, bus in self._buses.items()}

    @property
    def nodes(self) -> dict[str, dict[str, int]]:
        """Frames of the nodes of buses with bit timing, by bus/node and by their fate."""
        return {
            f"{name}/{node}": counts
            for name, bus in self._buses.items()
            for node, counts in bus.node_counts().items()
        }

    @property
    def stopped_robots(self) -> dict[str, str]:
        """Robots that stopped themselves or whose motion diverged, and why."""
        stopped = {
            agent.brief.robot: agent.guard.stop_reason
            for agent in self._agents
            if agent.guard.stop_reason
        }
        return stopped | diverged_robots(self._robots, self._schedule.period_ns)

    @property
    def events(self) -> list[Event]:
        """Events of the plant and of all controllers, each in its order."""
        return self._herald.events + [it for agent in self._agents for it in agent.guard.events]

    @property
    def remarks(self) -> dict[str, list[str]]:
        """Remarks of the controllers on the whole run, in words."""
        remarks = {agent.brief.robot: agent.remarks() for agent in self._agents}
        remarks[PLANT.name] = self._herald.remarks()
        return {robot: said for robot, said in remarks.items() if said}

    @property
    def messages(self) -> dict[str, Mapping[str, Mapping[str, int]]]:
        """Messages on the emulated edges, by hearer, source and fate."""
        return {
            agent.brief.robot: agent.network.counts()
            for agent in self._agents
            if agent.network is not None
        }

    def run(self, stop: Stop, last_tick: int | None = None) -> None:
        """Run from the first tick of the countdown until told to stop, or to a last tick.

        Args:
            stop: ends the run.
            last_tick: None, or beyond it: the closing tick.
        """
        closing = self._schedule.ticks
        with settled_memory():
            self.begin()
            self.go((closing if last_tick is None else min(last_tick, closing)) + 1, stop)
        self.finish()

    def begin(self) -> None:
        """Exchange what is due before the first tick."""
        self._exchange.start()
        self._next_tick = -self._schedule.countdown_ticks

    def go(self, to_tick: int, stop: Stop) -> None:
        """Go on to the tick before this one, or until told to stop."""
        period_ns = self._schedule.period_ns
        for tick in range(self._next_tick, to_tick):
            if stop.requested:
                break
            if tick <= 0:
                self._start_ns = self._clock.monotonic_ns()
            self._tick(tick)
            self._next_tick = tick + 1
            self.ticks = max(tick, 0)
            if tick % PROGRESS_EVERY_TICKS == 0:
                wall_ns = self._clock.monotonic_ns() - self._start_ns
                self._herald.look(tick)
                self._on_progress(Progress(tick, tick * period_ns, wall_ns))
        self._herald.look(self.ticks)
        self.wall_s = (self._clock.monotonic_ns() - self._start_ns) * 1e-9

    def finish(self) -> None:
        """Hand the writer the rest: nothing follows."""
        for rows in (*self._truths, *self._telemetry):
            rows.finish()
        for inputs in self._inputs.values():
            inputs.finish()
        for log in self._logs.values():
            log.finish()

    def order(self, planned: PlannedFault) -> None:
        """Take a fault beside the scenario's; from its tick on it acts as one of them would.

        Raises:
            ValueError: it is a process's; here are none.
        """
        if planned.fault.PLACE == "process":
            raise ValueError(f"{planned.name}: no processes here")
        if planned.fault.PLACE == "plant":
            (bus,) = {r.brief.bus for r in self._robots if r.brief.robot == planned.target}
            self._buses[bus].faults.schedule.add(planned)
            return
        for agent in self._agents:
            if agent.brief.robot == hearer(planned.target):
                agent.faults.schedule.add(planned)

    def _tick(self, tick: int) -> None:
        """One tick of all buses, one after the other: within a tick they don't meet."""
        self._exchange.share(tick)
        for steps in self._steps:
            while next(steps) is not None:
                pass


def _write(
    writer: Keeper,
    robot: str,
    source: Source,
    first: int,
    count: int,
    rows: bytes,
    final: bool,
) -> None:
    if count:
        writer.add(robot, source, first, rows)
    if final:
        writer.end(robot, source)


def _write_traffic(
    writer: Keeper, bus: str, _first: int, count: int, frames: bytes, _final: bool
) -> None:
    if count:
        writer.traffic(bus, frames)
