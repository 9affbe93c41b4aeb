"""Supervision of a run: which process failed, fell silent or was cut off, and what caused it."""

from collections.abc import Sequence

from bridge.network.link import Link
from bridge.network.router import LauncherLink
from configs.brief import Schedule
from configs.roles import PLANT, RECORDER, identity_of
from fleetloop.launch.child import GAVE_UP, PEER_SILENT, Child, Failure, cause
from fleetloop.launch.control_plane import ControlPlane
from fleetloop.launch.machine import WATCH_EVERY_S
from fleetloop.launch.vitals import FROZEN_S

CONSEQUENCES_S = 0.3
"""After a failure, how long its causes and consequences are waited for."""


class Supervision:
    """Finds failures among the processes of a run, here and on other machines."""

    def __init__(self, plane: ControlPlane, schedule: Schedule, patience_s: float = 0.0) -> None:
        self._plane = plane
        self._schedule = schedule
        self._patience_s = patience_s  # with silence, beyond the deadline of a tick

    def failure(self) -> Failure | None:
        """The failure that explains the others, None if there is none."""
        plane = self._plane
        far = plane.remote.failure(plane.now())
        near = cause(plane.children)
        if near is None or far is None:
            return near or far
        return min(near, far, key=lambda failure: failure.rank)

    def root_of(self, failure: Failure, link: Link, actors: Sequence[Child]) -> Failure:
        """The cause of a failure: a process that lost a peer lets that peer be found in time."""
        plane = self._plane
        within_s = CONSEQUENCES_S
        if failure.rank >= PEER_SILENT:
            within_s += self._schedule.tick_deadline_s
        deadline = plane.now() + within_s
        while plane.now() < deadline:
            left = plane.settle(link, actors, WATCH_EVERY_S)
            better = self.failure()
            if better is not None and better.rank < failure.rank:
                return better
            if (silent := self.silent()) is not None:
                return silent
            if not left:
                break
        return failure

    def silent(self) -> Failure | None:
        """The process whose progress stopped, None while all are well."""
        plane = self._plane
        # However soon others give up waiting, a process says how far it is only so often.
        limit_s = max(self._schedule.tick_deadline_s, FROZEN_S) + self._patience_s
        now_s = plane.now()
        for name in (PLANT.name, RECORDER.name):
            child, silence = plane.child(name), plane.vitals.silence(name, now_s)
            if child is None or silence is None or silence.lasted_s <= limit_s or child.ended():
                continue
            text = (
                f"{name}: no progress for {silence.lasted_s:.1f} s after {max(silence.tick, 0)}"
                f" ticks{child.state()}"
            )
            return Failure(GAVE_UP, name, text)
        return None

    def cut_off(self, link: LauncherLink) -> Failure | None:
        """The process that the run needs and that the router cut off, None if there is none."""
        plane = self._plane
        for child in plane.children if link.denials.cut_off else ():
            if child.name in plane.held | plane.let_go:  # it reads nothing
                continue
            deaf = identity_of(child.name) in link.denials.cut_off
            # In real time the newest message is as good as those that were lost.
            needed = not self._schedule.realtime or child.name == RECORDER.name
            going = child.name not in plane.outcome.reports  # a token goes at a good end as well
            if deaf and needed and going and child.name not in plane.alive and not child.ended():
                text = f"{child.name}: did not read its messages, and was cut off"
                return Failure(GAVE_UP, child.name, text)
        return None

    def name_the_cut_off(self) -> None:
        """Name the roles on other machines that are cut off, and go on."""
        plane = self._plane
        for process in plane.remote.newly_cut_off(plane.now()):
            plane.note(process, "cut_off", "its machine, or the network to it")

    def name_the_frozen(self) -> None:
        """In real time, where no process waits for another: name a silent one at once."""
        if not self._schedule.realtime:
            return
        plane = self._plane
        for process, tick, lasted_s in plane.vitals.newly_frozen(plane.now()):
            child = plane.child(process)
            state = child.state() if child is not None else ""
            since = self._schedule.when(tick)
            text = f"no sign of life for {lasted_s:.1f} s, since {since}{state}"
            plane.note(process, "silent", text)
