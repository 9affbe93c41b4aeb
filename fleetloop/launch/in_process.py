"""The reference: the same units, agents and codecs as in the processes, in one plain loop.

What the processes do with sockets and sessions happens here by calls, in the same order and through
the same bytes, so a run over processes must leave the same record, bit for bit.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from agents.agent import Agent
from agents.bus_clock import BusClock
from bridge.can_bus.packet import Submitted
from bridge.frame import Frame
from bridge.network.messages import LeaderSpeed, PathState, PoseFix, Progress
from bridge.process import Stop, settled_memory
from bridge.telemetry import AGENT_ROW, PLANT_ROW, FrameBuffer, RowBuffer
from configs.brief import AgentBrief, LeaderBrief, PlantBrief
from fleetloop.record.writer import Source
from plant.bus.build import Emulation, emulations
from plant.bus.ideal import IdealBus
from plant.bus.timed import WireBus
from plant.herald import Herald
from plant.robot import Unit, diverged_robots, unit_of

PROGRESS_EVERY_TICKS = 256


class Keeper(Protocol):
    """Takes rows and traffic as they come; a `BackgroundWriter` is one."""

    def add(self, robot: str, source: Source, first_tick: int, rows: bytes) -> None:
        """Take the rows of consecutive ticks."""

    def end(self, robot: str, source: Source) -> None:
        """Nothing follows from this source."""

    def traffic(self, bus: str, frames: bytes) -> None:
        """Take what crossed a bus."""


@dataclass(slots=True)
class _Mind:
    """A controller and its clock."""

    agent: Agent
    clock: BusClock

    @classmethod
    def of(cls, agent: Agent) -> "_Mind":
        """A controller before its first tick."""
        return cls(agent, BusClock(agent.brief.schedule, agent.heard_since))


class _Lane:
    """One bus with the controllers of its robots."""

    __slots__ = ("minds", "name")

    def __init__(self, name: str, units: Sequence[Unit], minds: Mapping[str, _Mind]) -> None:
        self.name = name
        self.minds = {unit.brief.robot: minds[unit.brief.robot] for unit in units}

    @property
    def frames(self) -> int:
        """How many frames crossed the bus."""
        raise NotImplementedError

    def tick(self) -> None:
        """One tick of the bus."""
        raise NotImplementedError


class _IdealLane(_Lane):
    """A bus on which frames take no time."""

    __slots__ = ("_crossed", "_minds", "_steps")

    def __init__(self, name: str, bus: IdealBus, minds: Mapping[str, _Mind]) -> None:
        super().__init__(name, bus.units, minds)
        self._steps = bus.steps()
        self._minds = [(mind.agent, mind.clock) for mind in self.minds.values()]
        self._crossed = 0

    @property
    def frames(self) -> int:
        return self._crossed

    def tick(self) -> None:
        steps = self._steps
        ask = next(steps)
        while ask is not None:
            stamp_ns, frames, *_ = ask
            answers: list[Frame] = []
            for agent, clock in self._minds:
                hear = agent.hear
                tick = None
                for can_id, data in frames:
                    hear(can_id, data, stamp_ns)
                    if tick is None:
                        tick = clock.due(stamp_ns)
                        if tick is not None:
                            answers += agent.step(tick)
                if not frames:
                    answers += agent.step(clock.passed())
            self._crossed += len(frames) + len(answers)
            ask = steps.send(answers)


class _WireLane(_Lane):
    """A bus with bit timing."""

    __slots__ = ("_pending", "_steps", "_wire")

    def __init__(self, name: str, bus: WireBus, minds: Mapping[str, _Mind]) -> None:
        super().__init__(name, bus.units, minds)
        self._wire = bus
        self._steps = bus.steps()
        self._pending: dict[str, list[tuple[int, Frame]]] = {robot: [] for robot in self.minds}

    @property
    def frames(self) -> int:
        return self._wire.crossed

    def tick(self) -> None:
        steps, pending = self._steps, self._pending
        ask = next(steps)
        while ask is not None:
            for robot, heard in pending.items():
                heard += [p.as_heard_by(robot) for p in ask.transmitted if p.heard_by(robot)]
            robot = ask.asked
            heard, pending[robot] = pending[robot], []
            said = _think(self.minds[robot], heard)
            ask = steps.send([Submitted(robot, frame) for frame in said[: self._wire.room(robot)]])


def _lane(name: str, bus: Emulation, minds: Mapping[str, _Mind]) -> _Lane:
    if isinstance(bus, WireBus):
        return _WireLane(name, bus, minds)
    return _IdealLane(name, bus, minds)


def _think(mind: _Mind, heard: Sequence[tuple[int, Frame]]) -> list[Frame]:
    """What a controller says to frames that it hears; to none at all: a tick has passed."""
    agent, clock = mind.agent, mind.clock
    said: list[Frame] = []
    hear, due = agent.hear, clock.due
    for at_ns, (can_id, data) in heard:
        hear(can_id, data, at_ns)
        tick = due(at_ns)
        if tick is not None:
            said += agent.step(tick)
    if not heard:
        said += agent.step(clock.passed())
    return said


class InProcessRun:
    """All robots of a scenario in this process, without network or bus."""

    def __init__(
        self,
        plant: PlantBrief,
        agents: list[AgentBrief],
        leader: LeaderBrief,
        writer: Keeper,
        on_progress: Callable[[Progress], None],
        on_notice: Callable[[str, str], None] = lambda *_: None,
    ) -> None:
        self._schedule = plant.schedule
        self._units = [unit_of(robot) for robot in plant.robots]
        self._truths = [
            RowBuffer(PLANT_ROW, partial(_write, writer, unit.brief.robot, "plant"))
            for unit in self._units
        ]
        self._telemetry = [
            RowBuffer(AGENT_ROW, partial(_write, writer, brief.robot, "controller"))
            for brief in agents
        ]
        self._agents = [
            Agent(brief, rows) for brief, rows in zip(agents, self._telemetry, strict=True)
        ]
        self._hearers = {
            brief.robot: [agent for agent in self._agents if brief.robot in agent.brief.hears]
            for brief in agents
        }
        for agent in self._agents:
            agent.guard.announce = partial(on_notice, agent.brief.robot)
        period_ns = plant.schedule.period_ns
        self._herald = Herald(
            lambda: diverged_robots(self._units, period_ns), partial(on_notice, "plant")
        )
        self._on_progress = on_progress
        ends = dict(zip(self._units, zip(self._agents, self._truths, strict=True), strict=True))

        def begin(group: Sequence[Unit]) -> Callable[[int], None]:
            return partial(self._begin, [(unit, *ends[unit]) for unit in group])

        minds = {agent.brief.robot: _Mind.of(agent) for agent in self._agents}
        names = dict.fromkeys(unit.brief.bus for unit in self._units) if plant.traffic else {}
        self._logs = {bus: FrameBuffer(partial(_write_traffic, writer, bus)) for bus in names}
        taps = {bus: log.add for bus, log in self._logs.items()}
        buses = emulations(plant, self._units, begin, taps)
        self._lanes = [_lane(name, bus, minds) for name, bus in buses.items()]
        for agent in self._agents:
            if agent.brief.hears_leader:
                agent.take_leader(LeaderSpeed(leader.speed_steps))
        self.ticks = 0
        self.wall_s = 0.0

    @property
    def frames(self) -> dict[str, int]:
        """Frames that would have crossed each bus."""
        return {lane.name: lane.frames for lane in self._lanes}

    @property
    def stopped_robots(self) -> dict[str, str]:
        """Robots that stopped themselves or whose motion diverged, and why."""
        stopped = {
            agent.brief.robot: agent.guard.stopped_because
            for agent in self._agents
            if agent.guard.stopped_because
        }
        return stopped | diverged_robots(self._units, self._schedule.period_ns)

    @property
    def notices(self) -> dict[str, list[str]]:
        """What happened between robots and their drives, in words."""
        notices = {agent.brief.robot: agent.notices() for agent in self._agents}
        return {robot: said for robot, said in notices.items() if said}

    def run(self, stop: Stop) -> None:
        """Run from the first tick of the countdown to the closing tick, or until told to stop."""
        self._exchange_paths(-1)
        for unit, agent in zip(self._units, self._agents, strict=True):
            _localise(unit, agent, -1, 0)
        with settled_memory():
            self._run(stop)
        for rows in (*self._truths, *self._telemetry):
            rows.finish()
        for log in self._logs.values():
            log.finish()

    def _run(self, stop: Stop) -> None:
        schedule = self._schedule
        start_ns = time.monotonic_ns()
        for tick in range(-schedule.countdown_ticks, schedule.ticks + 1):
            if stop.requested:
                break
            if tick == 0:
                start_ns = time.monotonic_ns()
            self._tick(tick)
            self.ticks = max(tick, 0)
            if tick % PROGRESS_EVERY_TICKS == 0:
                wall_ns = time.monotonic_ns() - start_ns
                self._herald.look()
                self._on_progress(Progress(tick, tick * schedule.period_ns, wall_ns))
        self.wall_s = (time.monotonic_ns() - start_ns) * 1e-9

    def _tick(self, tick: int) -> None:
        """One tick of all buses, one after the other: within a tick they don't meet."""
        if self._schedule.shares(tick):
            self._exchange_paths(tick)
        for lane in self._lanes:
            lane.tick()

    def _begin(self, group: Sequence[tuple[Unit, Agent, RowBuffer]], tick: int) -> None:
        """As a plant's process does when a tick begins on a bus."""
        schedule = self._schedule
        t_ns = tick * schedule.period_ns
        for unit, agent, truth in group:
            if 0 <= tick < schedule.ticks:
                truth.add(tick, unit.row(t_ns * 1e-9))
            if schedule.localises(tick):
                _localise(unit, agent, tick, t_ns)

    def _exchange_paths(self, tick: int) -> None:
        for agent in self._agents:
            robot = agent.brief.robot
            state = PathState.decode(agent.share(tick).encode())
            if state is not None:
                for hearer in self._hearers[robot]:
                    hearer.take_path(robot, state)


def _localise(unit: Unit, agent: Agent, tick: int, t_ns: int) -> None:
    x, y, theta, *_ = unit.state
    fix = PoseFix.decode(PoseFix(tick, t_ns, x, y, theta).encode())
    if fix is not None:
        agent.take_pose(fix)


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
