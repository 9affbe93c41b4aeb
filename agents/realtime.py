"""The loop of one controller in real time: the wall clock is the clock, the newest data wins.

    due time of tick k   epoch + k h + phase, absolute: lateness does not accumulate
    before it            receive frames at once, and measure the round trip of feedback
    at it                receive messages, compute, send torques, share when due

Controllers have different phases, so that they and the plant don't all wake at one instant. The
controller does not wait for feedback: a *miss* is a tick whose torques had no feedback when the
next tick was due. A tick later than a period is computed without sending, so that the path variable
keeps time. Frames received before the start of the run are dropped, echoes of the controller's own
frames are ignored. Errors of the interface are handled in `agents.bus_health`.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import nan
from typing import Final

import can

from agents.agent import Agent, Trouble
from agents.bus_health import BusHealth
from agents.guard import Phase
from agents.lockstep import deliver, did_not_start, take_orders
from agents.process_faults import ProcessFaults
from agents.status import Narrator
from agents.subscriptions import Subscriptions
from bridge.can_bus.echo import Echoes, hands_back
from bridge.can_bus.frame_bus import FrameBus
from bridge.frame import ERR, Frame
from bridge.network.barrier import Hellos
from bridge.network.launcher import CUT_OFF, LauncherWatch
from bridge.network.link import Link, Publisher, waiting
from bridge.network.messages import PROGRESS_EVERY_S, Go
from bridge.network.orders import OrderInbox
from bridge.network.reports import Deadlines
from bridge.network.telemetry import LOOKS
from bridge.process.awake import STALL_S, Lateness
from bridge.process.clock import SYSTEM_CLOCK, Clock, implausible_start, monotonic_of
from bridge.process.lifecycle import Stop
from configs.roles import LAUNCHER
from configs.ticks import Ticks

ARRIVALS_PER_TICK: Final = 64
"""Most messages per tick, besides two for every in-neighbour: the rest waits."""
BACKLOG_S: Final = 1.0
"""Longest time for dropping the backlog of the bus; no interface queues more."""


_STALL_NS: Final = round(STALL_S * 1e9)


@dataclass(slots=True)
class RealtimeCounters:
    """Ticks, deadlines missed and errors of a controller."""

    ticks: int = 0
    misses: int = 0  # no feedback of its torques before the next tick was due
    skipped: int = 0  # computed after the next tick was due, and not sent
    unsent: int = 0  # ticks whose frames found the transmit queue full
    error_frames: int = 0  # reported by the CAN controller

    def durations_ns(self) -> dict[str, int]:
        """Empty: in real time the rest of a period is waiting."""
        return {}

    def deadlines(self) -> Deadlines:
        """Missed and skipped ticks, for the report."""
        return Deadlines(self.misses, self.skipped)


class RealtimeLoop:
    """Runs one agent on its bus and its link by the wall clock."""

    def __init__(
        self,
        agent: Agent,
        bus: FrameBus,
        link: Link,
        subscriptions: Subscriptions,
        path: Publisher,
        hellos: Hellos,
        progress: Publisher,
        orders: OrderInbox | None = None,
        *,
        watch: LauncherWatch | None = None,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._clock = clock
        self._orders = orders
        self._agent = agent
        self._schedule = agent.brief.schedule
        self._robot = agent.brief.robot
        self._bus = bus
        self._link = link
        self._subscriptions = subscriptions
        self._path = path
        self._hellos = hellos
        self._progress = progress
        self._watch = watch
        self._away = False  # as the guard was told
        self._narrator = Narrator(agent)
        every_s = min(self._schedule.status_every_s, PROGRESS_EVERY_S)
        self._progress_ticks = max(round(every_s / self._schedule.period_s), 1)
        self._rows = agent.rows
        self._look_s = agent.brief.schedule.rows_within_ns * 1e-9 / LOOKS
        self._lateness = Lateness(agent.brief.schedule.period_s)
        self._health = BusHealth(agent.brief.robot, agent.brief.host.bus_error_limit_ns)
        self._echoes = Echoes() if hands_back(agent.brief.bus) else None
        self._most_arrivals = ARRIVALS_PER_TICK + 2 * len(agent.brief.hears)
        self._power_up_ns = 0
        self._sent_ns = 0  # send time of torques without feedback; 0: none
        self._round_trip_s = 0.0  # of the last torques whose feedback came; NaN: a miss since
        self.faults = ProcessFaults(agent.brief, agent.guard.note, clock=clock)
        """Faults of this process."""
        self.counters = RealtimeCounters()

    def await_go(self, stop: Stop) -> int | None:
        """Say hello until the launcher announces the time of tick 0; None on a stop."""
        deadline = self._clock.monotonic_s() + self._schedule.start_deadline_s
        while not stop.requested:
            self._drop_backlog()
            self._hellos.say()
            arrival = self._link.receive(0.02)
            # Peers say hello all the time: waiting here would delay this controller's hellos.
            for _ in range(self._most_arrivals):
                if arrival is None:
                    break
                if arrival.tag != "go":
                    # Of a run that goes on nothing else can be judged before the time is known.
                    if not self._agent.brief.rejoins or arrival.tag == "leader":
                        deliver(self._agent, arrival)
                elif (epoch_ns := self._epoch_ns(arrival.payload)) is not None:
                    return epoch_ns
                arrival = self._link.receive(0.0)
            if self._clock.monotonic_s() > deadline:
                raise did_not_start(self._agent)
        return None

    def _epoch_ns(self, payload: bytes) -> int | None:
        """Time of tick 0 by this machine's monotonic clock, None if it is implausible.

        Sets the closing tick of a run that ends before its scenario.
        """
        refusals = self._agent.admission.refusals
        go = Go.decode(payload)
        if go is None:
            refusals.note("go", LAUNCHER.name, "not well formed")
            return None
        epoch_ns = monotonic_of(go.epoch_ns, self._clock)
        within_s = self._schedule.longest_start_s
        if self._agent.brief.rejoins:
            within_s += self._schedule.ticks * self._schedule.period_s
        if far := implausible_start(epoch_ns, within_s, self._clock):
            refusals.note("go", LAUNCHER.name, "clocks", far)
            return None
        self._agent.end_at(min(self._schedule.ticks, max(go.ticks, 0)))
        return epoch_ns

    def run(self, epoch_ns: int, stop: Stop) -> None:
        """Run from the countdown, or of a run that goes on from now, to the closing tick or a stop.

        Raises:
            InfrastructureError: the drives were not armed when control had to start, or the bus
                failed for too long.
            PeerLostError: a Fleetloop bus closed.
        """
        schedule, agent = self._schedule, self._agent
        period_ns, phase_ns = schedule.period_ns, agent.brief.phase_ns
        self._power_up_ns = epoch_ns - schedule.countdown_ticks * period_ns
        tick = -schedule.countdown_ticks
        if agent.brief.rejoins:
            gone = (self._clock.monotonic_ns() - epoch_ns - phase_ns) // period_ns + 1
            tick = min(max(tick, gone), agent.last_tick)
        faults = self.faults
        faults.skip_to(tick)
        lateness, subscriptions, ticks = self._lateness, self._subscriptions, Ticks(schedule)
        distances_m = agent.network.distances_m if agent.network is not None else {}
        self._drop_backlog()
        while agent.phase is not Phase.DONE:
            due_ns = epoch_ns + tick * period_ns + phase_ns
            self._read_until(due_ns)
            if tick >= faults.due_tick:
                faults.begin(tick)
            now_ns = self._clock.monotonic_ns()
            late_s = (now_ns - due_ns) * 1e-9
            if lateness.note(tick, late_s):
                self._name_stall(tick, late_s)
            elif agent.guard.stalled and not lateness.late:
                agent.note_trouble(Trouble.MACHINE, None)
            if self._sent_ns and tick > 0:
                self.counters.misses += 1
                self._round_trip_s = nan
            if self._watch is not None and self._watch.away is not self._away:
                self._away = self._watch.away
                agent.note_trouble(Trouble.LAUNCHER, CUT_OFF if self._away else None)
                agent.guard.note(tick, "cut_off" if self._away else "back", "the launcher")
            agent.keep_time(now_ns - epoch_ns, late_s, self._round_trip_s)
            self._receive_messages()
            if self._orders is not None and self._orders.waiting:
                take_orders(agent, faults, self._orders, tick)
            frames = agent.step(tick) if not stop.requested else agent.shut_down()
            overdue = now_ns >= due_ns + period_ns and agent.phase is Phase.DRIVING
            if overdue:
                self.counters.skipped += 1
            else:
                self._send(frames, tick)
            self.counters.ticks += tick >= 0
            if tick % self._progress_ticks == 0:
                self._progress.put(self._narrator.progress(tick).encode())
            subscriptions.follow(tick, distances_m)
            tick += 1
            if ticks.shares(tick) and agent.speaks(tick):
                self._path.put(agent.share(tick).encode())
        with suppress(can.CanError, OSError):
            self._bus.receive_frames(0.0)  # sends what is batched

    def _name_stall(self, tick: int, late_s: float) -> None:
        """Note a stall: a fault soon after it may be its consequence."""
        text = f"this controller, or its machine, stalled for {late_s:.2f} s"
        self._agent.note_trouble(Trouble.MACHINE, text)
        if late_s > STALL_S:
            self._agent.guard.note(tick, "stalled", text)

    def _drop_backlog(self) -> None:
        """Drop queued frames: processed late, as after a stall, they look like a second drive's.

        Errors are ignored here: a bus that fails does so again at its next use.
        """
        deadline = self._clock.monotonic_s() + BACKLOG_S
        with suppress(can.CanError, OSError):
            while self._bus.receive_frames(0.0) is not None:
                if self._clock.monotonic_s() >= deadline:
                    return

    def _receive_messages(self) -> None:
        """Deliver waiting messages, at most as many as a tick has time for."""
        for arrival in waiting(self._link, self._most_arrivals):
            deliver(self._agent, arrival)

    def _send(self, frames: Sequence[Frame], tick: int) -> None:
        send, health = self._bus.send, self._health
        try:
            for frame in frames:
                send(frame)
                if self._echoes is not None:
                    self._echoes.sent(frame, self._clock.monotonic_s())
        except (can.CanError, OSError) as error:
            self._on_bus_error(error)
            self._agent.note_unsent(tick)
        else:
            self._sent_ns = self._clock.monotonic_ns()
            if health.since_ns is not None:
                health.sent()
                self._agent.note_trouble(Trouble.BUS, None)

    def _on_bus_error(self, error: Exception) -> None:
        """Count an error of the bus; stop the wheels if it lasts; raise if it is final."""
        health, now_ns = self._health, self._clock.monotonic_ns()
        health.failed(error, now_ns)
        self._agent.note_trouble(Trouble.BUS, health.fault(now_ns))
        self.counters.unsent = health.unsent

    def _read_until(self, due_ns: int) -> None:
        """Receive frames until the due time."""
        receive, now_ns = self._bus.receive_frames, self._clock.monotonic_ns
        polled = False
        while True:
            left_ns = due_ns - now_ns()
            if left_ns <= 0 and polled:
                return
            try:
                frames = receive(min(max(left_ns, 0) * 1e-9, self._look_s))
            except (can.CanError, OSError) as error:
                self._on_bus_error(error)
                # An interface that is down may fail at once at every call.
                self._clock.sleep(max(due_ns - now_ns(), 0) * 1e-9)
                return
            polled = frames is None
            came_ns = now_ns()
            if frames is None:
                self._rows.look(came_ns)
                continue
            if came_ns - due_ns > _STALL_NS:
                self._drop_backlog()
                return
            for frame in frames:
                self._take(frame, came_ns)

    def _take(self, frame: Frame, came_ns: int) -> None:
        """Give the agent one frame that came at a time; measure the round trip that it ends."""
        agent = self._agent
        if frame.can_id & ERR:
            self.counters.error_frames += 1
            return
        if self._echoes is not None and self._echoes.is_echo(frame, came_ns * 1e-9):
            return
        agent.on_frame(frame.can_id, frame.data, came_ns - self._power_up_ns)
        if self._sent_ns and agent.feedback_since(self._sent_ns - self._power_up_ns):
            self._round_trip_s = (came_ns - self._sent_ns) * 1e-9
            self._sent_ns = 0
