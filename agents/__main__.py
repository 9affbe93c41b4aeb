"""The process of one robot's controller: connects the agent to its bus and the network.

Started by `fleetloop run` with an `AgentBrief` on standard input; `fleetloop agent` calls `run` in
a process of its own, on the robot.
"""

from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from functools import partial
from typing import NamedTuple

import can

from agents.agent import Agent
from agents.guard import Phase
from agents.inputs import LoggedAgent
from agents.lockstep import LockstepLoop, deliver, did_not_start
from agents.realtime import RealtimeLoop
from agents.subscriptions import Subscriptions
from bridge.can_bus.frame_bus import in_frames
from bridge.can_bus.interface import FleetloopBus
from bridge.can_bus.pythoncan import open_bus
from bridge.network import keys
from bridge.network.barrier import Hellos, await_hellos
from bridge.network.client import StoppedError, open_polled
from bridge.network.clock_exchange import answer_pings
from bridge.network.inputs import InputBuffer
from bridge.network.launcher import LauncherWatch
from bridge.network.link import Arrival, Link, Publisher
from bridge.network.messages import Notice, Rows
from bridge.network.orders import OrderInbox
from bridge.network.reports import AgentReport
from bridge.network.row_socket import RowSocket, row_publisher
from bridge.network.telemetry import RowBuffer, put_rows, row_of
from bridge.network.zenoh_link import POLLED_DEPTH, ZenohLink, heard
from bridge.process.awake import LOOK_S, AwakeClock
from bridge.process.clock import process_cpu_ns
from bridge.process.lifecycle import (
    Stop,
    launcher_stopped,
    name_process,
    processor_wait_ns,
    serve,
    settle_memory,
)
from bridge.process.profile import Sampler
from bridge.process.scheduling import go_realtime
from configs.brief import AgentBrief
from configs.errors import FleetloopError, InfrastructureError
from configs.faults.absences import Absence
from configs.roles import AGENT

REALTIME_DEPTH = 64
"""Queue depth per subscription in real time; a full queue drops its oldest message."""
CONTROLLER_PRIORITY = 40
"""SCHED_FIFO priority, below the plant's: emulated drives preempt controllers."""


def run(brief: AgentBrief, stop: Stop) -> str:
    """Connect one agent to its bus and the network, wait for its peers, and run.

    Returns the reason for a stop before the end of the run, "" if there was none.
    """
    name_process(f"agent {brief.robot}")
    try:
        depth = REALTIME_DEPTH if brief.schedule.realtime else POLLED_DEPTH
        link = open_polled(brief.network, brief.schedule.start_deadline_s, stop, depth=depth)
    except StoppedError:
        return stop.reason
    watch: LauncherWatch | None = None
    with link:
        if brief.detached:
            watch = LauncherWatch(link, brief.network, stop)
            answer_pings(link, brief.network.run, AGENT.process(brief.robot))
        return _run(brief, stop, link, watch)


