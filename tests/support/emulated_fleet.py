"""Two robots with their controllers, drives and buses in one process, tick by tick."""

from typing import NamedTuple

from support.robot_bench import NOWHERE

from agents.agent import Agent
from agents.guard import Phase
from bridge.drives.odrive.frames import AxisError, AxisState
from bridge.network.telemetry import FRAME_ROW
from configs.loading import load
from configs.resolve import agent_brief, leader_brief, plant_brief
from configs.ticks import Ticks
from fleetloop.in_process.run import InProcessRun
from fleetloop.record.writer import Source
from plant.bus.timed import TimedBus
from plant.robot import EmulatedRobot

SLOW = (
    'control.law="adaptive_dsc_robust"',
    "control.k4=0.3",
    "clock.control_period_s=0.005",
    "clock.countdown_s=0.5",
    "host.rearm=true",
    "host.rearm_after_s=0.2",
    "expect=[]",
)
"""200 Hz, a law that comes back, and a robot that arms again."""


class Passed(NamedTuple):
    """A frame that passed on a bus."""

    t_s: float
    can_id: int
    data: bytes
    of_drive: bool


class Fleet:
    """The robots of two_robots at 200 Hz, `faults` and other overrides beside `SLOW`."""

    def __init__(self, *faults: str, overrides: tuple[str, ...] = ()) -> None:
        scenario = load("two_robots", (*SLOW, *overrides, f"fault=[{', '.join(faults)}]"))
        self.plant = plant_brief(scenario, network=NOWHERE)
        agents = [agent_brief(scenario, name, network=NOWHERE, bus=()) for name in scenario.names]
        self._frames: dict[str, list[bytes]] = {}
        self.run = InProcessRun(
            self.plant, agents, leader_brief(scenario), self, lambda _: None, lambda _: None
        )
        self._next = -self.plant.schedule.countdown_ticks
        self.run.begin()

    # --- what an in-process run tells ------------------------------------------------------------

    def add(self, robot: str, source: Source, first_tick: int, rows: bytes) -> None:
        pass

    def end(self, robot: str, source: Source) -> None:
        pass

    def inputs(self, robot: str, first: int, block: bytes, final: bool) -> None:
        pass

    def traffic(self, bus: str, frames: bytes) -> None:
        self._frames.setdefault(bus, []).append(frames)

    # --- driving it ------------------------------------------------------------------------------

    def until(self, t_s: float) -> "Fleet":
        """All ticks before this time."""
        end = round(t_s / self.plant.schedule.period_s)
        for tick in range(self._next, end):
            self.run._tick(tick)
        self._next = max(self._next, end)
        return self

    def agent(self, robot: str = "r1") -> Agent:
        return next(agent for agent in self.run._agents if agent.brief.robot == robot)

    def phase(self, robot: str = "r1") -> Phase:
        return self.agent(robot).phase

    def robot(self, robot: str = "r1") -> EmulatedRobot:
        return next(one for one in self.run._robots if one.brief.robot == robot)

    def states(self, robot: str = "r1") -> list[AxisState]:
        return [drive.state for drive in self.robot(robot).drives]

    def watchdogs(self, robot: str = "r1") -> list[bool]:
        """Whether the watchdog of each drive, right and left, has disarmed it."""
        expired = AxisError.WATCHDOG_TIMER_EXPIRED
        drives = self.robot(robot).drives
        return [bool(drive.disarm_reason & expired) for drive in drives]

    def happened(self, robot: str = "r1") -> list[str]:
        """Kinds of the events of a robot's controller since it was armed."""
        kinds = [event.kind for event in self.run.events if event.source == robot]
        return [kind for kind in kinds if kind != "armed" and not kind.startswith("fault_")]

    def reasons(self, robot: str = "r1") -> list[str]:
        """Texts of its stops."""
        found = [e for e in self.run.events if e.source == robot and e.kind == "stopped"]
        return [event.text for event in found]

    def bus(self, name: str = "r1") -> TimedBus:
        bus = self.run._buses[name]
        assert isinstance(bus, TimedBus)
        return bus

    def passed(self, bus: str = "r1", can_id: int | None = None) -> list[Passed]:
        """What passed on a bus from tick 0 on, of one identifier or all."""
        for log in self.run._logs.values():
            log._flush(final=False)
        zero_ns = Ticks(self.plant.schedule).bus_time_ns(0)
        rows = FRAME_ROW.iter_unpack(b"".join(self._frames.get(bus, [])))
        return [
            Passed((end_ns - zero_ns) * 1e-9, found, data[:length], bool(flags))
            for end_ns, found, length, flags, data in rows
            if end_ns >= zero_ns and can_id in (None, found)
        ]

    def count(self, from_s: float, to_s: float, can_id: int, bus: str = "r1") -> int:
        """How many frames of one identifier passed in [from_s, to_s)."""
        return sum(from_s <= frame.t_s < to_s for frame in self.passed(bus, can_id))
