"""A run over processes, by either clock: start all, supervise, end all, whatever happens.

    launcher   this process: Zenoh router with access control, operator's end of the control plane
    plant      emulated drives and physics of all robots; in lockstep, owner of the clock
    agents     one controller per robot
    recorder   writes the record

Roles that a deployment has on other machines are waited for, supervised and ended over the network.

Start: sockets first, then processes, then the barrier: every process proves its links and declares
a liveliness token; with the last one the launcher says go. `fleetloop.launch.supervision` finds
failures, `fleetloop.launch.ending` ends the processes.
"""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from bridge.can_bus import sockets
from bridge.can_bus.relay import Relay
from bridge.network import keys
from bridge.network.barrier import Hellos
from bridge.network.messages import Go, LeaderSpeed, Progress
from bridge.network.router import LauncherLink, join_router, open_router
from bridge.process.clock import SYSTEM_CLOCK, Clock, process_cpu_ns, wall_of
from bridge.process.lifecycle import Stop
from configs.connections import LEASE_S, LOCAL_LEASE_S, NetworkLink
from configs.deployment import Deployment
from configs.errors import InfrastructureError
from configs.events import Event
from configs.resolve import schedule
from configs.roles import LAUNCHER, PLANT, identity_of, processes_of
from configs.scenario import Scenario
from fleetloop.door.server import Door
from fleetloop.launch import open_files, placement
from fleetloop.launch.accounts import complete
from fleetloop.launch.child import GAVE_UP, Child, Failure, end
from fleetloop.launch.clock_gate import ClockGate
from fleetloop.launch.clock_offsets import EVERY_S, START_EVERY_S
from fleetloop.launch.control_plane import ControlPlane
from fleetloop.launch.ending import DRAIN_S, Ending
from fleetloop.launch.fork_server import ForkServer
from fleetloop.launch.machine import WATCH_EVERY_S, MachineWatch
from fleetloop.launch.outcome import Outcome
from fleetloop.launch.process_faults import ProcessFaults
from fleetloop.launch.remote_roles import RemoteRoles
from fleetloop.launch.restarts import Restarts
from fleetloop.launch.row_lines import RowLines
from fleetloop.launch.run_requests import RunRequests
from fleetloop.launch.spawn import Orders, respawn, spawn, viewer_brief
from fleetloop.launch.supervision import CONSEQUENCES_S, Supervision
from fleetloop.launch.viewer import Viewer
from fleetloop.robot_states import RobotBoard, buses_of

GO_AHEAD_NS = 200_000_000
"""In real time, from the go to power-up: for the go to reach every process."""
UNREAD_SHARE = 0.25
"""Part of the tick deadline after which a client that doesn't read is cut off: all wait for it."""
LOOK_EVERY_S = 0.1
BETWEEN_LOOKS_S = 0.01
"""Shortest time between two looks at the processes of a run, however much they say."""
"""Interval between inspections of connections for floods."""
_MOST_OTHERS = 3


