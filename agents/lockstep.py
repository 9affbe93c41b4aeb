"""The loop of one controller in lockstep: the bus is the clock.

Both encoder frames of a tick start it; the controller then waits for the pose and the path states
that are due by the schedule, and answers with the torque frames. A path state is published as soon
as it is known, at the end of the tick before the one at which it is due: it travels while other
controllers compute, and a graph with cycles can't deadlock.
"""

import errno
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import can

from agents.admission import LEADER, LOCALISATION
from agents.agent import Agent
from agents.bus_clock import BusClock
from agents.guard import Phase
from agents.process_faults import ProcessFaults
from agents.status import Narrator
from agents.subscriptions import Subscriptions
from bridge.can_bus.client import BusClient, TimedFrame
from bridge.frame import Frame
from bridge.network.barrier import Hellos
from bridge.network.fault_orders import FaultOrder
from bridge.network.link import Arrival, Link, Publisher
from bridge.network.messages import LeaderSpeed, PathState, PoseFix, Silence
from bridge.network.orders import OrderInbox
from bridge.network.run_orders import LeaderOrder
from bridge.process.awake import LOOK_S, AwakeClock
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import Stop, launcher_stopped
from configs.brief import Schedule
from configs.errors import InfrastructureError, PeerLostError, PeerSilentError
from configs.faults.base import Fault
from configs.roles import PLANT
from configs.ticks import Ticks

LISTEN_SHARE: Final = 0.75
"""Part of the tick deadline for the wait for messages: a controller reports a silent peer before
the plant reports the controller."""
BUS_SHARE: Final = 2.0
"""Multiple of the tick deadline for the wait for the bus: the plant reports its own faults
first."""

_KINDS_AND_SENDERS: Final = {
    "pose": ("pose", LOCALISATION),
    "place": ("pose", LOCALISATION),
    "leader": ("speed", LEADER),
    "silence": ("silence", PLANT.name),
}


@dataclass(slots=True)
class LockstepCounters:
    """Wall time of a controller by activity [ns], and unsent frames."""

    ticks: int = 0
    bus_ns: int = 0
    listen_ns: int = 0
    compute_ns: int = 0
    unsent: int = 0  # frames dropped by a full transmit queue

    def durations_ns(self) -> dict[str, int]:
        """Wall time by activity [ns]."""
        return {"bus": self.bus_ns, "listen": self.listen_ns, "compute": self.compute_ns}

    def deadlines(self) -> None:
        """None: lockstep has no deadlines."""


