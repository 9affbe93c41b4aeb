"""The plant in real time: bodies follow the wall clock, drives answer at once.

    torques on a bus   that robot's body to now with the torques held so far; then the new torques
                       to its drives; both drives say where their wheels are
    tick time          all bodies to the tick, a row of each to the record, what drives and
                       localisation system have to say

Every wait ends at an absolute time. A drive that heard no set-point says its encoder frames
cyclically, as always.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from bridge.can_bus.drive_port import DrivePort
from bridge.can_bus.hub import Hub
from bridge.network.link import Publisher
from bridge.network.messages import Progress
from bridge.network.telemetry import FrameBuffer, RowBuffer, RowLooks
from bridge.process.awake import Lateness
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import Stop
from configs.brief import PlantBrief
from configs.ticks import Ticks
from plant.bus.build import build_buses, no_begin
from plant.bus.sockets import SocketPort
from plant.counters import PlantCounters
from plant.lockstep import REPORT_EVERY_NS
from plant.orders import PlantOrders
from plant.robot import EmulatedRobot

FAREWELL_S: Final = 0.5
"""Time for which the plant outlasts its last tick, for controllers that act later."""


def _record_nobody(_tick: int) -> None:
    pass


class RealtimeLoop:
    """Runs all robots of a plant by the wall clock."""

    def __init__(
        self,
        brief: PlantBrief,
        robots: Sequence[EmulatedRobot],
        end: DrivePort,
        hub: Hub,
        poses: Sequence[Publisher],
        rows: Sequence[RowBuffer],
        report: Callable[[Progress], None],
        logs: Mapping[str, FrameBuffer],
        record_others: Callable[[int], None] = _record_nobody,
        other_rows: Sequence[RowBuffer] = (),
        orders: PlantOrders | None = None,
        *,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._clock = clock
        self._schedule = brief.schedule
        self._ticks = Ticks(brief.schedule)
        self._record_others = record_others
        self._orders = orders
        self._zero_ns = self._ticks.bus_time_ns(0)
        self._end = end
        self._report = report
        external = {robot.brief.bus for robot in robots}.difference(hub.names)
        self.buses = build_buses(
            brief, robots, lambda name, _: SocketPort(name, end, hub), no_begin, logs, external
        )
        """By name."""
        self._acting = [bus for bus in self.buses.values() if bus.acts_between_ticks]
        """Buses on which something happens between two ticks."""
        self._poses = dict(zip(robots, poses, strict=True))
        self._rows = dict(zip(robots, rows, strict=True))
        self._looks = RowLooks([*rows, *other_rows], brief.schedule.rows_within_ns)
        self._tick = -brief.schedule.countdown_ticks
        self._epoch_ns = 0
        self._next_report_ns = 0
        self.counters = PlantCounters()
        self.lateness = Lateness(brief.schedule.period_s)

    def progress(self) -> Progress:
        """The progress of the plant, to its closing tick at most."""
        tick = min(self._tick, self._schedule.ticks)
        self.counters.ticks = max(tick, 0)
        wall_ns = max(self._clock.monotonic_ns() - self._epoch_ns, 0)
        return Progress(tick, tick * self._schedule.period_ns, wall_ns)

    def run(self, epoch_ns: int, stop: Stop) -> None:
        """Run from power-up to the closing tick, or until told to stop."""
        schedule = self._schedule
        self._epoch_ns = epoch_ns
        power_up_ns = epoch_ns - self._zero_ns
        while self._tick <= schedule.ticks and not stop.requested:
            due_ns = power_up_ns + self._ticks.bus_time_ns(self._tick)
            now_ns = self._clock.monotonic_ns()
            self._looks.look(now_ns)
            if now_ns < due_ns:
                left_s = (due_ns - now_ns) * 1e-9
                self._serve(min(left_s, self._looks.every_s), power_up_ns)
                continue
            self.counters.overruns += now_ns > due_ns + schedule.period_ns
            self.lateness.note(self._tick, (now_ns - due_ns) * 1e-9)
            if self._orders is not None and self._orders.waiting:
                self._orders.take(self.buses.values(), self._tick)
            self._keep_tick(power_up_ns)
            self._tick += 1
            if now_ns >= self._next_report_ns:
                self._next_report_ns = now_ns + REPORT_EVERY_NS
                self._report(self.progress())
        deadline = self._clock.monotonic_s() + FAREWELL_S
        while self._end.clients() and self._clock.monotonic_s() < deadline and not stop.requested:
            self._serve(0.01, power_up_ns)
        self.counters.wall_ns = max(self._clock.monotonic_ns() - epoch_ns, 0)
        for name, bus in self.buses.items():
            self.counters.frames[name] = bus.crossed
            self.counters.add_nodes(name, bus.node_counts())

    def _serve(self, wait_s: float, power_up_ns: int) -> None:
        """Serve the buses until something came or is due, at most `wait_s`."""
        for acting in self._acting:
            left_ns = acting.next_ns() + power_up_ns - self._clock.monotonic_ns()
            wait_s = min(wait_s, max(left_ns, 0) * 1e-9)
        self._end.serve(wait_s)
        for bus in self._end.pending():
            self.buses[bus].react(self._clock.monotonic_ns() - power_up_ns)
        for acting in self._acting:
            acting.advance(self._clock.monotonic_ns() - power_up_ns)

    def _keep_tick(self, power_up_ns: int) -> None:
        """One tick, bus by bus; torques that come meanwhile are served between two buses."""
        schedule, tick, ticks = self._schedule, self._tick, self._ticks
        bus_ns, t_ns = ticks.bus_time_ns(tick), tick * schedule.period_ns
        recorded, localised = 0 <= tick < schedule.ticks, ticks.localises(tick)
        if recorded:
            self._record_others(tick)
        for bus in self.buses.values():
            bus.move(bus_ns)
            bus.faults.begin(tick)
            for robot in bus.robots:
                if recorded:
                    robot.record(self._rows[robot], tick, t_ns * 1e-9)
            bus.send_due(bus_ns)
            if localised:
                for robot in bus.robots:
                    self._poses[robot].put(robot.pose_fix(tick, t_ns).encode())
            self._serve(0.0, power_up_ns)
