"""The lockstep clock: the plant owns time, controllers answer.

    bus's tick k   its robots' poses to Zenoh when the schedule localises; then what
                   `plant.bus.ideal` or `plant.bus.timed` do between questions and answers; and on
                   to its tick k + 1

Robots of different buses meet only in their controllers' messages, for which each controller waits
by tick; `plant.absent` has the controllers that a run goes on without. So a bus need not wait for
all others at every tick: it may be up to `LEAD_TICKS` ahead of the slowest, which keeps all cores
at work and changes no value. `plant.pacing` says which ticks may begin, and when: held to a speed,
all go tick by tick together; paused, all stop at the same tick. While nobody may begin a tick time
stands still: clients of the buses are served, orders taken, and controllers told.

Bus time runs from power-up; scenario time is 0 when control starts, after the countdown in which
the controllers arm their drives and the bodies are held as the scenario puts them. The run ends
with one closing tick at which the controllers disarm.

One class, as lookahead, pace and absent controllers decide together which bus goes on.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final, NamedTuple

from bridge.can_bus.hub import Hub
from bridge.network.link import Publisher
from bridge.network.messages import Progress
from bridge.network.telemetry import FrameBuffer, RowBuffer, RowLooks
from bridge.process.awake import LOOK_S, STALL_S
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import Stop, launcher_stopped
from configs.brief import PlantBrief
from configs.errors import InfrastructureError, PeerLostError
from configs.ticks import Ticks
from plant.absent import AbsentControllers
from plant.bus.build import build_buses
from plant.bus.sockets import SocketPort
from plant.counters import PlantCounters
from plant.lane import Lane
from plant.orders import PlantOrders
from plant.pacing import Pacing
from plant.robot import EmulatedRobot

REPORT_EVERY_NS: Final = 100_000_000
WAIT_S: Final = LOOK_S
"""Longest wait for an answer before absent controllers are looked for."""
_STALL_NS: Final = int((LOOK_S + STALL_S) * 1e9)
ANSWER_SHARE: Final = 0.9
"""Part of the tick deadline that the plant waits for answers: before that, controllers name a
silent peer; after it, the launcher names the plant."""

_WAITS_NS: Final = 100_000_000
"""A controller that answers later than this is said to be waited for."""
STANDSTILL_SHARE: Final = 0.25
"""Part of the tick deadline after which controllers are told again that time stands still."""


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
        logs: Mapping[str, FrameBuffer],
        absent: AbsentControllers,
        orders: PlantOrders | None = None,
        *,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._clock = clock
        self._orders = orders
        self._schedule = schedule = brief.schedule
        self._period_ns, self._last_tick = schedule.period_ns, schedule.ticks
        self._ticks = Ticks(schedule)
        pacing = orders.pacing if orders is not None else None
        self._pacing = pacing or Pacing(schedule, brief.speed)
        self._limit_s = ANSWER_SHARE * schedule.tick_deadline_s
        self._hub = hub
        self._rows = RowLooks(rows, schedule.rows_within_ns)
        self._report = report
        self._absent = absent
        first = -schedule.countdown_ticks
        ends = {
            robot: _Ends(pose, truth)
            for robot, pose, truth in zip(robots, poses, rows, strict=True)
        }

        def begin(group: Sequence[EmulatedRobot]) -> Callable[[int], None]:
            return partial(self._begin, [(robot, ends[robot]) for robot in group])

        self.buses = build_buses(
            brief, robots, lambda name, _: SocketPort(name, hub, hub), begin, logs
        )
        """By name."""
        self._lanes = {name: Lane(name, bus, first) for name, bus in self.buses.items()}
        self._lane_of = {robot: lane for lane in self._lanes.values() for robot in lane.robots}
        for lane in self._lanes.values():
            lane.due_tick = absent.due_tick(lane.robots)
        self._unasked: dict[str, Lane] = {}  # by name; whose question nobody has to answer
        self._left = 0  # controllers that were seen to have left
        self._slowest = first
        self._slowest_ns = 0  # since when it is that tick
        self._at_slowest = len(self._lanes)
        self._held: list[Lane] = []  # whose tick may not begin yet
        self._latest = first + self._pacing.window
        """The latest tick that may begin now."""
        self._standstill_ns = int(STANDSTILL_SHARE * schedule.tick_deadline_s * 1e9)
        self._told_ns = 0  # when controllers were told last that time stands still
        self._next_report_ns = 0
        self._start_ns = 0
        self.counters = PlantCounters()

    def run(self, stop: Stop) -> None:
        """Run from the first tick of the countdown to the closing tick, or until told to stop.

        Raises:
            InfrastructureError: a controller did not answer within the tick deadline, or one that
                was to come again did not.
            PeerLostError: a controller left its bus.
        """
        self._start_ns = now_ns = self._next_report_ns = self._clock.monotonic_ns()
        hub, absent = self._hub, self._absent
        for lane in self._lanes.values():
            self._start_tick(lane, now_ns)
        orders = self._orders.waiting if self._orders is not None else ()
        rows, wait_s = self._rows, min(WAIT_S, self._rows.every_s)
        while self._at_slowest and not stop.requested:
            if orders:
                self._take_orders()
            if self._latest < self._slowest and self._stand_still():
                now_ns = self._clock.monotonic_ns()
                continue
            answered = hub.collect(0.0 if self._unasked else wait_s)
            after_ns = self._clock.monotonic_ns()
            self.counters.waited_ns += after_ns - now_ns
            if after_ns - now_ns > _STALL_NS or (not answered and launcher_stopped()):
                self._forgive(after_ns - now_ns)
            for bus in answered:
                self._go_on(self._lanes[bus], after_ns)
            if absent.allowed:
                self._go_on_without(after_ns, answered)
            now_ns = self._clock.monotonic_ns()
            rows.look(now_ns)
            if now_ns - after_ns > _STALL_NS:
                self._forgive(now_ns - after_ns)
            if not (answered or absent.allowed):
                self._look_for_the_late(now_ns)
            if now_ns >= self._next_report_ns:
                self._tell(now_ns)
        self.counters.wall_ns = self._clock.monotonic_ns() - self._start_ns
        for bus, lane in self._lanes.items():
            self.counters.frames[bus] = lane.bus.crossed
            self.counters.add_nodes(bus, lane.bus.node_counts())

    def progress(self) -> Progress:
        """The progress of the slowest robot; of a run that stands, the tick at which it does."""
        self.counters.ticks = max(self._slowest, 0)
        tick = min(self._slowest, self._pacing.last_tick)
        return Progress(
            tick, tick * self._schedule.period_ns, self._clock.monotonic_ns() - self._start_ns
        )

    def waits_for(self) -> list[str]:
        """Robots without whose controllers' answers time has stood still for a while."""
        asked_before_ns = self._clock.monotonic_ns() - _WAITS_NS
        waiting = (
            lane
            for lane in self._lanes.values()
            if lane.tick == self._slowest and 0 < lane.asked_ns < asked_before_ns
        )
        return [robot for lane in waiting for robot in lane.awaits or self._hub.owing(lane.name)]

    def _take_orders(self) -> None:
        """Carry out orders from a tick on that no bus has begun."""
        lanes = [lane for lane in self._lanes.values() if not lane.done]
        if self._orders is not None and lanes:
            now_ns = self._clock.monotonic_ns()
            begun = max(lane.tick - (lane in self._held) for lane in lanes)
            self._orders.take(self.buses.values(), begun + 1, now_ns)
            for lane in lanes:
                self._look_at(lane)
            self._open(now_ns)

    # --- one bus -------------------------------------------------------------------------------

    def _begin(self, robots: Sequence[tuple[EmulatedRobot, _Ends]], tick: int) -> None:
        """A tick begins: what is true now goes to the record, where a robot is to the robot."""
        t_ns = tick * self._period_ns
        recorded, localised = 0 <= tick < self._last_tick, self._ticks.localises(tick)
        for robot, ends in robots:
            if recorded:
                robot.record(ends.rows, tick, t_ns * 1e-9)
            if localised:
                ends.pose.put(robot.pose_fix(tick, t_ns).encode())

    def _start_tick(self, lane: Lane, now_ns: int) -> None:
        """Begin a tick of a bus, unless it first has to wait for a controller to come again."""
        if lane.tick >= lane.due_tick:
            lane.awaits = self._absent.begin(lane.robots, lane.tick)
            self._look_at(lane)
            if lane.awaits:
                lane.asked_ns = now_ns
                return
        self._go_on(lane, now_ns)

    def _go_on(self, lane: Lane, now_ns: int) -> None:
        """Advance a bus to its next question, or through the end of its tick."""
        asked = next(lane.steps)
        if asked is None:
            self._end_tick(lane, now_ns)
            return
        lane.asked_ns, lane.asked = now_ns, asked
        if lane.absent and not self._hub.owing(lane.name):
            self._unasked[lane.name] = lane

    def _look_at(self, lane: Lane) -> None:
        """Take what is known of the controllers of a bus."""
        lane.absent = self._absent.any_of(lane.robots)
        lane.due_tick = self._absent.due_tick(lane.robots)

    def _end_tick(self, lane: Lane, now_ns: int) -> None:
        """A bus from its tick to the next, and on as far as the slowest allows."""
        tick = lane.tick
        if lane.absent:
            self._absent.end(lane.robots, tick)
            self._look_at(lane)
        lane.asked_ns = 0
        lane.tick = tick + 1
        lane.done = tick >= self._last_tick
        if tick == self._slowest:
            self._at_slowest -= 1
            if not self._at_slowest:
                self._slowest_ns = now_ns
                self._next_tick(now_ns)
                self._open(now_ns)
        if lane.done:
            return
        if lane.tick <= self._latest:
            self._start_tick(lane, now_ns)
        else:
            self._held.append(lane)

    # --- all of them ---------------------------------------------------------------------------

    def _next_tick(self, now_ns: int) -> None:
        """The slowest have gone on; without any bus left, the run is over."""
        slowest, at_slowest = self._last_tick + 1, 0
        for lane in self._lanes.values():
            if not lane.done and lane.tick <= slowest:
                at_slowest = 1 if lane.tick < slowest else at_slowest + 1
                slowest = lane.tick
        if not at_slowest:
            self._slowest = self._schedule.ticks
            return
        self._slowest, self._at_slowest = slowest, at_slowest
        pacing = self._pacing
        if slowest <= 0:
            self._start_ns = now_ns
            pacing.anchor(slowest, now_ns)
        elif pacing.tick_ns and now_ns > pacing.due_ns(slowest) + pacing.tick_ns:
            self.counters.overruns += 1

    def _open(self, now_ns: int) -> None:
        """Ask the controllers of all buses whose next tick may begin now."""
        pacing, slowest = self._pacing, self._slowest
        self._latest = latest = min(slowest + pacing.window, pacing.last_tick)
        if latest >= slowest and now_ns < pacing.due_ns(slowest):
            self._latest = latest = slowest - 1
        going = [lane for lane in self._held if lane.tick <= latest]
        if going:
            self._held = [lane for lane in self._held if lane.tick > latest]
            for lane in going:
                self._start_tick(lane, now_ns)

    def _stand_still(self) -> bool:
        """Serve the buses while no tick may begin, for a while; False: one hasn't ended yet."""
        if any(lane.asked_ns for lane in self._lanes.values()):
            return False
        now_ns, pacing = self._clock.monotonic_ns(), self._pacing
        wait_s = self._rows.every_s
        if self._slowest <= pacing.last_tick:
            wait_s = min(wait_s, (pacing.due_ns(self._slowest) - now_ns) * 1e-9)
        elif self._orders is not None and self._orders.awaited:
            self._tell(now_ns)  # first: who has the answer knows how far the run is
            self._orders.stands(pacing.last_tick)
        self._hub.serve(wait_s)
        now_ns = self._clock.monotonic_ns()
        self._rows.look(now_ns)
        if now_ns >= self._next_report_ns:
            self._tell(now_ns)
        since_ns = max(self._told_ns, self._slowest_ns)
        if self._orders is not None and now_ns - since_ns >= self._standstill_ns:
            self._told_ns = now_ns
            self._orders.tell_of_standstill(self._slowest)
        if self._absent.allowed:
            self._go_on_without(now_ns, ())
        else:
            self._look_for_the_late(now_ns)
        self._open(now_ns)
        return True

    def _tell(self, now_ns: int) -> None:
        """Report how far the run is."""
        self._next_report_ns = now_ns + REPORT_EVERY_NS
        self._report(self.progress())

    def _forgive(self, stood_still_ns: int) -> None:
        """Time in which this process, or the router, stood still doesn't count as a delay."""
        self._slowest_ns += stood_still_ns
        for lane in self._lanes.values():
            if lane.asked_ns:
                lane.asked_ns += stood_still_ns

    # --- controllers that are late or have gone --------------------------------------------------

    def _look_for_the_late(self, now_ns: int) -> None:
        """The run ends with the first.

        Raises:
            InfrastructureError: a controller did not answer within the tick deadline.
            PeerLostError: a controller left its bus.
        """
        left = set(self._hub.left())
        limit_ns = int(self._limit_s * 1e9)
        for lane in self._lanes.values():
            when = self._schedule.when(lane.tick)
            robot = lane.asked or " or ".join(lane.robots)
            # Each controller leaves when it has answered the closing tick.
            if lane.tick < self._last_tick and (gone := left.intersection(lane.robots)):
                names = " and ".join(sorted(gone))
                raise PeerLostError(f"{when}: the controller of {names} left its bus")
            if lane.asked_ns and now_ns - lane.asked_ns > limit_ns:
                raise InfrastructureError(
                    f"{when}: no answer from the controller of {robot} within {self._limit_s:g} s"
                )

    def _go_on_without(self, now_ns: int, answered: Sequence[str]) -> None:
        """Go on without who is late or has gone, and with who has come again.

        Raises:
            InfrastructureError: a controller did not come again.
        """
        unasked, self._unasked = self._unasked, {}
        for lane in unasked.values():
            self._go_on(lane, now_ns)
        gone = self._hub.left()[self._left :]
        self._left += len(gone)
        for robot in gone:
            lane = self._lane_of[robot]
            if lane.tick < self._last_tick:
                self._absent.gone(robot, lane.tick)
                self._look_at(lane)
                if lane.asked_ns and not (lane.awaits or self._hub.owing(lane.name)):
                    self._unasked[lane.name] = lane
        if answered or unasked or gone:
            return
        for lane in self._lanes.values():
            if lane.awaits:
                self._await(lane, now_ns)
            elif lane.asked_ns:
                self._look_for_late(lane, now_ns)

    def _await(self, lane: Lane, now_ns: int) -> None:
        """A bus waits for controllers to come again: time stands still until they are there."""
        lane.awaits = [robot for robot in lane.awaits if not self._hub.joined(robot)]
        limit_s = self._schedule.start_deadline_s
        if not lane.awaits:
            self._go_on(lane, now_ns)
        elif now_ns - lane.asked_ns > limit_s * 1e9:
            raise InfrastructureError(
                f"{self._schedule.when(lane.tick)}: the controller of"
                f" {' and '.join(lane.awaits)} did not come again within {limit_s:g} s"
            )

    def _look_for_late(self, lane: Lane, now_ns: int) -> None:
        """Go on without the controllers that a bus at the slowest tick waits for too long.

        Others may be waiting themselves, for the path state of one of these.
        """
        owing = self._hub.owing(lane.name)
        waited_ns = now_ns - max(lane.asked_ns, self._slowest_ns)
        if owing and lane.tick == self._slowest and waited_ns > self._limit_s * 1e9:
            self._absent.late(owing, lane.tick)
            self._look_at(lane)
            owing = []
        if not owing:
            self._unasked[lane.name] = lane
