"""The lockstep clock: the plant owns time, controllers answer.

    bus's tick k   its robots' poses to Zenoh when the schedule localises; then what
                   `plant.bus.ideal` or `plant.bus.timed` do between questions and answers; and on
                   to its tick k + 1

Robots of different buses meet only in their controllers' messages, for which each controller waits
by tick. So a bus need not wait for all others at every tick: it may be up to `LEAD_TICKS` ahead
of the slowest, which keeps all cores at work and changes no value. Held to a speed, all go tick by
tick together.

Bus time runs from power-up; scenario time is 0 when control starts, after the countdown in which
the controllers arm their drives and the bodies are held as the scenario puts them. The run ends
with one closing tick at which the controllers disarm.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

from bridge.can_bus.hub import Hub
from bridge.network.link import Publisher
from bridge.network.messages import Progress
from bridge.network.telemetry import RowBuffer, Tap
from bridge.process.awake import LOOK_S, STALL_S
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import Stop, launcher_stopped
from configs.brief import LEAD_TICKS, PlantBrief
from configs.errors import InfrastructureError, PeerLostError
from plant.bus.build import build_buses
from plant.bus.port import ALL, Bus
from plant.bus.sockets import SocketPort
from plant.orders import PlantOrders
from plant.robot import EmulatedRobot

REPORT_EVERY_NS = 100_000_000
WAIT_S = LOOK_S
"""Longest wait for an answer before absent controllers are looked for."""
_STALL_NS = int((LOOK_S + STALL_S) * 1e9)
ANSWER_SHARE = 0.9
"""Part of the tick deadline that the plant waits for answers: before that, controllers name a
silent peer; after it, the launcher names the plant."""


@dataclass(slots=True)
class PlantCounters:
    """The cost of the run, for the summary."""

    ticks: int = 0
    wall_ns: int = 0
    waited_ns: int = 0
    overruns: int = 0
    frames: dict[str, int] = field(default_factory=dict)
    nodes: dict[str, dict[str, int]] = field(default_factory=dict)  # of wires, by bus/node

    def add_nodes(self, bus: str, counts: Mapping[str, dict[str, int]]) -> None:
        """Add the nodes of a bus."""
        self.nodes |= {f"{bus}/{node}": of_node for node, of_node in counts.items()}


class _Lane:
    """One bus on its way through the ticks."""

    __slots__ = ("asked", "asked_ns", "bus", "done", "robots", "steps", "tick")

    def __init__(self, bus: Bus, tick: int) -> None:
        self.bus = bus
        self.steps = bus.steps()
        self.robots = [robot.brief.robot for robot in bus.robots]
        self.tick = tick
        self.asked = ALL
        self.asked_ns = 0  # when it was asked to answer; 0: it is not asked
        self.done = False


class _Ends(NamedTuple):
    """The outputs of a robot's pose and truth."""

    pose: Publisher
    rows: RowBuffer