def _run(brief: AgentBrief, stop: Stop, link: ZenohLink, watch: LauncherWatch | None) -> str:
    name, robot = brief.network.run, brief.robot
    may_be_absent = brief.schedule.on_late != "abort"
    # A neighbour that comes again has to hear the first path state that is due.
    path = link.publisher(keys.path(name, robot), steady=may_be_absent)
    line = RowSocket.of(brief.recorder, brief.schedule)
    over_network = link.publisher(keys.telemetry(name, robot))
    telemetry = row_publisher(line, f"controller/{robot}", over_network)
    report = link.publisher(keys.report(name, AGENT.process(robot)))
    progress = link.publisher(keys.progress(name, AGENT.process(robot)))
    within_ns = brief.schedule.rows_within_ns
    watched = partial(heard, over_network)
    rows = RowBuffer(row_of(brief.signals), partial(put_rows, telemetry), within_ns, watched)
    log = None
    if brief.logs_inputs:
        inputs = row_publisher(line, f"inputs/{robot}", link.publisher(keys.inputs(name, robot)))
        log = InputBuffer(
            lambda first, block, final: put_rows(inputs, first, len(block), block, final)
        )
    agent = Agent(brief, rows) if log is None else LoggedAgent(brief, rows, log)
    notice = link.publisher(keys.notice(name, AGENT.process(robot)))
    agent.guard.announce = lambda event: notice.put(Notice(event).encode())
    link.subscribe(keys.pose(name, robot), "pose")
    subscriptions = Subscriptions(link, brief)
    for edge in brief.hears if may_be_absent else ():
        link.subscribe(keys.silence(name, edge.speaker), f"silence/{edge.speaker}")
    for other in brief.located:
        link.subscribe(keys.pose(name, other), f"place/{other}")
    if brief.leader_link is not None:
        link.subscribe(keys.leader_speed(name), "leader")
    if brief.schedule.realtime or brief.rejoins:  # else the plant's first frame is the go
        link.subscribe(keys.go(name), "go")

    hellos = Hellos(brief.schedule.hello_every_s)
    if not brief.rejoins:
        hellos.add(path, agent.share(-1).encode())
        hellos.add(telemetry, Rows(0, 0, b"", False).encode())
    process, refusals = AGENT.process(robot), agent.admission.refusals
    orders = OrderInbox(link, name, process, refusals)
    realtime = brief.schedule.realtime
    if brief.rejoins and not realtime and not _heard_the_go(link, agent, brief, stop):
        return stop.reason
    with open_bus(brief.robot, brief.bus) as bus:
        connections = _Connections(
            agent,
            bus,
            link,
            subscriptions,
            path,
            hellos,
            rows,
            report,
            progress,
            orders,
            watch,
            log,
            line,
        )
        return (_realtime if realtime else _lockstep)(connections, stop)


def _heard_the_go(link: Link, agent: Agent, brief: AgentBrief, stop: Stop) -> bool:
    """Wait for the go of a lockstep run that goes on, once more; False on a stop.

    It is what was subscribed to last: with it all subscriptions are in force. Only then does the
    controller come to its bus, for which bus time stands still.
    """
    clock = AwakeClock(held=launcher_stopped)
    deadline = clock.now() + brief.schedule.start_deadline_s
    while clock.now() < deadline:
        arrival = link.receive(LOOK_S)
        if stop.requested:
            return False
        if arrival is not None and arrival.tag == "leader":
            deliver(agent, arrival)
        if arrival is not None and arrival.tag == "go":
            return True
    raise did_not_start(agent)


