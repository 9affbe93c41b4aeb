"""Controllers that are started again: how often, and until when they are awaited.

killed, crashed    in real time: replaced, `host.restarts` times in all, and told leader and clock
by a fault         as often as the scenario has it (`fleetloop.launch.process_faults`)
re-joined          its progress comes again; in lockstep, its token
gave up            it said why it can't go on: that ends the run as ever, and so does one too many
"""

from collections.abc import Callable
from pathlib import Path
from typing import Self

from bridge.network.barrier import Hellos
from bridge.network.link import Link, waiting
from configs.events import EventLog
from configs.roles import AGENT
from fleetloop.launch.child import Child, Failure
from fleetloop.launch.control_plane import ControlPlane
from fleetloop.launch.fork_server import IN_STEP, ForkServer


class Restarts:
    """Replaces the processes of controllers in one run.

    Args:
        plane: of the run; its children are replaced.
        most: how often, all robots together.
        folder: of the run's sockets.
        lockstep: see `ForkServer.serve`.
        resume: told after a start, in which the launcher did nothing else.
        respawn: starts the controller of a robot again, by a fork server, in lockstep at a tick.

    A fork server waits for the next failure, its modules imported. It is a context manager, and
    ends with it.
    """

    def __init__(
        self,
        plane: ControlPlane,
        most: int,
        folder: Path,
        respawn: Callable[[str, ForkServer, int], Child],
        *,
        lockstep: bool,
        resume: Callable[[], None],
    ) -> None:
        self._plane = plane
        self._most = self._left = most
        self._planned = 0
        self._lockstep = lockstep
        self._resume = resume
        self._respawn = respawn
        self._since_s: dict[str, float] = {}
        self._folder = folder
        self._fork_server: ForkServer | None = None
        self._prepare()

    def _prepare(self) -> None:
        """Start the fork server of the next restart, if there may be one."""
        again = self._left > 0 or self._planned > 0
        self._fork_server = self._new() if again else None

    def _new(self) -> ForkServer:
        fork_server = ForkServer(IN_STEP)
        fork_server.serve(self._folder, lockstep=self._lockstep)
        return fork_server

    def plan(self, restarts: int) -> None:
        """Be prepared for so many besides, by faults."""
        self._planned = restarts
        if self._fork_server is None:
            self._prepare()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._fork_server is not None:
            self._fork_server.close()

    def replace(self, failure: Failure, link: Link) -> bool:
        """Start the process that failed again; False if that isn't to be done.

        Raises:
            InfrastructureError: a process can't be had.
        """
        plane = self._plane
        role, _, robot = failure.name.partition("/")
        child = plane.child(failure.name)
        if not (failure.unexpected and role == AGENT.name and self._left) or child is None:
            return False
        self._left -= 1
        count = f"start {self._most - self._left} of {self._most}"
        plane.note(failure.name, "restarted", f"{failure.text}; started again, {count}")
        child.close()
        plane.children.remove(child)
        self._start(robot, link, 0)
        return True

    def start_again(self, robot: str, link: Link, tick: int) -> None:
        """Start the controller of a robot that a fault has ended, in lockstep at a tick.

        Raises:
            InfrastructureError: a process can't be had.
        """
        self._planned -= 1
        self._start(robot, link, tick)

    def _start(self, robot: str, link: Link, tick: int) -> None:
        plane, process = self._plane, AGENT.process(robot)
        fork_server = self._fork_server or self._new()
        with fork_server:  # has to end, so that the launcher is the parent
            plane.children.append(self._respawn(robot, fork_server, tick))
        self._prepare()
        self._resume()
        plane.alive.discard(process)
        outcome = plane.outcome
        said, report = outcome.said.pop(process, EventLog()), outcome.reports.pop(process, None)
        events = said.kept if report is None else report.events
        outcome.former.setdefault(process, []).extend(events)
        # What came meanwhile is no silence.
        for arrival in waiting(link):
            plane.process(arrival)
        self._since_s[process] = plane.now()

    def awaits(self, process: str) -> bool:
        """Whether a process was started again and hasn't re-joined yet."""
        return process in self._since_s

    def welcome(self, hellos: Hellos) -> None:
        """Say what a controller needs to know as long as one hasn't re-joined."""
        if not self._since_s:
            return
        hellos.say()
        now_s = self._plane.now()
        for process, since_s in list(self._since_s.items()):
            silence = self._plane.vitals.silence(process, now_s)
            heard = silence is not None and now_s - silence.lasted_s > since_s
            if heard or (self._lockstep and process in self._plane.alive):
                del self._since_s[process]
