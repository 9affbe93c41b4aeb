"""A run over processes, by either clock: start everybody, watch, end everybody, whatever happens.

    launcher   this process: Zenoh router with access control, operator's end of the control plane
    plant      emulated drives and physics of all robots; in lockstep, owner of the clock
    agents     one controller per robot
    recorder   writes the record

Roles that a deployment has elsewhere are waited for, watched and ended over the network.

Start: sockets first, then processes, then the barrier: everybody proves its links and declares a
liveliness token; with the last one the launcher says go. End: the plant stops within a tick, the
controllers follow it, the recorder takes what still comes; who doesn't is killed after a bound.
"""

import contextlib
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from bridge.can_bus import sockets
from bridge.can_bus.relay import Relay
from bridge.clock import wall_of
from bridge.network import keys
from bridge.network.barrier import Hellos
from bridge.network.link import Arrival, Link, waiting
from bridge.network.messages import Go, LeaderSpeed, Progress
from bridge.network.reports import LauncherReport, Report
from bridge.network.router import RouterLink, open_router
from bridge.process import Stop, cpu_ns
from configs.brief import LEASE_S, LOCAL_LEASE_S, NetworkLink
from configs.deployment import Deployment
from configs.errors import FleetloopError, InfrastructureError
from configs.resolve import leader_brief, schedule
from configs.roles import LAUNCHER, PLANT, RECORDER, identity_of, processes_of
from configs.scenario import Scenario
from fleetloop.launch import open_files, placement
from fleetloop.launch.child import (
    GAVE_UP,
    PEER_SILENT,
    Child,
    Failure,
    cause,
    end,
    refuse_shadowed_roles,
)
from fleetloop.launch.fork_server import Nursery
from fleetloop.launch.machine import WATCH_EVERY_S, MachineWatch
from fleetloop.launch.remote_roles import Elsewhere
from fleetloop.launch.spawn import Orders, spawn
from fleetloop.launch.vitals import Vitals
from fleetloop.launch.words import Words
from fleetloop.record.writer import finish_truncated

GO_AHEAD_NS = 200_000_000
"""In real time, from the go to power-up: for the go to reach everybody."""
_MOST_OTHERS = 3
WORD_S = 0.2
"""The reason of the end is so far ahead of the end of the launcher's token."""
MAX_NOTICES = 100
"""Of each process; what else it says is in nobody's interest."""
UNREAD_SHARE = 0.25
"""Part of the tick deadline after which a client that doesn't read is cut off: all wait for it."""
LOOK_EVERY_S = 0.1
"""How often connections are looked at for who says far too much."""
DRAIN_S, MOST_DRAIN_S = 2.0, 10.0
"""How long the recorder may be silent while it writes what is still on its way, once all others
have ended, and how long it may take."""


