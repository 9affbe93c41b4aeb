"""The lockstep clock: the plant owns time, everybody else answers.

    tick k   every drive's frames to its bus, poses to Zenoh when the schedule localises;
             as each controller answers: hand its torques to the drives, integrate its robot to
             t_{k+1} with the torques held; until all have answered

Bus time runs from power-up; scenario time is 0 when control starts, after the countdown in which
the controllers arm their drives and the bodies are held as the scenario puts them. The run ends
with one closing tick at which the controllers disarm.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from bridge.can_bus.hub import Hub
from bridge.link import Publisher
from bridge.messages import PoseFix, Progress
from bridge.process import Stop
from bridge.telemetry import RowBuffer
from configs.brief import PlantBrief
from configs.errors import InfrastructureError, PeerLostError
from plant.unit import Unit

PROGRESS_EVERY_S = 0.1
ANSWER_SHARE = 0.9
"""Part of the tick deadline that the plant waits for answers: before that, controllers name who is
silent; after it, the launcher names the plant."""


@dataclass(slots=True)
class Counters:
    """What the run cost, for the summary."""

    ticks: int = 0
    wall_ns: int = 0
    waited_ns: int = 0
    overruns: int = 0
    reason: str = ""
    frames: dict[str, int] = field(default_factory=dict)


class LockstepLoop:
    """Runs all units of a plant against the controllers on the hub's buses."""

    def __init__(
        self,
        brief: PlantBrief,
        units: Sequence[Unit],
        hub: Hub,
        poses: Sequence[Publisher],
        rows: Sequence[RowBuffer],
        report: Callable[[Progress], None],
    ) -> None:
        self._brief = brief
        self._units = units
        self._hub = hub
        self._poses = poses
        self._rows = rows
        self._report = report
        self._limit_s = ANSWER_SHARE * brief.schedule.tick_deadline_s
        self._robot_of = {unit.brief.bus: unit.brief.robot for unit in units}
        self._by_bus = {
            unit.brief.bus: (unit, rows) for unit, rows in zip(units, self._rows, strict=True)
        }
        self._frames = {unit.brief.bus: unit.frames_due(0) for unit in units}
        self.counters = Counters()

    def run(self, stop: Stop) -> None:
        """Run from the first tick of the countdown to the closing tick, or until told to stop.

        Raises:
            InfrastructureError: a controller did not answer within the tick deadline.
            PeerLostError: a controller left its bus.
        """
        schedule = self._brief.schedule
        counters = self.counters
        start_ns = next_report_ns = time.monotonic_ns()
        for tick in range(-schedule.countdown_ticks, schedule.ticks + 1):
            if stop.requested:
                counters.reason = stop.reason
                break
            if tick == 0:
                start_ns = time.monotonic_ns()
            now_ns = self._pace(tick, start_ns) if tick > 0 else time.monotonic_ns()
            if now_ns >= next_report_ns:
                next_report_ns = now_ns + int(PROGRESS_EVERY_S * 1e9)
                self._report(Progress(tick, tick * schedule.period_ns, now_ns - start_ns))
            self._tick(tick, stop)
            counters.ticks = max(tick, 0)
        counters.wall_ns = time.monotonic_ns() - start_ns
        for bus in self._robot_of:
            crossed = self._hub.counters(bus)
            counters.frames[bus] = crossed.from_drives + crossed.from_clients

    def _tick(self, tick: int, stop: Stop) -> None:
        schedule = self._brief.schedule
        bus_ns = schedule.bus_time_ns(tick)
        deliver = self._hub.deliver
        for bus, frames in self._frames.items():
            deliver(bus, bus_ns, frames)
        if schedule.localises(tick):
            t_ns = tick * schedule.period_ns
            for unit, pose in zip(self._units, self._poses, strict=True):
                state = unit.state
                pose.put(PoseFix(tick, t_ns, state.x, state.y, state.theta).encode())
        self._collect(tick, bus_ns, stop)

    def _collect(self, tick: int, bus_ns: int, stop: Stop) -> None:
        """Until all have answered, take each robot on to the next tick as its answer comes."""
        hub = self._hub
        closing = tick >= self._brief.schedule.ticks
        waiting = len(self._by_bus)
        deadline_ns = 0
        waited_ns = 0
        while waiting:
            before_ns = time.monotonic_ns()
            if not deadline_ns:
                deadline_ns = before_ns + int(self._limit_s * 1e9)
            left_s = (deadline_ns - before_ns) * 1e-9
            answered = hub.collect(max(0.0, left_s))
            waited_ns += time.monotonic_ns() - before_ns
            for bus in answered:
                if not self._reply(bus, bus_ns):
                    self._take_on(bus, tick)
                    waiting -= 1
            if not answered:
                if stop.requested:
                    break
                if left_s <= 0.0 or (hub.left() and not closing):
                    self._name_the_absent(tick, hub.debtors())
                if closing and not hub.debtors():
                    break
        self.counters.waited_ns += waited_ns

    def _reply(self, bus: str, bus_ns: int) -> bool:
        """Hand the drives what came over their bus; return whether they replied anything.

        Replies go out within the same instant, so their bus is waited for once more.
        """
        unit, _ = self._by_bus[bus]
        replies = [r for frame in self._hub.take(bus) for r in unit.hear(frame, bus_ns)]
        if replies:
            self._hub.deliver(bus, bus_ns, replies)
        return bool(replies)

    def _take_on(self, bus: str, tick: int) -> None:
        """One robot from this tick to the next."""
        schedule = self._brief.schedule
        unit, rows = self._by_bus[bus]
        if 0 <= tick < schedule.ticks:
            t_s = tick * schedule.period_ns * 1e-9
            rows.add(tick, unit.row(t_s))
            unit.advance(t_s, schedule.period_s, self._brief.substeps)
        self._frames[bus] = unit.frames_due(schedule.bus_time_ns(tick + 1))

    def _name_the_absent(self, tick: int, late: Sequence[str]) -> None:
        when = f"tick {tick} (t = {tick * self._brief.schedule.period_ns * 1e-9:.3f} s)"
        gone = [f"{self._robot_of[bus]} left its bus" for bus in self._hub.left()]
        if gone:
            raise PeerLostError(f"{when}: the controller of {', of '.join(gone)}")
        names = ", ".join(self._robot_of[bus] for bus in late)
        raise InfrastructureError(
            f"{when}: no answer from the controller of {names} within {self._limit_s:g} s"
        )

    def _pace(self, tick: int, start_ns: int) -> int:
        """Wait for the tick's wall time when the run is held to a speed; return the wall time."""
        now_ns = time.monotonic_ns()
        if self._brief.speed <= 0.0:
            return now_ns
        due_ns = start_ns + int(tick * self._brief.schedule.period_ns / self._brief.speed)
        if now_ns > due_ns + self._brief.schedule.period_ns / self._brief.speed:
            self.counters.overruns += 1
        while now_ns < due_ns:
            time.sleep(min((due_ns - now_ns) * 1e-9, PROGRESS_EVERY_S))
            now_ns = time.monotonic_ns()
        return now_ns


def bus_frames(counters: Counters) -> Mapping[str, int]:
    """Frames that crossed each bus, as flat values for a report."""
    return {f"frames.{bus}": count for bus, count in counters.frames.items()}
