"""The lockstep clock: the plant owns time, everybody else answers.

    tick k   poses to Zenoh (when the schedule localises), every drive's frames to its bus;
             wait until every controller has answered; hand the answers to the drives;
             integrate to t_{k+1} with the torques held

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
        t_ns = tick * schedule.period_ns
        t_s = t_ns * 1e-9
        bus_ns = schedule.bus_time_ns(tick)
        hub = self._hub
        if schedule.localises(tick):
            for unit, pose in zip(self._units, self._poses, strict=True):
                state = unit.state
                pose.put(PoseFix(tick, t_ns, state.x, state.y, state.theta).encode())
        for unit in self._units:
            hub.deliver(unit.brief.bus, bus_ns, unit.frames_due(bus_ns))
        self._collect(tick, bus_ns, stop)
        if stop.requested:
            return
        if not 0 <= tick < schedule.ticks:
            return
        for unit, rows in zip(self._units, self._rows, strict=True):
            rows.add(tick, unit.row(t_s))
            unit.advance(t_s, schedule.period_s, self._brief.substeps)

    def _collect(self, tick: int, bus_ns: int, stop: Stop) -> None:
        """Wait for all answers; what drives reply to requests goes out within the same instant."""
        hub = self._hub
        closing = tick >= self._brief.schedule.ticks
        began_ns = time.monotonic_ns()
        deadline_ns = began_ns + int(self._limit_s * 1e9)
        answered = False
        while not answered:
            left_s = max(0.0, (deadline_ns - time.monotonic_ns()) * 1e-9)
            late = hub.collect(left_s)
            if stop.requested:
                return
            if (late and left_s <= 0.0) or (hub.left() and not closing):
                self._name_the_absent(tick, late)
            answered = not late and not self._reply(bus_ns)
        self.counters.waited_ns += time.monotonic_ns() - began_ns

    def _reply(self, bus_ns: int) -> bool:
        """Hand the drives what the clients sent; return whether any drive replied."""
        replied = False
        for unit in self._units:
            bus = unit.brief.bus
            replies = [r for frame in self._hub.take(bus) for r in unit.hear(frame, bus_ns)]
            if replies:
                replied = True
                self._hub.deliver(bus, bus_ns, replies)
        return replied

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
