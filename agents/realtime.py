"""One controller in real time: the wall clock is the clock, the newest data wins.

    due time of tick k   epoch + k h + phase, absolute: lateness never adds up
    until then           read the bus as frames come: feedback is seen at once, its round trip too
    then                 take what the network brought, compute, send torques, share when due

Controllers have different phases, so that they don't all wake at one instant. The controller never
waits for feedback: a *miss* is a tick whose torques had no feedback when the next tick was due. A
tick that could not be kept is computed late, without sending, so that the path variable keeps time.
What the bus gathered while the controller waited for its run is dropped, and judged is what comes
from then on. Its own frames, where the interface hands them back, are nobody else's.
What an interface's errors do is in `agents.bus_health`.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import nan

import can

from agents.agent import Agent
from agents.bus_health import BusHealth
from agents.guard import Phase
from agents.lockstep import deliver, did_not_start
from bridge.can_bus.echo import Echoes, hands_back
from bridge.can_bus.pythoncan import can_id_of, to_frame, to_message
from bridge.frame import ERR, Frame
from bridge.network.barrier import Hellos
from bridge.network.link import Link, Publisher, waiting
from bridge.network.messages import Go, Progress
from bridge.network.reports import Deadlines
from bridge.process.awake import STALL_S, Lateness
from bridge.process.clock import SYSTEM_CLOCK, Clock, implausible_start, monotonic_of
from bridge.process.lifecycle import Stop
from configs.roles import LAUNCHER

ARRIVALS_PER_TICK = 64
"""Messages that are looked at in one tick, and two more for every in-neighbour: the rest waits."""
BACKLOG_S = 1.0
"""Longest time for dropping what the bus gathered; no interface keeps more than this takes."""


PROGRESS_PERIOD_S = 0.2
"""How often a controller says that it lives."""


@dataclass(slots=True)
class RealtimeCounters:
    """How well the controller kept its time."""

    ticks: int = 0
    misses: int = 0  # no feedback of its torques before the next tick was due
    skipped: int = 0  # computed after the next tick was due, and not sent
    unsent: int = 0  # ticks whose frames found the transmit queue full
    bus_errors: int = 0  # other errors of the bus that were borne
    error_frames: int = 0  # that the bus's controller told of
    undecodable: int = 0

    def durations_ns(self) -> dict[str, int]:
        """Nothing: by the wall clock what is left of a period is waited for."""
        return {}

    def deadlines(self) -> Deadlines:
        """What a report says of them."""
        return Deadlines(self.misses, self.skipped)


class RealtimeLoop:
    """Runs one agent on its bus and its link by the wall clock."""

    def __init__(
        self,
        agent: Agent,
        bus: can.BusABC,
        link: Link,
        path: Publisher,
        hellos: Hellos,
        progress: Publisher,
        *,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._clock = clock
        self._agent = agent
        self._schedule = agent.brief.schedule
        self._robot = agent.brief.robot
        self._bus = bus
        self._link = link
        self._path = path
        self._hellos = hellos
        self._progress = progress
        self._progress_ticks = max(round(PROGRESS_PERIOD_S / agent.brief.schedule.period_s), 1)
        self._lateness = Lateness(agent.brief.schedule.period_s)
        self._health = BusHealth(agent.brief.robot, agent.brief.host.bus_error_limit_ns)
        self._echoes = Echoes() if hands_back(agent.brief.bus) else None
        self._most_arrivals = ARRIVALS_PER_TICK + 2 * len(agent.brief.hears)
        self._power_up_ns = 0
        self._sent_ns = 0  # when torques were sent that have no feedback yet; 0: there are none
        self.counters = RealtimeCounters()

    def await_go(self, stop: Stop) -> int | None:
        """Say hello until the launcher says when tick 0 is; None when told to stop."""
        deadline = self._clock.monotonic_s() + self._schedule.start_deadline_s
        while not stop.requested:
            self._drop_backlog()
            self._hellos.say()
            arrival = self._link.receive(0.02)
            # Others say hello all the time: wait for nothing here, or ours would not be said.
            for _ in range(self._most_arrivals):
                if arrival is None:
                    break
                if arrival.tag != "go":
                    self.counters.undecodable += not deliver(self._agent, arrival)
                elif (epoch_ns := self._epoch_ns(arrival.payload)) is not None:
                    return epoch_ns
                arrival = self._link.receive(0.0)
            if self._clock.monotonic_s() > deadline:
                raise did_not_start(self._agent)
        return None

    def _epoch_ns(self, payload: bytes) -> int | None:
        """When tick 0 is by this machine's monotonic clock, None if that can't be.

        A run may end before its scenario: this controller then ends with it.
        """
        refusals = self._agent.admission.refusals
        go = Go.decode(payload)
        if go is None:
            refusals.note("go", LAUNCHER.name, "not well formed")
            return None
        epoch_ns = monotonic_of(go.epoch_ns, self._clock)
        if far := implausible_start(epoch_ns, self._schedule.longest_start_s, self._clock):
            refusals.note("go", LAUNCHER.name, "clocks", far)
            return None
        self._agent.last_tick = min(self._schedule.ticks, max(go.ticks, 0))
        return epoch_ns

    def run(self, epoch_ns: int, stop: Stop) -> None:
        """Run from the countdown to the closing tick, or until told to stop.

        Raises:
            InfrastructureError: the drives were not armed when control had to start, or the bus
                failed for too long.
            PeerLostError: our own bus closed.
        """
        schedule, agent = self._schedule, self._agent
        period_ns, phase_ns = schedule.period_ns, agent.brief.phase_ns
        self._power_up_ns = epoch_ns - schedule.countdown_ticks * period_ns
        tick = -schedule.countdown_ticks
        lateness = self._lateness
        self._drop_backlog()
        while agent.phase is not Phase.DONE:
            due_ns = epoch_ns + tick * period_ns + phase_ns
            self._read_until(due_ns)
            now_ns = self._clock.monotonic_ns()
            agent.late_s = late_s = (now_ns - due_ns) * 1e-9
            if lateness.note(tick, late_s):
                self._name_stall(tick, late_s)
            elif agent.guard.stalled and not lateness.late:
                agent.guard.stalled = ""
            if self._sent_ns and tick > 0:
                self.counters.misses += 1
                agent.round_trip_s = nan
            agent.admission.now_ns = now_ns - epoch_ns
            self._receive_messages()
            frames = agent.step(tick) if not stop.requested else agent.shut_down()
            overdue = now_ns >= due_ns + period_ns and agent.phase is Phase.DRIVING
            if overdue:
                self.counters.skipped += 1
            else:
                self._send(frames, tick)
            self.counters.ticks += tick >= 0
            if tick % self._progress_ticks == 0:
                self._progress.put(Progress(tick, tick * period_ns, 0).encode())
            tick += 1
            if schedule.shares(tick):
                self._path.put(agent.share(tick).encode())
        with suppress(can.CanError, OSError):
            self._bus.recv(0.0)  # what was gathered goes out

    def _name_stall(self, tick: int, late_s: float) -> None:
        """What a robot stops for soon after it stood still, it may stop for because it did."""
        text = f"this controller, or its machine, stalled for {late_s:.2f} s"
        if late_s > STALL_S:
            self._agent.guard.note_stall(tick, text)
        else:
            self._agent.guard.stalled = text

    def _drop_backlog(self) -> None:
        """Read what came while nobody read: taken for news, it would be a second drive's.

        A bus that fails says so again when it is used.
        """
        deadline = self._clock.monotonic_s() + BACKLOG_S
        with suppress(can.CanError, OSError):
            while self._bus.recv(0.0) is not None and self._clock.monotonic_s() < deadline:
                pass

    def _receive_messages(self) -> None:
        """Take what the network brought; of a flood no more than a tick has room for."""
        for arrival in waiting(self._link, self._most_arrivals):
            self.counters.undecodable += not deliver(self._agent, arrival)

    def _send(self, frames: Sequence[Frame], tick: int) -> None:
        send, health = self._bus.send, self._health
        try:
            for can_id, data in frames:
                send(to_message(can_id, data))
                if self._echoes is not None:
                    self._echoes.sent(Frame(can_id, data), self._clock.monotonic_s())
        except (can.CanError, OSError) as error:
            self._on_bus_error(error)
            self._agent.guard.note_unsent(tick)
        else:
            self._sent_ns = self._clock.monotonic_ns()
            if health.since_ns is not None:
                health.sent()
                self._agent.guard.bus_fault = None

    def _on_bus_error(self, error: Exception) -> None:
        """Count an error of the bus, stop the wheels if it lasts, raise if it is the end."""
        health, now_ns = self._health, self._clock.monotonic_ns()
        health.failed(error, now_ns)
        self._agent.guard.bus_fault = health.fault(now_ns)
        self.counters.unsent, self.counters.bus_errors = health.unsent, health.errors

    def _read_until(self, due_ns: int) -> None:
        """Take frames from the bus until the due time."""
        agent = self._agent
        polled = False
        while True:
            left_ns = due_ns - self._clock.monotonic_ns()
            if left_ns <= 0 and polled:
                return
            try:
                message = self._bus.recv(max(left_ns, 0) * 1e-9)
            except (can.CanError, OSError) as error:
                self._on_bus_error(error)
                # An interface that is down may say so at once, again and again.
                self._clock.sleep(max(due_ns - self._clock.monotonic_ns(), 0) * 1e-9)
                return
            polled = message is None
            if message is None:
                continue
            came_ns = self._clock.monotonic_ns()
            bus_ns = came_ns - self._power_up_ns
            can_id = can_id_of(message)
            if can_id & ERR:
                self.counters.error_frames += 1
                continue
            if self._echoes is not None and self._echoes.is_echo(to_frame(message), came_ns * 1e-9):
                continue
            agent.on_frame(can_id, message.data, bus_ns)
            if self._sent_ns and agent.feedback_since(self._sent_ns - self._power_up_ns):
                agent.round_trip_s = (came_ns - self._sent_ns) * 1e-9
                self._sent_ns = 0
