"""The plant's process: emulated drives and physics of all robots, and in lockstep the clock.

Started by `fleetloop run` with a `PlantBrief` on standard input and the buses' listening sockets as
inherited file descriptors.
"""

import socket
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from functools import partial

from bridge.can_bus.drive_port import DrivePort
from bridge.can_bus.hub import Hub
from bridge.network import keys
from bridge.network.barrier import Hellos, await_hellos
from bridge.network.client import StoppedError, open_client
from bridge.network.clock_exchange import answer_pings
from bridge.network.launcher import LauncherWatch
from bridge.network.link import Arrival, Link, Publisher, waiting
from bridge.network.messages import Go, Notice, PoseFix, Progress, Rows, Silence
from bridge.network.orders import OrderInbox
from bridge.network.refused_messages import Refusals
from bridge.network.reports import PlantReport
from bridge.network.row_socket import RowSocket, row_publisher
from bridge.network.telemetry import PLANT_ROW, FrameBuffer, RowBuffer, put_rows
from bridge.network.zenoh_link import ZenohLink, heard
from bridge.process.awake import Stall
from bridge.process.clock import SYSTEM_CLOCK, implausible_start, monotonic_of, process_cpu_ns
from bridge.process.lifecycle import (
    Stop,
    processor_wait_ns,
    serve,
    settle_memory,
)
from bridge.process.profile import Sampler
from bridge.process.scheduling import go_realtime
from configs.brief import PlantBrief
from configs.connections import Settings
from configs.errors import FleetloopError, InfrastructureError, PeerLostError
from configs.events import Event
from configs.roles import AGENT, PLANT
from configs.sections import Pose
from plant.absent import AbsentControllers
from plant.counters import PlantCounters
from plant.herald import Herald
from plant.lockstep import LockstepLoop
from plant.orders import PlantOrders
from plant.pacing import Pacing
from plant.real_robot import RealRobot
from plant.realtime import RealtimeLoop
from plant.robot import emulated_robot
from plant.status import Narrator, PlantMeter
from plant.troubles import bus_troubles, diverged_robots, divergences, stall_events, trouble_events

PLANT_PRIORITY = 45
"""SCHED_FIFO, above the controllers'."""
GO_SHARE = 1.25
"""Multiple of the start deadline that the plant waits for the go: a role that misses a peer names
it first."""
ARRIVALS_PER_ROBOT = 16
"""Poses of a robot that isn't emulated that are looked at in one tick: the rest waits."""
EARLY = -1
"""Tick of the poses that only prove the link, before the run."""


def run(brief: PlantBrief, stop: Stop) -> str:
    """Connect the plant to its buses and the network, wait for all roles, and run."""
    listeners = {bus: socket.socket(fileno=fd) for bus, fd in brief.listeners}
    try:
        link = open_client(brief.network, brief.schedule.start_deadline_s, stop)
    except StoppedError:
        return "ended before it began"
    with link:
        if brief.detached:
            LauncherWatch(link, brief.network, stop)
            answer_pings(link, brief.network.run, PLANT.name)
        queue = brief.wire.txqueuelen if brief.wire else 0
        hub = Hub(listeners, stop.wake_fd, queue=queue, controllers=_controllers(brief))
        end: DrivePort = hub
        try:
            end = join(hub, brief.attached)
            counters = _run(brief, stop, link, hub, end)
        finally:
            end.close(stop.reason or "the plant has ended")
    return f"ended after {counters.ticks} ticks"


def _controllers(brief: PlantBrief) -> dict[str, dict[str, str]]:
    """The secrets of the controllers that the buses wait for, by bus and robot."""
    bus_of = {robot.robot: robot.bus for robot in brief.robots}
    found: dict[str, dict[str, str]] = {}
    for robot, secret in brief.controllers:
        found.setdefault(bus_of[robot], {})[robot] = secret
    return found


def join(hub: Hub, attached: Sequence[tuple[str, Settings]]) -> DrivePort:
    """The drives' end of all buses: ours on the hub, and those that are attached.

    Raises:
        InfrastructureError: one of them can't be opened.
    """
    if not attached:
        return hub
    from bridge.can_bus.external import CombinedPort, ExternalBuses

    names = [name for name, _ in attached]
    return CombinedPort(hub, ExternalBuses(dict(attached)), names)


