"""The end of a run over processes: within a bound, with a whole record and a named cause.

The plant stops within a tick, the controllers follow it, the recorder takes what is still on its
way; a process that doesn't end in time is killed. Roles on other machines are told why the run
ends, and then lose the launcher's token.
"""

from pathlib import Path

from bridge.network import keys
from bridge.network.link import Link, waiting
from bridge.network.reports import LauncherReport
from bridge.network.router import LauncherLink
from bridge.process.lifecycle import Stop
from configs.errors import FleetloopError
from configs.roles import LAUNCHER, RECORDER
from fleetloop.launch.child import GAVE_UP, Child, Failure, end
from fleetloop.launch.control_plane import ControlPlane
from fleetloop.launch.machine import WATCH_EVERY_S, MachineWatch
from fleetloop.record.writer import finish_truncated

REASON_AHEAD_S = 0.2
"""The reason of the end is so far ahead of the end of the launcher's token."""
DRAIN_S, MOST_DRAIN_S = 2.0, 10.0
"""How long the recorder may be silent while it writes what is still on its way, once all others
have ended, and how long it may take."""
STOP_S = 1.0
"""For processes to stop in order after the plant was asked to."""
BLAMED_STALL_S = 1.0
"""A stall so long before the deadline of a tick may be why it was missed."""


class Ending:
    """Ends the processes of one run and completes its account."""

    def __init__(
        self, plane: ControlPlane, run: str, machine: MachineWatch, record: Path, limit_s: float
    ) -> None:
        self._plane = plane
        self._run = run
        self._machine = machine
        self._record = record
        self._limit_s = limit_s

    def end(self, link: LauncherLink, stop: Stop, failure: Failure | None) -> None:
        """End all processes; `failure` is the one that ended the run, if one did."""
        plane, outcome = self._plane, self._plane.outcome
        self._judge(stop, failure)
        actors, recorder = plane.actors, plane.child(RECORDER.name)
        if recorder is not None and failure is not None and failure.name == recorder.name:
            # What it doesn't take any more would keep all others waiting.
            recorder.kill()
        if outcome.ended != "completed":
            self.tell_remote_roles(link, outcome.reason)
        # Roles on other machines stop without launcher, if they haven't yet.
        link.withdraw_live(keys.live(self._run, LAUNCHER.name))
        if outcome.ended != "completed":
            if actors:
                actors[0].ask_to_stop()
            plane.settle(link, actors, STOP_S)
        end(actors)
        self._machine.clock.resume()
        self._await_remote_roles(link, DRAIN_S)
        end([child for child in plane.children if child not in (*actors, recorder)])
        if recorder is not None:
            if outcome.ended != "completed" or plane.lost_controllers():
                recorder.ask_to_stop()
            self._drain(link, recorder)
        for arrival in waiting(link):
            plane.process(arrival)
        if recorder is not None:
            self._end_recorder(recorder)

    def tell_remote_roles(self, link: Link, reason: str) -> None:
        """Tell the roles on other machines why the run ends, before the launcher's token goes."""
        if not self._plane.remote.ended(self._plane.now()):
            report = LauncherReport(reason).encode()
            link.publisher(keys.report(self._run, LAUNCHER.name)).put(report)
            self._await_remote_roles(link, REASON_AHEAD_S)

    def _await_remote_roles(self, link: Link, within_s: float) -> None:
        """Take the reports of roles on other machines; one that is later than this is lost."""
        plane = self._plane
        deadline = plane.now() + within_s
        while not plane.remote.ended(plane.now()) and (left_s := deadline - plane.now()) > 0.0:
            plane.receive(link, min(left_s, WATCH_EVERY_S))

    def _drain(self, link: Link, recorder: Child) -> None:
        """Let the recorder write what is on its way, as long as it shows progress."""
        plane = self._plane
        began_s = now_s = plane.now()
        while not recorder.ended() and now_s < began_s + MOST_DRAIN_S:
            silence = plane.vitals.silence(recorder.name, now_s)
            silent_since_s = now_s - silence.lasted_s if silence is not None else began_s
            if now_s - max(silent_since_s, began_s) > DRAIN_S:
                return
            plane.receive(link, WATCH_EVERY_S)
            now_s = plane.now()

    def _end_recorder(self, recorder: Child) -> None:
        outcome = self._plane.outcome
        unfinished = not recorder.ended() or recorder.failure() is not None
        end([recorder])
        if outcome.ended == "completed" and unfinished:
            outcome.ended = "aborted"
            lost = recorder.failure()
            late = f"{recorder.name}: not done in time, once all others had ended"
            outcome.reason = lost.text if lost else late
        if unfinished:
            self._complete_record()

    def _judge(self, stop: Stop, failure: Failure | None) -> None:
        """How the run ended; a stall of the machine is the cause of what failed during it."""
        outcome = self._plane.outcome
        if stop.requested:
            outcome.ended, outcome.reason = "interrupted", stop.reason
        elif failure is not None:
            outcome.ended, outcome.reason = "aborted", failure.text
            outcome.timed = not failure.unexpected
            if failure.rank < GAVE_UP:
                return
            if stall := self._machine.lately(self._limit_s + BLAMED_STALL_S):
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
            self._plane.outcome.reason += f"; {error}"