class _Connections(NamedTuple):
    """One agent with its bus, its link and its publishers."""

    agent: Agent
    bus: can.BusABC
    link: Link
    subscriptions: Subscriptions
    path: Publisher
    hellos: Hellos
    rows: RowBuffer
    report: Publisher
    progress: Publisher
    orders: OrderInbox | None = None
    watch: LauncherWatch | None = None
    inputs: InputBuffer | None = None
    line: RowSocket | None = None

    def await_peers(self, deliver: Callable[[Arrival], None], stop: Stop) -> None:
        """Wait for the first message of every peer, then declare this controller ready."""
        brief = self.agent.brief
        await_hellos(
            self.link,
            self.hellos,
            deliver,
            self.agent.missing_to_start,
            name=brief.robot,
            within_s=brief.schedule.start_deadline_s,
            stop=stop,
        )
        self.link.declare_live(keys.live(brief.network.run, AGENT.process(brief.robot)))

    def run(
        self,
        body: Callable[[], None],
        stop: Stop,
        loop: LockstepLoop | RealtimeLoop,
        missing_privileges: Sequence[str] = (),
    ) -> str:
        """Run the loop's body; then stop the wheels, publish the last rows and the report.

        Returns the reason for an early end of the body, "" if there was none.
        """
        sampler = Sampler()
        began_ns, waited_ns = process_cpu_ns(), processor_wait_ns()
        failure = ""

        def say_last(failure: str = "", early: str = "") -> None:
            guard = self.agent.guard
            report = AgentReport(
                failure=failure,
                left_early="" if self.agent.closed else early,
                events=tuple(guard.events),
                remarks=(*self.agent.remarks(), *(self.line.remarks() if self.line else ())),
                flooders=tuple(self.agent.admission.refusals.floods()),
                missing_privileges=tuple(missing_privileges),
                cpu_ns=process_cpu_ns() - began_ns,
                durations_ns=loop.counters.durations_ns()
                | {"processor": processor_wait_ns() - waited_ns},
                profile_ns=sampler.nanoseconds(),
                stop_reason=guard.stop_reason,
                messages=self.agent.network.counts() if self.agent.network else {},
                stop_tick=guard.stop_tick,
                deadlines=loop.counters.deadlines(),
            )
            self.report.put(report.encode())
            stop.await_release()

        loop.faults.hand_on, loop.faults.heard = self.hand_on, stop.await_heard
        loop.faults.last_word, loop.faults.awake = say_last, self.rows.announce
        if self.agent.brief.rejoins:
            self.rows.announce()
        try:
            with sampler if self.agent.brief.schedule.profile else nullcontext():
                body()
        except FleetloopError as error:
            failure = str(error)
            raise
        finally:
            self.stop_wheels()
            early = stop.reason
            self.rows.finish()
            if self.inputs is not None:
                self.inputs.finish()
            if self.line is not None:
                self.line.flush()
            say_last(failure, early)
        return early

    def hand_on(self, absence: Absence) -> None:
        """Hand on all rows and inputs; unless this robot's controller returns, they may end here.

        One that is frozen, and not replaced, has them all afterwards.
        """
        schedule, returns = self.agent.brief.schedule, absence.to_tick is not None
        if not (schedule.realtime or schedule.on_late != "abort"):
            self.rows.finish()
        elif absence.frozen and returns and schedule.on_late != "drop":
            self.rows.hand_on()
        else:
            self.rows.leave(schedule.ticks, final=not returns)
        if self.inputs is not None:
            (self.inputs.hand_on if returns else self.inputs.finish)()
        if self.line is not None:
            self.line.flush()

    def stop_wheels(self) -> None:
        """Disarm the drives, as far as the bus still sends, after a loop that ended early."""
        if self.agent.phase is Phase.DONE:
            return
        bus = in_frames(self.bus)
        for frame in self.agent.shut_down():
            with suppress(can.CanError, OSError):
                bus.send(frame)
        with suppress(can.CanError, OSError):
            bus.receive_frames(0.0)  # sends what is batched


def _lockstep(connections: _Connections, stop: Stop) -> str:
    bus = connections.bus
    if not isinstance(bus, FleetloopBus):
        raise InfrastructureError(
            f"{connections.agent.brief.robot}: lockstep needs a Fleetloop bus"
        )
    loop = LockstepLoop(
        connections.agent,
        bus.client,
        connections.link,
        connections.subscriptions,
        connections.path,
        connections.hellos,
        connections.progress,
        connections.orders,
    )
    connections.await_peers(loop.on_arrival, stop)
    first = loop.await_first_frame(stop)
    if first is None:
        return stop.reason
    settle_memory()
    return connections.run(partial(loop.run, first, stop), stop, loop)


def _realtime(connections: _Connections, stop: Stop) -> str:
    loop = RealtimeLoop(
        connections.agent,
        in_frames(connections.bus),
        connections.link,
        connections.subscriptions,
        connections.path,
        connections.hellos,
        connections.progress,
        connections.orders,
        watch=connections.watch,
    )
    settle_memory()
    missing = go_realtime(CONTROLLER_PRIORITY)  # before it is ready: it may read from a slow disk
    connections.await_peers(partial(deliver, connections.agent), stop)
    epoch_ns = loop.await_go(stop)
    if epoch_ns is None:
        return stop.reason
    # It is looked at no more.
    connections.link.unsubscribe(keys.go(connections.agent.brief.network.run))
    return connections.run(partial(loop.run, epoch_ns, stop), stop, loop, missing)


def _serve(brief: AgentBrief, stop: Stop) -> None:
    run(brief, stop)


def main() -> int:
    """Serve as a controller; return the exit status."""
    return serve(AgentBrief, _serve, name="agent")


if __name__ == "__main__":
    raise SystemExit(main())