class ProcessRun:
    """One run of a scenario over processes."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        run: str,
        record: Path,
        speed: float,
        profile: bool,
        on_progress: Callable[[Progress], None],
        on_event: Callable[[Event], None] = lambda _: None,
        on_notice: Callable[[str, str], None] = lambda *_: None,
        deployment: Deployment | None = None,
        live: bool = False,
        fork_server: ForkServer | None = None,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._clock = clock
        self._fork_server = fork_server
        self._live = live
        self._scenario = scenario
        self._deployment = deployment or Deployment()
        self._orders = Orders.of(scenario, self._deployment, record, speed, profile=profile)
        self._run = placement.run_name(scenario, self._deployment) or run
        self._processes = processes_of(scenario.names)
        self._schedule = schedule(scenario, speed)
        self._machine = MachineWatch(
            lambda: self.outcome.ticks * self._schedule.period_s,
            lambda text: self._plane.note(LAUNCHER.name, "stalled", text),
            clock=clock,
        )
        self._now = self._machine.clock.now
        network = self._deployment.network
        rejoin_s = network.rejoin_s if network is not None else 0.0
        self._remote = RemoteRoles(self._deployment.elsewhere(scenario), rejoin_s)
        self._plane = ControlPlane(
            self._schedule,
            self._remote,
            RobotBoard(buses_of(scenario)),
            self._now,
            self._note_progress,
            self._note_event,
            on_notice,
        )
        self.robots = self._plane.robots
        """What is to be seen of each robot now."""
        # A launcher that has lost a router of its own hears of nobody.
        patience_s = rejoin_s if placement.is_external(self._deployment) else 0.0
        self._supervision = Supervision(self._plane, self._schedule, patience_s)
        limit_s = self._schedule.tick_deadline_s
        self._ending = Ending(self._plane, self._run, self._machine, record, limit_s)
        self._hellos = Hellos(self._schedule.hello_every_s, clock=clock)
        self._next_look_s = self._next_turn_s = 0.0
        self._clocks = ClockGate(scenario, self._deployment, self._plane.clocks, self._now)
        self._links: dict[str, NetworkLink] = {}
        self._lines: RowLines
        self._viewer = Viewer(
            lambda token: viewer_brief(self._orders, self._links, self._run, token),
            self._schedule.start_deadline_s,
            partial(on_notice, "live"),
            self._now,
        )
        self._asked = RunRequests(self._orders, self._schedule, self._plane, self._viewer)
        self._on_event, self._on_progress = on_event, on_progress

    @property
    def name(self) -> str:
        """The name of the run, by which its door and its buses are found."""
        return self._run

    @property
    def processes(self) -> tuple[str, ...]:
        """All processes besides this one."""
        return self._processes

    def _note_event(self, event: Event) -> None:
        self._asked.status.events.add(event)
        self._on_event(event)

    def _note_progress(self, progress: Progress) -> None:
        self._asked.status.note_progress(progress)
        self._on_progress(progress)

    @property
    def outcome(self) -> Outcome:
        """Outcome of the run so far."""
        return self._plane.outcome

    def run(self, stop: Stop) -> Outcome:
        """Run to the end, to a failure or to a stop; of what was started a viewer may be left.

        Raises:
            InfrastructureError: the run could not start.
        """
        open_files.ensure(len(self._processes))
        began = self._clock.monotonic_s()
        try:
            with self._machine, self._started(stop) as link:
                self._machine.clock.resume()
                try:
                    failure = self._await_ready(link, stop)
                except InfrastructureError as error:
                    self._ending.tell_remote_roles(link, str(error))
                    raise
                if failure is None and not stop.requested:
                    self.outcome.startup_s = self._clock.monotonic_s() - began
                    began_ns = process_cpu_ns()
                    failure = self._watch(link, stop)
                    self.outcome.cpu_ns = process_cpu_ns() - began_ns
                ending = self._clock.monotonic_s()
                self._ending.end(link, stop, failure)
                self.outcome.teardown_s = self._clock.monotonic_s() - ending
            self.outcome.machine = self._machine.report()
            self.outcome.faults = self._asked.faults.ledger.rows(self.outcome.ticks)
            self.outcome.steered = self._asked.steering.steered
            complete(self._plane, link)
        except BaseException:
            self.close()
            raise
        finally:
            end(self._plane.children, grace_s=0.0)
        return self.outcome

    def close(self) -> None:
        """End a viewer that is left; it shows the summary of the run first. Idempotent."""
        self._viewer.close()

    # --- start -------------------------------------------------------------------------------

    @contextlib.contextmanager
    def _started(self, stop: Stop) -> Iterator[LauncherLink]:
        """Router and processes."""
        scenario, run = self._scenario, self._run
        with contextlib.ExitStack() as open_:
            with self._fork_server or ForkServer() as fork_server:
                # Before there is a folder: a launcher that is killed leaves none.
                fork_server.serve(sockets.folder_of(run), lockstep=not self._schedule.realtime)
                folder = open_.enter_context(sockets.run_folder(run))
                self._lines = open_.enter_context(RowLines())
                link = open_.enter_context(self._router(folder, stop))
                link.declare_live(keys.live(run, LAUNCHER.name))
                self._plane.subscribe(link, run, self._processes)
                self._asked.open(link, run, self._processes)
                children = self._plane.children
                spawn(self._orders, self._links, folder, fork_server, self._lines, children)
            if granted := placement.bus_guests(self._deployment):
                open_.enter_context(Relay(link, folder, scenario.buses, granted))
            open_.callback(self._viewer.stop)
            yield link

    @contextlib.contextmanager
    def _router(self, folder: Path, stop: Stop) -> Iterator[LauncherLink]:
        """The router of this run, or the way to one of its own; sets how each identity gets there.

        Raises:
            InfrastructureError: it can't listen, or isn't there.
        """
        scenario, deployment, run = self._scenario, self._deployment, self._run
        if placement.is_external(deployment):
            self._links = dict(placement.links(scenario, deployment))
            own = self._links[LAUNCHER.identity()]
            with join_router(own, self._schedule.start_deadline_s, stop) as link:
                yield link
            return
        plan = placement.access_plan(scenario, deployment, run)
        outside = placement.outside(deployment)
        lease_s = LEASE_S if outside is not None else LOCAL_LEASE_S
        unread_s = UNREAD_SHARE * self._schedule.tick_deadline_s
        at = scenario.network.endpoint
        with open_router(at, plan, folder, outside, lease_s=lease_s, unread_s=unread_s) as link:
            self._links = {
                user: NetworkLink(run, link.endpoint, user, password, lease_s=LOCAL_LEASE_S)
                for user, password in plan.passwords.items()
            }
            yield link

    def _await_ready(self, link: LauncherLink, stop: Stop) -> Failure | None:
        """Publish the leader's speed until all tokens are there, then go until the plant ticks."""
        run, ticks = self._run, self._schedule
        go, hellos = link.publisher(keys.go(run)), self._hellos
        leader, steering = link.publisher(keys.leader_speed(run)), self._asked.steering
        steering.on_leader = lambda: hellos.add(leader, LeaderSpeed(steering.changes).encode())
        steering.on_leader()
        deadline = self._now() + ticks.start_deadline_s
        countdown_ns = ticks.countdown_ticks * ticks.period_ns + GO_AHEAD_NS
        gone, clocks = False, self._plane.clocks
        while not stop.requested:
            ready = self._plane.alive.issuperset(self._processes)
            if ready and self._plane.ticking:
                return None
            if (failure := self._supervision.failure()) is not None:
                if failure.rank >= GAVE_UP and (absent := self._remote.absent()):
                    raise InfrastructureError(
                        f"not there: {_with_refusals(absent, link)}; {failure.text}"
                    )
                return failure
            if self._now() > deadline:
                absent = self._remote.absent() or sorted(set(self._processes) - self._plane.alive)
                absent = absent or ["the plant's first tick"]
                raise InfrastructureError(
                    f"not ready within {ticks.start_deadline_s:g} s: {_with_refusals(absent, link)}"
                )
            clocks.ask(START_EVERY_S)
            if ready and not gone and self._clocks.known():
                self._clocks.refuse()
                gone = True
                epoch_ns = wall_of(self._clock.monotonic_ns() + countdown_ns, self._clock)
                hellos.add(go, Go(epoch_ns, ticks.ticks).encode())
            self._plane.receive(link, min(hellos.say(), WATCH_EVERY_S))
            self._report_refusals(link)
        return None

    # --- run ---------------------------------------------------------------------------------

    def _watch(self, link: LauncherLink, stop: Stop) -> Failure | None:
        """Follow the run until the plant and all controllers have ended."""
        most, folder = self._scenario.host.restarts, sockets.folder_of(self._run)
        requests, desk = self._asked.of_run(self._run, stop.request), self._asked.faults
        with (
            Restarts(
                self._plane,
                most,
                folder,
                self._respawned,
                lockstep=not self._schedule.realtime,
                resume=self._machine.clock.resume,
            ) as restarts,
            Door(folder, requests, self._asked.controls) as door,
        ):
            if self._live:
                self._viewer.open()
            faults = ProcessFaults(self._plane, self._schedule, restarts)
            desk.on_absences = faults.follow
            faults.follow(desk.ledger.absences(self._schedule.ticks))
            status = self._asked.status
            status.is_restarting, status.is_ending = restarts.awaits, lambda: stop.requested
            failure = self._follow(link, stop, restarts, faults, door)
            self._asked.end()
            return failure

    def _follow(
        self,
        link: LauncherLink,
        stop: Stop,
        restarts: Restarts,
        faults: ProcessFaults,
        door: Door,
    ) -> Failure | None:
        plane, supervision = self._plane, self._supervision
        while not stop.requested:
            self._take_messages(link)
            door.look()
            self._asked.look()
            self._report_refusals(link)
            plane.clocks.ask(EVERY_S)
            supervision.name_the_frozen()
            supervision.name_the_cut_off()
            restarts.welcome(self._hellos)
            faults.look(link)
            if (failure := supervision.failure()) is not None:
                if faults.account_for(failure, link) or restarts.replace(failure, link):
                    continue
                return supervision.root_of(failure, link, plane.actors)
            actors = [child for child in plane.actors if child.name not in plane.held]
            if all(child.ended() for child in actors) and self._remote.ended(self._now()):
                return None
            plant = plane.child(PLANT.name)
            if (
                plant is not None
                and plant.ended()
                and (left := plane.settle(link, actors, DRAIN_S))
            ):
                name = left[0].name
                return Failure(
                    GAVE_UP, name, f"{name}: has not ended {DRAIN_S:g} s after the plant"
                )
            if (silent := supervision.cut_off(link) or supervision.silent()) is not None:
                plane.settle(link, actors, CONSEQUENCES_S)
                return supervision.failure() or silent
        return None

    def _take_messages(self, link: LauncherLink) -> None:
        """Take messages, at least until `BETWEEN_LOOKS_S` after the last time.

        Looking at all processes costs more than a message, and a large fleet says much.
        """
        self._plane.receive(link, WATCH_EVERY_S)
        while (left_s := self._next_turn_s - self._clock.monotonic_s()) > 0.0:
            self._plane.receive(link, left_s)
        self._next_turn_s = self._clock.monotonic_s() + BETWEEN_LOOKS_S

    def _respawned(self, robot: str, fork_server: ForkServer, tick: int) -> Child:
        """The process of a controller that was started again."""
        folder = sockets.folder_of(self._run)
        faults = self._asked.faults.ledger.planned()
        orders = replace(self._orders, scenario=self._asked.steering.scenario)
        return respawn(orders, self._links, folder, robot, fork_server, self._lines, faults, tick)

    def _report_refusals(self, link: LauncherLink) -> None:
        """Look for floods now and then; announce what the router refused or cut off."""
        now_s = self._clock.monotonic_s()
        if now_s >= self._next_look_s:
            self._next_look_s = now_s + LOOK_EVERY_S
            link.look_for_floods(max(self.outcome.ticks, 0), now_s)
        for text in link.denials.news():
            self._plane.on_notice("router", text)


def _with_refusals(absent: Sequence[str], link: LauncherLink) -> str:
    """The processes that are not there, and the logins under their names that were refused."""
    named = {role: link.denials.logins_of(identity_of(role)) for role in absent}
    texts = [f"{role} ({'; '.join(found)})" if found else role for role, found in named.items()]
    told = {note for found in named.values() for note in found}
    others = [note for note in link.denials.notes() if note not in told]
    return "; ".join([", ".join(texts), *others[:_MOST_OTHERS]])
