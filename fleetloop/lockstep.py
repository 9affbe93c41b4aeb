"""The reference: the same units, agents and codecs as in the processes, in one plain loop.

What the processes do with sockets and sessions happens here by calls, in the same order and through
the same bytes, so a run over processes must leave the same record, bit for bit.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from agents.agent import Agent
from bridge.messages import LeaderSpeed, PathState, PoseFix, Progress
from bridge.process import Stop, settled_memory
from bridge.telemetry import AGENT_ROW, PLANT_ROW, RowBuffer
from configs.brief import AgentBrief, LeaderBrief, PlantBrief
from fleetloop.record.background import BackgroundWriter
from fleetloop.record.writer import Source
from plant.unit import Unit

PROGRESS_EVERY_TICKS = 256


@dataclass(slots=True)
class _Lane:
    """One robot: its body and drives, its controller, its rows."""

    unit: Unit
    agent: Agent
    truth: RowBuffer
    frames: int = 0


class InProcessRun:
    """All robots of a scenario in this process, without network or bus."""

    def __init__(
        self,
        plant: PlantBrief,
        agents: list[AgentBrief],
        leader: LeaderBrief,
        writer: BackgroundWriter,
        on_progress: Callable[[Progress], None],
    ) -> None:
        self._brief = plant
        self._schedule = plant.schedule
        self._units = [Unit(robot) for robot in plant.robots]
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
        self._on_progress = on_progress
        self._period_s = plant.schedule.period_s
        self._lanes = [
            _Lane(unit, agent, truth)
            for unit, agent, truth in zip(self._units, self._agents, self._truths, strict=True)
        ]
        for agent in self._agents:
            if agent.brief.hears_leader:
                agent.take_leader(LeaderSpeed(leader.speed_steps))
        self.ticks = 0
        self.wall_s = 0.0

    @property
    def frames(self) -> dict[str, int]:
        """Frames that would have crossed each bus."""
        return {lane.unit.brief.bus: lane.frames for lane in self._lanes}

    @property
    def stopped_robots(self) -> dict[str, str]:
        """Robots that stopped themselves, and why."""
        return {
            agent.brief.robot: agent.stopped_because
            for agent in self._agents
            if agent.stopped_because
        }

    def run(self, stop: Stop) -> None:
        """Run from the first tick of the countdown to the closing tick, or until told to stop."""
        self._exchange_paths(-1)
        self._localise(-1)
        with settled_memory():
            self._run(stop)
        for rows in (*self._truths, *self._telemetry):
            rows.finish()

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
                self._on_progress(Progress(tick, tick * schedule.period_ns, wall_ns))
        self.wall_s = (time.monotonic_ns() - start_ns) * 1e-9

    def _tick(self, tick: int) -> None:
        """One tick of all robots, one after the other: within a tick they don't meet."""
        schedule, period_s, substeps = self._schedule, self._period_s, self._brief.substeps
        bus_ns = schedule.bus_time_ns(tick)
        t_s = tick * schedule.period_ns * 1e-9
        if schedule.localises(tick):
            self._localise(tick)
        if schedule.shares(tick):
            self._exchange_paths(tick)
        recorded = 0 <= tick < schedule.ticks
        for lane in self._lanes:
            unit, agent, truth = lane.unit, lane.agent, lane.truth
            frames = unit.frames_due(bus_ns)
            hear = agent.hear
            for can_id, data in frames:
                hear(can_id, data, bus_ns)
            answers = agent.step(tick)
            lane.frames += len(frames) + len(answers)
            for frame in answers:
                for reply in unit.hear(frame, bus_ns):
                    hear(*reply, bus_ns)
            if recorded:
                truth.add(tick, unit.row(t_s))
                unit.advance(t_s, period_s, substeps)

    def _localise(self, tick: int) -> None:
        t_ns = max(tick, 0) * self._schedule.period_ns
        for unit, agent in zip(self._units, self._agents, strict=True):
            x, y, theta, *_ = unit.state
            fix = PoseFix.decode(PoseFix(tick, t_ns, x, y, theta).encode())
            if fix is not None:
                agent.take_pose(fix)

    def _exchange_paths(self, tick: int) -> None:
        for agent in self._agents:
            robot = agent.brief.robot
            state = PathState.decode(agent.share(tick).encode())
            if state is not None:
                for hearer in self._hearers[robot]:
                    hearer.take_path(robot, state)


def _write(
    writer: BackgroundWriter,
    robot: str,
    source: Source,
    first: int,
    count: int,
    rows: bytes,
    _: bool,
) -> None:
    if count:
        writer.add(robot, source, first, rows)
