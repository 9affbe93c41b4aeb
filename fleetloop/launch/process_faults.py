"""Faults of processes as the launcher sees them: ends that are planned, and what comes after.

They are the scenario's, or ordered (`fleetloop.launch.fault_desk`).

    killed by its own fault    an event, no failure of the run; started again if the scenario has
                               it, in real time when the plant is that far, in lockstep when the
                               plant waits for it
    frozen by its own fault    awake again when the plant is that far
    dropped by the plant       in lockstep, with `clock.on_late` other than "abort": whatever has
                               become of its process is no failure of the run

The processes kill and freeze themselves, at their ticks (`agents.process_faults`).
"""

from collections.abc import Iterable

from bridge.network.link import Link, waiting
from configs.brief import Schedule
from configs.faults.absences import Absence
from configs.roles import AGENT
from fleetloop.launch.child import KILLED, Failure
from fleetloop.launch.control_plane import ControlPlane
from fleetloop.launch.machine import WATCH_EVERY_S
from fleetloop.launch.restarts import Restarts


class ProcessFaults:
    """Follows the planned absences of one run.

    Args:
        plane: of the run; children that are gone for good are removed.
        schedule: of the run.
        restarts: starts controllers again.
    """

    def __init__(self, plane: ControlPlane, schedule: Schedule, restarts: Restarts) -> None:
        self._plane = plane
        self._schedule = schedule
        self._restarts = restarts
        self._stays = schedule.realtime or schedule.on_late == "hold"  # a frozen process
        self._over: set[tuple[str, str]] = set()  # faults, and robots on which they are over
        self._ends: list[Absence] = []
        self._asleep: list[Absence] = []
        self._killed: list[Absence] = []

    def follow(self, absent: Iterable[Absence]) -> None:
        """Go by these absences from now on, which are all of the run as far as it is known."""
        ends = [one for one in absent if one.to_tick is not None]
        self._ends = [one for one in ends if (one.name, one.robot) not in self._over]
        self._asleep = [one for one in self._ends if one.frozen and self._stays]
        self._killed = [one for one in self._ends if not one.frozen and self._schedule.realtime]
        self._restarts.plan(sum(not (one.frozen and self._stays) for one in self._ends))

    def look(self, link: Link) -> None:
        """Wake and start what is due.

        Raises:
            InfrastructureError: a process can't be had.
        """
        tick = self._plane.outcome.ticks
        for absence in [one for one in self._asleep if tick >= (one.to_tick or 0)]:
            child = self._plane.child(AGENT.process(absence.robot))
            # It may not have come to its own fault yet.
            if child is None or child.ended() or child.wake():
                self._asleep.remove(absence)
                self._over.add((absence.name, absence.robot))
                if self._schedule.realtime:  # in lockstep the plant says when it answers
                    self._plane.held.discard(AGENT.process(absence.robot))
                    self._plane.struck.pop(AGENT.process(absence.robot), None)
        due: dict[str, int] = {}
        for absence in [one for one in self._killed if tick >= (one.to_tick or 0)]:
            if self._gone_by(absence):
                self._killed.remove(absence)
                due[absence.robot] = absence.to_tick or 0
        for process, awaited in self._plane.awaited.items():
            due[process.partition("/")[2]] = awaited
        self._plane.awaited.clear()
        for robot, at_tick in due.items():
            self._start_again(robot, link, at_tick)

    def account_for(self, failure: Failure, link: Link) -> bool:
        """Whether the end of a process is planned, or the run goes on without it; note it."""
        plane, process = self._plane, failure.name
        child = plane.child(process)
        if child is None or process.partition("/")[0] != AGENT.name:
            return False
        for arrival in waiting(link):
            plane.process(arrival)
        struck = plane.struck.get(process) if failure.rank == KILLED else None
        if self._schedule.realtime and struck is not None:
            plane.let_go.add(process)
        elif self._schedule.on_late == "abort" or not self._dropped(process, link):
            if struck is not None:
                failure.text += f" {struck.text}"
            return False
        if struck is None:
            plane.note(process, "dropped", failure.text)
        child.close()
        plane.children.remove(child)
        return True

    def _gone_by(self, absence: Absence) -> bool:
        """Whether the process of a controller was killed by this fault."""
        process = AGENT.process(absence.robot)
        struck = self._plane.struck.get(process)
        here = self._plane.child(process) is not None
        return struck is not None and struck.tick == absence.from_tick and not here

    def _dropped(self, process: str, link: Link) -> bool:
        """Whether the plant says that it goes on without a controller; it has a while for that."""
        plane = self._plane
        deadline = plane.now() + self._schedule.tick_deadline_s
        while process not in plane.let_go and plane.now() < deadline:
            plane.receive(link, WATCH_EVERY_S)
        return process in plane.let_go

    def _start_again(self, robot: str, link: Link, tick: int) -> None:
        plane, process = self._plane, AGENT.process(robot)
        if (child := plane.child(process)) is not None:  # frozen, and dropped
            child.kill()
            child.close()
            plane.children.remove(child)
        plane.let_go.discard(process)
        plane.held.discard(process)
        plane.struck.pop(process, None)
        begun = [one for one in self._ends if one.robot == robot and one.from_tick < tick]
        self._over.update((one.name, one.robot) for one in begun)
        plane.note(process, "restarted", "after a fault", tick)
        self._restarts.start_again(robot, link, tick)