@dataclass(slots=True)
class Outcome:
    """How a run went: counters for the summary, and why it ended."""

    ended: str = "completed"  # "completed", "interrupted", "aborted"
    reason: str = ""
    timed: bool = True  # the reason says when
    ticks: int = 0
    wall_s: float = 0.0
    startup_s: float = 0.0
    teardown_s: float = 0.0
    cpu_ns: int = 0  # of the launcher, since everybody was ready
    reports: dict[str, Report] = field(default_factory=dict)
    said: dict[str, list[str]] = field(default_factory=dict)  # by process, as it happened
    notices: dict[str, list[str]] = field(default_factory=dict)  # about a process, by the launcher
    machine: dict[str, Any] = field(default_factory=dict)


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
        on_notice: Callable[[str, str], None] = lambda *_: None,
        deployment: Deployment | None = None,
    ) -> None:
        self._scenario = scenario
        self._deployment = deployment or Deployment()
        self._orders = Orders(scenario, self._deployment, record, speed, profile)
        self._run = placement.run_name(scenario, self._deployment) or run
        self._elsewhere = Elsewhere(self._deployment.elsewhere(scenario))
        self._record = record
        self._speed = speed
        self._on_progress = on_progress
        self._on_notice = on_notice
        self._robots = scenario.names
        self._processes = processes_of(scenario.names)
        self._children: list[Child] = []
        self._alive: set[str] = set()
        self._next_look_s = 0.0
        self._words = Words(schedule(scenario, speed))
        self._vitals = Vitals()
        self._ticking = False
        period_s = scenario.clock.control_period_s
        self._machine = MachineWatch(
            lambda: self.outcome.ticks * period_s, partial(self._note, LAUNCHER.name)
        )
        self._now = self._machine.clock.now
        self.outcome = Outcome()

    def run(self, stop: Stop) -> Outcome:
        """Run to the end, to a failure or to a stop; nothing that was started is left.

        Raises:
            InfrastructureError: the run could not start.
        """
        refuse_shadowed_roles(("agents", PLANT.name, "fleetloop"))
        open_files.ensure(len(self._processes))
        began = time.monotonic()
        try:
            with self._machine, self._started() as link:
                self._machine.clock.resume()
                try:
                    failure = self._await_ready(link, stop)
                except InfrastructureError as error:
                    self._tell_elsewhere(link, str(error))
                    raise
                if failure is None and not stop.requested:
                    self.outcome.startup_s = time.monotonic() - began
                    began_ns = cpu_ns()
                    failure = self._watch(link, stop)
                    self.outcome.cpu_ns = cpu_ns() - began_ns
                ending = time.monotonic()
                self._end(link, stop, failure)
                self.outcome.teardown_s = time.monotonic() - ending
            self.outcome.machine = self._machine.report()
            if refusals := link.denials.notes():
                self.outcome.notices["router"] = refusals
            self._words.note_dropped(link.dropped())
            if refusals := self._words.refusals.lines():
                self.outcome.notices.setdefault(LAUNCHER.name, []).extend(refusals)
            self._blame_floods(link.denials.flooders)
        finally:
            end(self._children, grace_s=0.0)
        return self.outcome

    # --- start -------------------------------------------------------------------------------

    @contextlib.contextmanager
    def _started(self) -> Iterator[RouterLink]:
        scenario, run = self._scenario, self._run
        plan = placement.access_plan(scenario, self._deployment, run)
        outside = placement.outside(self._deployment)
        batch = not schedule(scenario).realtime
        with contextlib.ExitStack() as open_:
            # It imports while the router opens, and knows the folder before there is one.
            with Nursery(sockets.folder_of(run), batch=batch) as nursery:
                folder = open_.enter_context(sockets.run_folder(run))
                lease_s = LEASE_S if outside is not None else LOCAL_LEASE_S
                unread_s = UNREAD_SHARE * schedule(scenario, self._speed).tick_deadline_s
                at = scenario.network.endpoint
                router = open_router(at, plan, folder, outside, lease_s=lease_s, unread_s=unread_s)
                link = open_.enter_context(router)
                link.declare_live(keys.live(run, LAUNCHER.name))
                link.watch_live(keys.live_all(run), "live")
                # One by one: a wildcard is wider than any identity's rights and would be refused.
                for process in self._processes:
                    link.subscribe(keys.progress(run, process), "progress")
                    link.subscribe(keys.notice(run, process), "notice")
                    link.subscribe(keys.report(run, process), "report")
                links = {
                    user: NetworkLink(run, link.endpoint, user, password, lease_s=LOCAL_LEASE_S)
                    for user, password in plan.passwords.items()
                }
                spawn(self._orders, links, folder, nursery, self._children)
            if granted := placement.bus_guests(self._deployment):
                open_.enter_context(Relay(link, folder, scenario.buses, granted))
            yield link

    def _await_ready(self, link: RouterLink, stop: Stop) -> Failure | None:
        """Say the leader's speed until all tokens are there, then go until the plant ticks."""
        run = self._run
        go = link.publisher(keys.go(run))
        ticks = schedule(self._scenario)
        hellos = Hellos(ticks.hello_every_s)
        speed = LeaderSpeed(leader_brief(self._scenario).speed_steps)
        hellos.add(link.publisher(keys.leader_speed(run)), speed.encode())
        deadline = self._now() + ticks.start_deadline_s
        countdown_ns = ticks.countdown_ticks * ticks.period_ns + GO_AHEAD_NS
        gone = False
        while not stop.requested:
            ready = self._alive.issuperset(self._processes)
            if ready and self._ticking:
                return None
            if (failure := self._cause()) is not None:
                if failure.rank >= GAVE_UP and (absent := self._elsewhere.absent()):
                    raise InfrastructureError(
                        f"not there: {_with_refusals(absent, link)}; {failure.text}"
                    )
                return failure
            if self._now() > deadline:
                absent = self._elsewhere.absent() or sorted(set(self._processes) - self._alive)
                absent = absent or ["the plant's first tick"]
                raise InfrastructureError(
                    f"not ready within {ticks.start_deadline_s:g} s: {_with_refusals(absent, link)}"
                )
            if ready and not gone:
                gone = True
                epoch_ns = wall_of(time.monotonic_ns() + countdown_ns)
                hellos.add(go, Go(epoch_ns, ticks.ticks).encode())
            self._take(link.receive(min(hellos.say(), WATCH_EVERY_S)))
            self._tell_refusals(link)
        return None

    # --- run ---------------------------------------------------------------------------------

    def _watch(self, link: RouterLink, stop: Stop) -> Failure | None:
        """Follow the run until the plant and all controllers have ended."""
        actors = [child for child in self._children if child.name != RECORDER.name]
        while not stop.requested:
            self._take(link.receive(WATCH_EVERY_S))
            self._tell_refusals(link)
            self._name_the_frozen()
            if (failure := self._cause()) is not None:
                return self._root_of(failure, link, actors)
            if all(child.ended() for child in actors) and self._elsewhere.ended():
                return None
            plant = self._child(PLANT.name)
            if plant is not None and plant.ended() and (left := self._settle(link, actors)):
                name = left[0].name
                return Failure(
                    GAVE_UP, name, f"{name}: has not ended {DRAIN_S:g} s after the plant"
                )
            if (silent := self._cut_off(link) or self._silent()) is not None:
                self._settle(link, actors, 0.3)
                return self._cause() or silent
        return None

    def _blame_floods(self, cut_off: Iterable[str]) -> None:
        """Who says so much that nobody has time for others is the cause of whoever is too late."""
        reports = self.outcome.reports.values()
        said = {flooder for report in reports for flooder in report.flooders}
        floods = sorted(said.union(self._words.refusals.floods()))
        floods += [f"{user} (cut off by the router)" for user in sorted(cut_off)]
        if floods and self.outcome.ended == "aborted":
            self.outcome.reason += f"; flooded by {', '.join(floods)}"

    def _tell_refusals(self, link: RouterLink) -> None:
        """Look for floods now and then, and tell whom the router refused or cut off."""
        now_s = time.monotonic()
        if now_s >= self._next_look_s:
            self._next_look_s = now_s + LOOK_EVERY_S
            link.look_for_floods(max(self.outcome.ticks, 0), now_s)
        for text in link.denials.news():
            self._on_notice("router", text)

    def _cut_off(self, link: RouterLink) -> Failure | None:
        """Whose part of the run is broken because the router cut it off; None if nobody's is."""
        lockstep = self._scenario.clock.mode == "lockstep"
        for child in self._children if link.denials.cut_off else ():
            deaf = identity_of(child.name) in link.denials.cut_off
            needed = lockstep or child.name == RECORDER.name  # else what is newer is as good
            if deaf and needed and child.name not in self._alive and not child.ended():
                text = f"{child.name}: did not read what was sent to it, and was cut off"
                return Failure(GAVE_UP, child.name, text)
        return None

    def _child(self, name: str) -> Child | None:
        """The process of that name, None if it is not one of this machine."""
        return next((child for child in self._children if child.name == name), None)

    def _cause(self) -> Failure | None:
        """The failure that explains the others, None if nobody failed."""
        far = self._elsewhere.failure(self._now())
        near = cause(self._children)
        if near is None or far is None:
            return near or far
        return min(near, far, key=lambda failure: failure.rank)

    def _root_of(self, failure: Failure, link: Link, actors: Sequence[Child]) -> Failure:
        """Who lost a peer is not the cause: let the peer be found, within its deadline."""
        within_s = 0.3
        if failure.rank >= PEER_SILENT:
            within_s += self._limit_s()
        deadline = self._now() + within_s
        while self._now() < deadline:
            left = self._settle(link, actors, WATCH_EVERY_S)
            better = self._cause()
            if better is not None and better.rank < failure.rank:
                return better
            if (silent := self._silent()) is not None:
                return silent
            if not left:
                break
        return failure

    def _limit_s(self) -> float:
        return schedule(self._scenario, self._speed).tick_deadline_s

    def _settle(
        self, link: Link, children: Sequence[Child], within_s: float = DRAIN_S
    ) -> list[Child]:
        """Hear last words until these have ended, at most `within_s`; return who has not."""
        deadline = self._now() + within_s
        while left := [child for child in children if not child.ended()]:
            left_s = deadline - self._now()
            if left_s <= 0.0:
                break
            self._take(link.receive(min(left_s, WATCH_EVERY_S)))
        return left

    def _silent(self) -> Failure | None:
        """The process whose progress stopped, None while all are well."""
        limit_s, now_s = self._limit_s(), self._now()
        for name in (PLANT.name, RECORDER.name):
            child, silence = self._child(name), self._vitals.silence(name, now_s)
            if child is None or silence is None or silence.lasted_s <= limit_s or child.ended():
                continue
            text = (
                f"{name}: no progress for {silence.lasted_s:.1f} s after {max(silence.tick, 0)}"
                f" ticks{child.state()}"
            )
            return Failure(GAVE_UP, name, text)
        return None

    def _name_the_frozen(self) -> None:
        """In real time everybody beats, and nobody waits for who doesn't: say it at once."""
        if self._scenario.clock.mode != "realtime":
            return
        when = schedule(self._scenario).when
        for process, tick, lasted_s in self._vitals.newly_frozen(self._now()):
            child = self._child(process)
            state = child.state() if child is not None else ""
            text = f"no sign of life for {lasted_s:.1f} s, since {when(tick)}{state}"
            self._note(process, text)

    def _note(self, process: str, text: str) -> None:
        """The launcher has noticed something about a process."""
        self._tell(self.outcome.notices.setdefault(process, []), process, text)

    def _tell(self, account: list[str], process: str, text: str) -> None:
        if len(account) < MAX_NOTICES:
            account.append(text)
            self._on_notice(process, text)

    def _take(self, arrival: Arrival | None) -> None:
        if arrival is None:
            return
        process = keys.process_of(arrival.key)
        if arrival.tag == "live":
            there = arrival.payload == b"1"
            (self._alive.add if there else self._alive.discard)(process)
            self._elsewhere.note_token(process, self._now(), there=there)
        elif arrival.tag == "progress":
            progress = self._words.progress(process, arrival.payload)
            if progress is not None:
                silence = self._vitals.beat(process, progress.tick, self._now())
                if silence is not None:
                    self._note(process, f"goes on after {silence.lasted_s:.1f} s")
                if process == PLANT.name:
                    self._ticking = True
                    self.outcome.ticks = progress.tick
                    self.outcome.wall_s = progress.wall_ns * 1e-9
                    self._on_progress(progress)
        elif arrival.tag == "notice":
            if (notice := self._words.notice(process, arrival.payload)) is not None:
                self._tell(self.outcome.said.setdefault(process, []), process, notice.text)
        else:
            self._take_report(process, arrival.payload)

    def _take_report(self, process: str, payload: bytes) -> None:
        if (report := self._words.report(process, payload)) is not None:
            self._vitals.end(process)
            self.outcome.reports[process] = report
            self._elsewhere.note_report(process, report)
            if report.left_early and self.outcome.ended == "completed":
                self._on_notice(process, f"left the run early: {report.left_early}")
        for child in self._children:
            if child.name == process:
                child.release()

    # --- end ---------------------------------------------------------------------------------

    def _end(self, link: RouterLink, stop: Stop, failure: Failure | None) -> None:
        outcome = self.outcome
        self._judge(stop, failure)
        recorder = self._children[-1]
        actors = self._children[:-1]
        if failure is not None and failure.name == recorder.name:
            # What it doesn't take any more would keep all others waiting.
            recorder.kill()
        if outcome.ended != "completed":
            self._tell_elsewhere(link, outcome.reason)
        # Without launcher those elsewhere stop, if they haven't.
        link.withdraw_live(keys.live(self._run, LAUNCHER.name))
        if outcome.ended != "completed":
            if actors:
                actors[0].ask_to_stop()
            self._settle(link, actors, 1.0)
        end(actors)
        self._machine.clock.resume()
        self._hear_from_elsewhere(link)
        if outcome.ended != "completed":
            recorder.ask_to_stop()
        self._drain(link, recorder)
        for arrival in waiting(link):
            self._take(arrival)
        unfinished = not recorder.ended() or recorder.failure() is not None
        end([recorder])
        if outcome.ended == "completed" and unfinished:
            outcome.ended = "aborted"
            lost = recorder.failure()
            outcome.reason = (
                lost.text if lost else "recorder: not done in time, once all others had ended"
            )
        if unfinished:
            self._complete_record()

    def _drain(self, link: Link, recorder: Child) -> None:
        """Let the recorder write what is on its way, as long as it says that it does."""
        began_s = now_s = self._now()
        while not recorder.ended() and now_s < began_s + MOST_DRAIN_S:
            silence = self._vitals.silence(recorder.name, now_s)
            silent_since_s = now_s - silence.lasted_s if silence is not None else began_s
            if now_s - max(silent_since_s, began_s) > DRAIN_S:
                return
            self._take(link.receive(WATCH_EVERY_S))
            now_s = self._now()

    def _judge(self, stop: Stop, failure: Failure | None) -> None:
        """How the run ended; who gave up while the machine stood still is not the cause."""
        outcome = self.outcome
        if stop.requested:
            outcome.ended, outcome.reason = "interrupted", stop.reason
        elif failure is not None:
            outcome.ended, outcome.reason = "aborted", failure.text
            outcome.timed = not failure.unexpected
            if failure.rank < GAVE_UP:
                return
            if stall := self._machine.lately(self._limit_s() + 1.0):
                outcome.reason = f"{stall}; {failure.text}"
            elif left := [name for name, it in outcome.reports.items() if it.left_early]:
                early = outcome.reports[left[0]].left_early
                outcome.reason = f"{left[0]}: left the run early: {early}; {failure.text}"

    def _complete_record(self) -> None:
        """Give the record the end that its writer didn't."""
        try:
            if self._record.exists():
                finish_truncated(self._record)
        except FleetloopError as error:
            self.outcome.reason += f"; {error}"

    def _tell_elsewhere(self, link: Link, reason: str) -> None:
        """Why the run ends, before the launcher's token goes."""
        if self._elsewhere.ended():
            return
        word = LauncherReport(reason).encode()
        link.publisher(keys.report(self._run, LAUNCHER.name)).put(word)
        deadline = self._now() + WORD_S
        while not self._elsewhere.ended() and (left_s := deadline - self._now()) > 0.0:
            self._take(link.receive(min(left_s, WATCH_EVERY_S)))

    def _hear_from_elsewhere(self, link: Link) -> None:
        """Let those on other machines say their last word; what they don't say in time is lost."""
        deadline = self._now() + DRAIN_S
        while not self._elsewhere.ended() and (left_s := deadline - self._now()) > 0.0:
            self._take(link.receive(min(left_s, WATCH_EVERY_S)))


def _with_refusals(absent: Sequence[str], link: RouterLink) -> str:
    """Who is not there, and what the router refused to somebody who wanted to be it."""
    named = {role: link.denials.logins_of(identity_of(role)) for role in absent}
    texts = [f"{role} ({'; '.join(found)})" if found else role for role, found in named.items()]
    told = {note for found in named.values() for note in found}
    others = [note for note in link.denials.notes() if note not in told]
    return "; ".join([", ".join(texts), *others[:_MOST_OTHERS]])