def _run(brief: PlantBrief, stop: Stop, link: ZenohLink, hub: Hub, end: DrivePort) -> PlantCounters:
    name = brief.network.run
    emulated = [emulated_robot(robot) for robot in brief.robots]
    others = [RealRobot(robot, start) for robot, start in brief.real_robots]
    # In real time all poses are of one instant: they travel together.
    express = not brief.schedule.realtime
    leaves_some = brief.schedule.on_late != "abort"
    poses = [
        link.publisher(keys.pose(name, r.brief.robot), express=express, steady=leaves_some)
        for r in emulated
    ]
    silences = _silences(brief, link)
    robots = [*(robot.brief.robot for robot in emulated), *(other.robot for other in others)]
    line = RowSocket.of(brief.recorder, brief.schedule)
    over_network = [link.publisher(keys.truth(name, robot)) for robot in robots]
    truths = [
        row_publisher(line, f"plant/{robot}", publisher)
        for robot, publisher in zip(robots, over_network, strict=True)
    ]
    within_ns = brief.schedule.rows_within_ns
    rows = [
        RowBuffer(PLANT_ROW, partial(put_rows, truth), within_ns, partial(heard, publisher))
        for truth, publisher in zip(truths, over_network, strict=True)
    ]
    logs: dict[str, FrameBuffer] = {}
    if brief.traffic:
        for bus in dict.fromkeys(robot.bus for robot in brief.robots):
            publisher = link.publisher(keys.traffic(name, bus), express=False)
            traffic = row_publisher(line, f"can/{bus}", publisher)
            truths.append(traffic)
            logs[bus] = FrameBuffer(partial(put_rows, traffic))
    progress = link.publisher(keys.progress(name, PLANT.name))
    report = link.publisher(keys.report(name, PLANT.name))
    refusals = Refusals()
    inbox = OrderInbox(link, name, PLANT.name, refusals)
    relays = _relays(brief, link)
    link.subscribe(keys.go(name), "go")
    for other in others:
        link.subscribe(keys.pose(name, other.robot), other.robot)

    starts = zip(poses, [robot.brief.pose for robot in emulated], strict=True)
    hellos = _hellos(brief.schedule.hello_every_s, starts, silences.values(), truths)
    stalls: list[Stall] = []
    loop: LockstepLoop | RealtimeLoop

    def news(tick: int) -> dict[str, Event]:
        found = trouble_events(tick, bus_troubles(end.troubles(), emulated))
        return found | stall_events(stalls) | divergences(emulated, brief.schedule.period_ns)

    notice = link.publisher(keys.notice(name, PLANT.name))
    herald = Herald(news, lambda event: notice.put(Notice(event).encode()))

    narrator = Narrator(progress, brief.schedule.status_every_s)

    def say(state: Progress) -> None:
        narrator.say(state)
        herald.look(state.tick)

    missing_privileges: list[str] = []
    body: Callable[[Stop], None]
    waits_for: Callable[[], Sequence[str]]
    if brief.schedule.realtime:
        settle_memory()
        # Before it is ready: what is locked in memory may have to be read from a slow disk.
        missing_privileges = go_realtime(PLANT_PRIORITY)
        link.declare_live(keys.live(name, PLANT.name))
        epoch_ns = _serve_until_go(brief, end, link, hellos, stop)
        by_name = {other.robot: other for other in others}
        own, of_others = rows[: len(emulated)], rows[len(emulated) :]
        record = partial(_record, link, by_name, of_others, brief.schedule.period_s)
        orders = PlantOrders(brief.schedule, inbox, relays)
        loop = wall = RealtimeLoop(
            brief, emulated, end, hub, poses, own, say, logs, record, of_others, orders
        )
        counters, progress_of, stalls = wall.counters, wall.progress, wall.lateness.stalls
        waits_for = tuple  # nobody
        body = partial(wall.run, epoch_ns)
    else:
        _await_controllers(brief, hub, hellos, stop)
        link.declare_live(keys.live(name, PLANT.name))
        _await_go(brief, link, hellos, stop)
        settle_memory()
        absent = AbsentControllers(brief, hub, silences, herald.note)
        pacing = Pacing(brief.schedule, brief.speed)
        orders = PlantOrders(brief.schedule, inbox, relays, absent, pacing)
        loop = lockstep = LockstepLoop(brief, emulated, hub, poses, rows, say, logs, absent, orders)
        counters, progress_of, body = lockstep.counters, lockstep.progress, lockstep.run
        waits_for = lockstep.waits_for
    for served in loop.buses.values():
        served.faults.note = herald.note
    narrator.meter = PlantMeter(loop.buses, emulated, waits_for)
    sampler = Sampler()
    began_ns, waited_ns = process_cpu_ns(), processor_wait_ns()
    try:
        with sampler if brief.schedule.profile else nullcontext():
            _body(body, stop)
        end.close(stop.reason or "end of the run")
    except FleetloopError as error:
        end.close(str(error))
        raise
    finally:
        for buffer in rows:
            buffer.finish()
        for log in logs.values():
            log.finish()
        if line is not None:
            line.flush()
        say(progress_of())
        summary = PlantReport(
            events=tuple(herald.events),
            remarks=(
                *refusals.lines(),
                *herald.remarks(),
                *(line.remarks() if line is not None else ()),
            ),
            left_early=stop.reason if counters.ticks < brief.schedule.ticks else "",
            missing_privileges=tuple(missing_privileges),
            cpu_ns=process_cpu_ns() - began_ns,
            durations_ns={
                "wall": counters.wall_ns,
                "waited": counters.waited_ns,
                "processor": processor_wait_ns() - waited_ns,
            },
            profile_ns=sampler.nanoseconds(),
            overruns=counters.overruns,
            frames=counters.frames,
            stopped_robots=diverged_robots(emulated, brief.schedule.period_ns),
            bus_troubles=bus_troubles(end.troubles(), emulated),
            stalls=tuple(stalls),
            nodes=counters.nodes,
        )
        report.put(summary.encode())
        stop.await_release()
    return counters