class LockstepLoop:
    """Runs one agent on its bus and its link."""

    def __init__(
        self,
        agent: Agent,
        bus: BusClient,
        link: Link,
        subscriptions: Subscriptions,
        path: Publisher,
        hellos: Hellos,
        progress: Publisher,
        orders: OrderInbox | None = None,
        *,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._clock = clock
        self._orders = orders
        self._agent = agent
        self._schedule = schedule = agent.brief.schedule
        self._ticks = Ticks(schedule)
        self._tell_every_ns = int(schedule.status_every_s * 1e9)
        self._resumes = agent.brief.rejoins
        self._robot = agent.brief.robot
        self._bus = bus
        self._link = link
        self._subscriptions = subscriptions
        self._path = path
        self._hellos = hellos
        self._progress = progress
        self._within_s, self._frames_within_s = _patience_s(self._schedule)
        self._rows = agent.rows
        self._rows_within_s = self._schedule.rows_within_ns * 1e-9
        self._narrator = Narrator(agent)
        self._told_tick: int | None = None
        self._asked_ns = self._told_ns = 0  # by the clock: the last answer; next to be told
        self.faults = ProcessFaults(agent.brief, agent.guard.note, clock=clock)
        """Faults of this process."""
        self.counters = LockstepCounters()

    def on_arrival(self, arrival: Arrival) -> None:
        """Deliver one message to the agent."""
        deliver(self._agent, arrival)

    def await_first_frame(self, stop: Stop) -> Sequence[TimedFrame] | None:
        """Say hello until the plant's first frames; None on a stop."""
        clock = AwakeClock(held=launcher_stopped, clock=self._clock)
        deadline = clock.now() + self._schedule.start_deadline_s
        while not stop.requested:
            frames = self._receive(min(self._hellos.say(), LOOK_S))
            if frames is not None:
                return frames
            if clock.now() > deadline:
                raise did_not_start(self._agent)
        return None

    def run(self, first: Sequence[TimedFrame], stop: Stop) -> None:
        """Run from the first frames to the closing tick, or to a stop.

        Raises:
            InfrastructureError: the bus was silent beyond the tick deadline.
            PeerSilentError: a pose or a neighbour's path state did not come.
            PeerLostError: the bus closed.
        """
        agent, schedule, bus = self._agent, self._schedule, self._bus
        frames = first
        on_frame = agent.on_frame
        first_tick = agent.brief.resumes_tick if self._resumes else -schedule.countdown_ticks
        clock = BusClock(schedule, agent.guard.drives, first_tick)
        self.faults.skip_to(first_tick)
        self._asked_ns = self._told_ns = self._clock.monotonic_ns()
        next_tick = first_tick
        while True:
            for at_ns, frame in frames:
                on_frame(frame.can_id, frame.data, at_ns)
                tick = clock.due(at_ns)
                if tick is not None:
                    if self._tick(tick, stop):
                        return
                    next_tick = tick + 1
            question_ns = bus.question_ns
            if question_ns is not None:
                tick = clock.due_at_end(question_ns)
                if tick is not None:
                    if self._tick(tick, stop):
                        return
                    next_tick = tick + 1
            frames = self._await_frames(self._frames_within_s, next_tick)

    def _tick(self, tick: int, stop: Stop) -> bool:
        """Compute one tick and answer; whether it was the last."""
        agent, counters, faults = self._agent, self.counters, self.faults
        came_ns = self._clock.monotonic_ns()
        if tick >= faults.due_tick:
            faults.begin(tick)
        if self._ticks.owes(tick):
            self._await_messages(tick, stop)
        heard_ns = self._clock.monotonic_ns()
        orders = self._orders
        if orders is not None and orders.waiting:
            take_orders(agent, faults, orders, tick)
        self._send(agent.step(tick) if not stop.requested else agent.shut_down())
        if tick >= self._subscriptions.next_change:
            self._subscriptions.change(tick)
        if tick >= faults.mute_tick and self._ticks.shares(tick + 1):
            silent = self._resumes and not agent.speaks(tick + 1)
            said = Silence(tick + 1) if silent else agent.share(tick + 1)
            self._path.put(said.encode())
        counters.bus_ns += came_ns - self._asked_ns
        counters.listen_ns += heard_ns - came_ns
        self._asked_ns = asked_ns = self._clock.monotonic_ns()
        self._rows.look(asked_ns)
        counters.compute_ns += asked_ns - heard_ns
        counters.ticks += 1
        if asked_ns >= self._told_ns:
            self._told_ns = asked_ns + self._tell_every_ns
            self._tell(tick)
        return agent.phase is Phase.DONE

    def _send(self, frames: Sequence[Frame]) -> None:
        for frame in frames:
            try:
                self._bus.send(frame)
            except can.CanOperationError as error:
                if error.error_code != errno.ENOBUFS:
                    raise PeerLostError(f"{self._robot}: lost its bus: {error}") from error
                # As on hardware: the next one is newer.
                self.counters.unsent += 1

    def _await_messages(self, tick: int, stop: Stop) -> None:
        """Wait for the messages that are due at this tick, or for a stop."""
        agent = self._agent
        clock: AwakeClock | None = None
        left_s = within_s = self._within_s
        while (missing := agent.missing(tick)) and not stop.requested:
            # A late look may find the message in the queue; under a flood the queue never ends.
            wait_s = self._rows_within_s if clock is None else LOOK_S
            arrival = self._link.receive(wait_s if left_s > 0.0 else 0.0)
            if clock is None:
                clock = AwakeClock(held=launcher_stopped, clock=self._clock)
                deadline = clock.now() + within_s
            if arrival is None:
                self._rows.hand_on()
            left_s = deadline - clock.now()
            if arrival is not None and left_s > -within_s:
                self.on_arrival(arrival)
            elif left_s <= 0.0:
                said = "; ".join((f"no {', no '.join(missing)}", *agent.refusals()))
                raise PeerSilentError(f"{self._robot}: tick {tick}: within {within_s:g} s {said}")

    def _await_frames(self, within_s: float, tick: int) -> Sequence[TimedFrame]:
        """The next frames of the bus; none with a question that has none.

        While nothing comes rows are handed on, progress is told, and orders are taken before the
        next tick.
        """
        frames = self._receive(self._rows_within_s)
        if frames is not None:
            return frames
        self._rows.hand_on()
        self._tell(tick - 1)
        clock = AwakeClock(held=launcher_stopped, clock=self._clock)
        deadline = clock.now() + within_s - self._rows_within_s
        while (frames := self._receive(LOOK_S)) is None:
            if self._time_stands(tick):
                deadline = clock.now() + within_s
            if clock.now() > deadline:
                raise InfrastructureError(
                    f"{self._robot}: no encoder frames within {within_s:g} s after"
                    f" {self.counters.ticks} ticks"
                )
        return frames

    def _tell(self, tick: int) -> None:
        """Tell how far this controller is, of a tick once."""
        if tick != self._told_tick:
            self._told_tick = tick
            self._progress.put(self._narrator.progress(tick).encode())

    def _time_stands(self, tick: int) -> bool:
        """Take the orders that have come; whether the plant has said that time stands still."""
        orders = self._orders
        if orders is None:
            return False
        if orders.waiting:
            take_orders(self._agent, self.faults, orders, tick)
        stands, orders.stands = orders.stands, False
        return stands

    def _receive(self, timeout_s: float) -> Sequence[TimedFrame] | None:
        try:
            return self._bus.receive_timed_frames(timeout_s)
        except can.CanOperationError as error:
            raise PeerLostError(
                f"{self._robot}: lost its bus after {self.counters.ticks} ticks: {error}"
            ) from error


def _patience_s(schedule: Schedule) -> tuple[float, float]:
    """The longest waits for the messages of a tick and for frames [wall s].

    Where a run goes on without a late controller the plant judges who that is, one after another.
    """
    if schedule.on_late == "abort":
        return LISTEN_SHARE * schedule.tick_deadline_s, BUS_SHARE * schedule.tick_deadline_s
    within_s = schedule.start_deadline_s + schedule.tick_deadline_s
    return within_s, within_s + schedule.tick_deadline_s


def did_not_start(agent: Agent) -> InfrastructureError:
    """The error of a controller whose run did not start, with the messages that it refused."""
    waited_s = agent.brief.schedule.start_deadline_s
    said = (f"{agent.brief.robot}: the run did not start within {waited_s:g} s", *agent.refusals())
    return InfrastructureError("; ".join(said))


def take_orders(agent: Agent, faults: ProcessFaults, orders: OrderInbox, tick: int) -> None:
    """Have the agent, or its process, carry out what has come, at this tick or later; answer it."""
    for order in orders.take():
        match order:
            case FaultOrder(fault=Fault(PLACE="process")):
                orders.answer(order, faults.take(order, tick))
            case FaultOrder():
                orders.answer(order, agent.take_order(order, tick))
            case LeaderOrder():
                orders.answer(order, agent.take_leader_order(order, tick))
            case _:
                orders.answer(order, "a controller keeps no pace of its own")


def deliver(agent: Agent, arrival: Arrival) -> None:
    """Deliver one message to the agent by its tag; its admission counts one that doesn't decode."""
    kind, _, robot = arrival.tag.partition("/")
    match kind:
        case "path" if (state := PathState.decode(arrival.payload)) is not None:
            agent.receive_path_state(robot, state)
        case "path" | "silence" if (silence := Silence.decode(arrival.payload)) is not None:
            agent.receive_silence(robot, silence.tick)
        case "pose" if (fix := PoseFix.decode(arrival.payload)) is not None:
            agent.receive_pose(fix)
        case "place" if (fix := PoseFix.decode(arrival.payload)) is not None:
            agent.receive_place(robot, fix)
        case "leader" if (speed := LeaderSpeed.decode(arrival.payload)) is not None:
            agent.receive_leader_speed(speed)
        case "go":
            pass  # lockstep begins with the first frame
        case _:
            what, sender = _KINDS_AND_SENDERS.get(kind, ("path state", robot))
            agent.admission.malformed(what, sender)