class LockstepLoop:
    """Runs all robots of a plant against the controllers on the hub's buses."""

    def __init__(
        self,
        brief: PlantBrief,
        robots: Sequence[EmulatedRobot],
        hub: Hub,
        poses: Sequence[Publisher],
        rows: Sequence[RowBuffer],
        report: Callable[[Progress], None],
        taps: Mapping[str, Tap],
        orders: PlantOrders | None = None,
        *,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._clock = clock
        self._orders = orders
        self._schedule = schedule = brief.schedule
        self._period_ns, self._ticks = schedule.period_ns, schedule.ticks
        self._tick_wall_ns = int(schedule.period_ns / brief.speed) if brief.speed > 0.0 else 0
        self._window = 0 if self._tick_wall_ns else LEAD_TICKS
        self._limit_s = ANSWER_SHARE * schedule.tick_deadline_s
        self._hub = hub
        self._report = report
        first = -schedule.countdown_ticks
        ends = {
            robot: _Ends(pose, truth)
            for robot, pose, truth in zip(robots, poses, rows, strict=True)
        }

        def begin(group: Sequence[EmulatedRobot]) -> Callable[[int], None]:
            return partial(self._begin, [(robot, ends[robot]) for robot in group])

        self.buses = build_buses(
            brief, robots, lambda name, _: SocketPort(name, hub, hub), begin, taps
        )
        """By name."""
        self._lanes = {name: _Lane(bus, first) for name, bus in self.buses.items()}
        self._slowest = first
        self._at_slowest = len(self._lanes)
        self._held: list[_Lane] = []
        self._start_ns = 0
        self.counters = PlantCounters()

    def run(self, stop: Stop) -> None:
        """Run from the first tick of the countdown to the closing tick, or until told to stop.

        Raises:
            InfrastructureError: a controller did not answer within the tick deadline.
            PeerLostError: a controller left its bus.
        """
        self._start_ns = now_ns = next_report_ns = self._clock.monotonic_ns()
        hub = self._hub
        for lane in self._lanes.values():
            self._go_on(lane, now_ns)
        orders = self._orders.waiting if self._orders is not None else ()
        while self._at_slowest and not stop.requested:
            if orders:
                self._take_orders()
            answered = hub.collect(WAIT_S)
            after_ns = self._clock.monotonic_ns()
            self.counters.waited_ns += after_ns - now_ns
            if after_ns - now_ns > _STALL_NS or (not answered and launcher_stopped()):
                self._forgive(after_ns - now_ns)
            for bus in answered:
                self._go_on(self._lanes[bus], after_ns)
            now_ns = self._clock.monotonic_ns()
            if now_ns - after_ns > _STALL_NS:
                self._forgive(now_ns - after_ns)
            if not answered:
                self._look_for_the_absent(now_ns)
            elif now_ns >= next_report_ns:
                next_report_ns = now_ns + REPORT_EVERY_NS
                self._report(self.progress())
        self.counters.wall_ns = self._clock.monotonic_ns() - self._start_ns
        for bus, lane in self._lanes.items():
            self.counters.frames[bus] = lane.bus.crossed
            self.counters.add_nodes(bus, lane.bus.node_counts())

    def progress(self) -> Progress:
        """The progress of the slowest robot."""
        tick = self._slowest
        self.counters.ticks = max(tick, 0)
        return Progress(
            tick, tick * self._schedule.period_ns, self._clock.monotonic_ns() - self._start_ns
        )

    def _take_orders(self) -> None:
        """Carry out orders from a tick on that no bus has begun."""
        lanes = [lane for lane in self._lanes.values() if not lane.done]
        if self._orders is not None and lanes:
            latest = max(lane.tick for lane in lanes)
            self._orders.take(self.buses.values(), latest + 1)

    # --- one bus -------------------------------------------------------------------------------

    def _begin(self, robots: Sequence[tuple[EmulatedRobot, _Ends]], tick: int) -> None:
        """A tick begins: what is true now goes to the record, where a robot is to the robot."""
        t_ns = tick * self._period_ns
        for robot, ends in robots:
            if 0 <= tick < self._ticks:
                ends.rows.add(tick, robot.row(t_ns * 1e-9))
            if self._schedule.localises(tick):
                ends.pose.put(robot.pose_fix(tick, t_ns).encode())

    def _go_on(self, lane: _Lane, now_ns: int) -> None:
        """Advance a bus to its next question, or through the end of its tick."""
        asked = next(lane.steps)
        if asked is None:
            self._end_tick(lane, now_ns)
        else:
            lane.asked_ns, lane.asked = now_ns, asked

    def _end_tick(self, lane: _Lane, now_ns: int) -> None:
        """A bus from its tick to the next, and on as far as the slowest allows."""
        tick = lane.tick
        lane.asked_ns = 0
        lane.tick = tick + 1
        lane.done = tick >= self._ticks
        if tick == self._slowest:
            self._at_slowest -= 1
            if not self._at_slowest:
                self._next_tick()
                self._release(now_ns)
        if lane.done:
            return
        if lane.tick <= self._slowest + self._window:
            self._go_on(lane, now_ns)
        else:
            self._held.append(lane)

    # --- all of them ---------------------------------------------------------------------------

    def _next_tick(self) -> None:
        """The slowest have gone on; without any bus left, the run is over."""
        ticks = [lane.tick for lane in self._lanes.values() if not lane.done]
        if not ticks:
            self._slowest = self._schedule.ticks
            return
        self._slowest = min(ticks)
        self._at_slowest = ticks.count(self._slowest)
        if self._slowest <= 0:
            self._start_ns = self._clock.monotonic_ns()
        elif self._tick_wall_ns:
            self._pace()

    def _release(self, now_ns: int) -> None:
        """Ask the controllers of all buses that the window lets go on."""
        latest = self._slowest + self._window
        going = [lane for lane in self._held if lane.tick <= latest]
        if going:
            self._held = [lane for lane in self._held if lane.tick > latest]
            for lane in going:
                self._go_on(lane, now_ns)

    def _pace(self) -> None:
        """Wait for the wall time of the slowest's tick; the buses are served meanwhile."""
        due_ns = self._start_ns + self._slowest * self._tick_wall_ns
        left_ns = due_ns - self._clock.monotonic_ns()
        if left_ns < -self._tick_wall_ns:
            self.counters.overruns += 1
        while left_ns > 0:
            self._hub.serve(left_ns * 1e-9)
            left_ns = due_ns - self._clock.monotonic_ns()

    def _forgive(self, stood_still_ns: int) -> None:
        """Time in which this process, or the router, stood still doesn't count as a delay."""
        for lane in self._lanes.values():
            if lane.asked_ns:
                lane.asked_ns += stood_still_ns

    def _look_for_the_absent(self, now_ns: int) -> None:
        left = set(self._hub.left())
        limit_ns = int(self._limit_s * 1e9)
        for lane in self._lanes.values():
            when = self._schedule.when(lane.tick)
            robot = lane.asked or " or ".join(lane.robots)
            # Each controller leaves when it has answered the closing tick.
            if lane.tick < self._ticks and (gone := left.intersection(lane.robots)):
                names = " and ".join(sorted(gone))
                raise PeerLostError(f"{when}: the controller of {names} left its bus")
            if lane.asked_ns and now_ns - lane.asked_ns > limit_ns:
                raise InfrastructureError(
                    f"{when}: no answer from the controller of {robot} within {self._limit_s:g} s"
                )