def _hellos(
    every_s: float,
    starts: Iterable[tuple[Publisher, Pose]],
    silences: Iterable[Publisher],
    truths: Iterable[Publisher],
) -> Hellos:
    """What the plant says until the run begins: start poses, and that its other links are there."""
    hellos = Hellos(every_s)
    for pose, start in starts:
        hellos.add(pose, PoseFix(EARLY, 0, start.x_m, start.y_m, start.theta_rad).encode())
    for silence in silences:
        hellos.add(silence, Silence(EARLY).encode())
    for truth in truths:
        hellos.add(truth, Rows(0, 0, b"", False).encode())
    return hellos


def _relays(brief: PlantBrief, link: Link) -> dict[str, Publisher]:
    """By robot, where orders to controllers are handed on: in lockstep the plant has them all."""
    told = () if brief.schedule.realtime else [robot.robot for robot in brief.robots]
    return {
        robot: link.publisher(keys.order(brief.network.run, AGENT.process(robot))) for robot in told
    }


def _silences(brief: PlantBrief, link: Link) -> dict[str, Publisher]:
    """By robot, where the plant says that it has no path state; none if no run goes on without."""
    if brief.schedule.on_late == "abort":
        return {}
    run, robots = brief.network.run, [robot.robot for robot in brief.robots]
    return {robot: link.publisher(keys.silence(run, robot)) for robot in robots}


def _body(body: Callable[[Stop], None], stop: Stop) -> None:
    """Run the loop; that controllers left first when all were to stop is no failure."""
    try:
        body(stop)
    except PeerLostError:
        if not stop.requested_soon():
            raise


def _await_go(brief: PlantBrief, link: Link, hellos: Hellos, stop: Stop) -> None:
    gone: set[str] = set()

    def note(arrival: Arrival) -> None:
        gone.add(arrival.tag)

    await_hellos(
        link,
        hellos,
        note,
        lambda: () if gone else ("the launcher's go",),
        name="plant",
        within_s=brief.schedule.start_deadline_s,
        stop=stop,
    )


def _serve_until_go(
    brief: PlantBrief, end: DrivePort, link: Link, hellos: Hellos, stop: Stop
) -> int:
    """Say hello and serve the buses until the launcher says when tick 0 is.

    By this machine's clock: the go is an instant of it, and other processes are waited for.
    """
    limit_s = GO_SHARE * brief.schedule.start_deadline_s
    wrong: str | None = None
    deadline = SYSTEM_CLOCK.monotonic_s() + limit_s
    while SYSTEM_CLOCK.monotonic_s() < deadline and not stop.requested:
        hellos.say()
        end.serve(0.02)
        for arrival in waiting(link):
            go = Go.decode(arrival.payload) if arrival.tag == "go" else None
            if go is None:
                continue
            epoch_ns = monotonic_of(go.epoch_ns)
            wrong = implausible_start(epoch_ns, brief.schedule.longest_start_s)
            if wrong is None:
                return epoch_ns
    if stop.requested:
        return SYSTEM_CLOCK.monotonic_ns()
    raise InfrastructureError(
        f"plant: not ready after {limit_s:g} s: {wrong or 'no go from the launcher'}"
    )


def _record(
    link: Link,
    others: Mapping[str, RealRobot],
    rows: Sequence[RowBuffer],
    period_s: float,
    tick: int,
) -> None:
    """A row of each robot that isn't emulated."""
    if not others:
        return
    for arrival in waiting(link, ARRIVALS_PER_ROBOT * len(others)):
        if (other := others.get(arrival.tag)) is not None:
            other.receive_pose(PoseFix.decode(arrival.payload))
    for other, buffer in zip(others.values(), rows, strict=True):
        buffer.add(tick, other.row(tick * period_s))


def _await_controllers(brief: PlantBrief, hub: Hub, hellos: Hellos, stop: Stop) -> None:
    """Say hello until every robot's controller is on its bus; bounded by the start deadline."""
    rounds = int(brief.schedule.start_deadline_s / 0.02)
    for _ in range(rounds):
        hellos.say()
        missing = hub.await_controllers(0.02)
        if not missing or stop.requested:
            return
    raise InfrastructureError(
        f"plant: not ready after {brief.schedule.start_deadline_s:g} s:"
        f" no controller of {', '.join(missing)} on its bus"
    )


def main() -> int:
    """Serve as the plant; return the exit status."""
    return serve(PlantBrief, run, name="plant")


if __name__ == "__main__":
    raise SystemExit(main())
