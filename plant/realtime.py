"""The plant in real time: bodies follow the wall clock, drives answer at once.

    torques on a bus   that robot's body to now with the torques held so far; then the new torques
                       to its drives; both drives say where their wheels are
    tick time          all bodies to the tick, a row of each to the record, what drives and
                       localisation system have to say

Every wait ends at an absolute time. A drive that heard no set-point says its encoder frames
cyclically, as always.
"""

import time
from collections.abc import Callable, Sequence

from bridge.can_bus.ends import DriveEnd
from bridge.frame import Frame
from bridge.link import Publisher
from bridge.messages import PoseFix, Progress
from bridge.process import Stop
from bridge.telemetry import RowBuffer
from configs.brief import PlantBrief
from plant.loop import REPORT_EVERY_NS, Counters
from plant.unit import Unit

FAREWELL_S = 0.5
"""How long the plant stays for controllers that act after its last tick."""


class _Lane:
    """One robot, and the bus time up to which its body has moved."""

    __slots__ = ("pose", "rows", "t_ns", "unit")

    def __init__(self, unit: Unit, pose: Publisher, rows: RowBuffer) -> None:
        self.unit = unit
        self.pose = pose
        self.rows = rows
        self.t_ns = 0


class RealtimeLoop:
    """Runs all units of a plant by the wall clock."""

    def __init__(
        self,
        brief: PlantBrief,
        units: Sequence[Unit],
        hub: DriveEnd,
        poses: Sequence[Publisher],
        rows: Sequence[RowBuffer],
        report: Callable[[Progress], None],
        record_others: Callable[[int], None] = lambda _: None,
    ) -> None:
        self._schedule = brief.schedule
        self._record_others = record_others
        self._zero_ns = brief.schedule.bus_time_ns(0)
        self._hub = hub
        self._report = report
        self._lanes = {
            unit.brief.bus: _Lane(unit, pose, buffer)
            for unit, pose, buffer in zip(units, poses, rows, strict=True)
        }
        self._tick = -brief.schedule.countdown_ticks
        self._epoch_ns = 0
        self._next_report_ns = 0
        self.counters = Counters()

    def progress(self) -> Progress:
        """How far the plant is."""
        tick = self._tick
        self.counters.ticks = max(tick, 0)
        wall_ns = max(time.monotonic_ns() - self._epoch_ns, 0)
        return Progress(tick, tick * self._schedule.period_ns, wall_ns)

    def run(self, epoch_ns: int, stop: Stop) -> None:
        """Run from power-up to the closing tick, or until told to stop."""
        schedule = self._schedule
        self._epoch_ns = epoch_ns
        power_up_ns = epoch_ns - self._zero_ns
        while self._tick <= schedule.ticks and not stop.requested:
            due_ns = power_up_ns + schedule.bus_time_ns(self._tick)
            now_ns = time.monotonic_ns()
            if now_ns < due_ns:
                self._serve((due_ns - now_ns) * 1e-9, power_up_ns)
                continue
            self.counters.overruns += now_ns > due_ns + schedule.period_ns
            self._keep_tick(power_up_ns)
            self._tick += 1
            if now_ns >= self._next_report_ns:
                self._next_report_ns = now_ns + REPORT_EVERY_NS
                self._report(self.progress())
        self._tick = min(self._tick, schedule.ticks)
        deadline = time.monotonic() + FAREWELL_S
        while self._hub.clients() and time.monotonic() < deadline and not stop.requested:
            self._serve(0.01, power_up_ns)
        self.counters.wall_ns = max(time.monotonic_ns() - epoch_ns, 0)
        for bus in self._lanes:
            crossed = self._hub.counters(bus)
            self.counters.frames[bus] = crossed.from_drives + crossed.from_clients

    def _serve(self, wait_s: float, power_up_ns: int) -> None:
        self._hub.serve(wait_s)
        for bus in self._hub.heard():
            self._answer(bus, time.monotonic_ns() - power_up_ns)

    def _answer(self, bus: str, now_ns: int) -> None:
        lane = self._lanes[bus]
        self._move(lane, now_ns)
        replies: list[Frame] = []
        for frame in self._hub.take(bus):
            replies += lane.unit.hear(frame, now_ns)
        replies += lane.unit.feedback(now_ns)
        if replies:
            self._hub.deliver(bus, now_ns, replies)

    def _keep_tick(self, power_up_ns: int) -> None:
        """What a tick brings, robot by robot; who sends torques meanwhile doesn't wait for all."""
        schedule, tick = self._schedule, self._tick
        bus_ns, t_ns = schedule.bus_time_ns(tick), tick * schedule.period_ns
        if 0 <= tick < schedule.ticks:
            self._record_others(tick)
        for bus, lane in self._lanes.items():
            unit = lane.unit
            self._move(lane, bus_ns)
            if 0 <= tick < schedule.ticks:
                lane.rows.add(tick, unit.row(t_ns * 1e-9))
            if frames := unit.frames_due(bus_ns):
                self._hub.deliver(bus, bus_ns, frames)
            if schedule.localises(tick):
                state = unit.state
                lane.pose.put(PoseFix(tick, t_ns, state.x, state.y, state.theta).encode())
            self._serve(0.0, power_up_ns)

    def _move(self, lane: _Lane, to_ns: int) -> None:
        """A body on to a bus time; before tick 0 it is held, and time doesn't go back."""
        from_ns = max(lane.t_ns, self._zero_ns)
        if to_ns > from_ns:
            lane.unit.advance((from_ns - self._zero_ns) * 1e-9, (to_ns - from_ns) * 1e-9, 1)
        lane.t_ns = max(lane.t_ns, to_ns)
