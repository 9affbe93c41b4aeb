"""What is to be seen of a run that goes on, and what has happened: requests of its door.

    request      arguments   answer
    run.status   -           state ("starting", "running", "paused", "ending"), tick, t_s,
                             ends_at_s, clock, speed (0: as fast as it can), real_time_factor,
                             leader_speed_m_s, controller (who holds the controls, or null),
                             processes, robots
    run.events   since       events: from that number on; next: the number after the last

A process has name, state ("up", "frozen", "held", "dropped", "restarting", "ended"), the tick that
was heard of it last, cpu (processors used, of late) and waited_for. A robot has what
`fleetloop.robot_states.RobotState` lists. Of many events the oldest are forgotten.
"""

import os
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from bridge.network.messages import Progress
from bridge.network.status import PlantStatus
from bridge.process.kernel_stat import kernel_stat
from configs.events import Event
from configs.leader_speed import speed_at
from configs.roles import AGENT
from fleetloop.door.requests import Request, Respond
from fleetloop.launch.control_plane import ControlPlane
from fleetloop.launch.order_book import OrderBook
from fleetloop.launch.steering import Steering

MOST_EVENTS = 1 << 13
_FACTOR_OVER_S = 1.0
"""The real-time factor is a mean over this time."""
_CPU_OVER_S = 2.0
_TICKS_HZ = os.sysconf("SC_CLK_TCK")


class EventLog:
    """The events of a run as they came, with their numbers."""

    def __init__(self) -> None:
        self._events: deque[Event] = deque(maxlen=MOST_EVENTS)
        self._next = 0

    def add(self, event: Event) -> None:
        """One more."""
        self._events.append(event)
        self._next += 1

    def since(self, number: int) -> tuple[list[Event], int]:
        """The events from a number on, as far as they are kept, and the number after the last."""
        oldest = self._next - len(self._events)
        begin = min(max(number - oldest, 0), len(self._events))
        return [*self._events][begin:], self._next


class _Rate:
    """How fast a count grows over a while."""

    def __init__(self, over_s: float) -> None:
        self._over_s = over_s
        self._points: deque[tuple[float, float]] = deque()

    def note(self, now_s: float, count: float) -> None:
        self._points.append((now_s, count))
        while len(self._points) > 2 and now_s - self._points[1][0] >= self._over_s:
            self._points.popleft()

    def rate(self) -> float | None:
        """Per second; None: not known yet."""
        if len(self._points) < 2:
            return None
        (began_s, begin), (ended_s, end) = self._points[0], self._points[-1]
        return (end - begin) / (ended_s - began_s) if ended_s > began_s else None


class RunStatus:
    """Answers what a run is doing.

    Args:
        plane: of the run.
        orders: of the run.
        ends_at_s: when the scenario ends.
        steering: of the run.
    """

    def __init__(
        self,
        plane: ControlPlane,
        orders: OrderBook,
        ends_at_s: float,
        steering: Steering,
    ) -> None:
        self.events = EventLog()
        self._plane = plane
        self._orders = orders
        self._ends_at_s = ends_at_s
        self._steering = steering
        self.controller: Callable[[], str | None] = lambda: None
        """Who holds the controls."""
        self.is_restarting: Callable[[str], bool] = lambda _: False
        """Whether a process is started again now."""
        self.is_ending: Callable[[], bool] = lambda: False
        """Whether the run is to end."""
        self._pace = _Rate(_FACTOR_OVER_S)
        self._cpu: dict[int, _Rate] = {}
        self._waits_for: tuple[str, ...] = ()
        self.requests: Mapping[str, Request] = {
            "run.status": Request({}, self._status),
            "run.events": Request({"since": int}, self._since),
        }

    def note_progress(self, progress: Progress) -> None:
        """Take the plant's progress."""
        if isinstance(progress.status, PlantStatus):
            self._waits_for = progress.status.waits_for
        self._pace.note(self._plane.now(), progress.t_ns * 1e-9)

    def _status(self, respond: Respond) -> None:
        orders, steering = self._orders, self._steering
        tick, realtime = orders.tick(), orders.schedule.realtime
        t_s = orders.seconds(tick)
        respond(
            {
                "state": self._state(tick),
                "tick": tick,
                "t_s": t_s,
                "ends_at_s": self._ends_at_s,
                "clock": "realtime" if realtime else "lockstep",
                "speed": 1.0 if realtime else steering.speed,
                "real_time_factor": 0.0 if steering.paused else self._pace.rate(),
                "leader_speed_m_s": speed_at(steering.changes, t_s * 1e9),
                "controller": self.controller(),
                "processes": self._processes(),
                "robots": {one.robot: one.as_dict() for one in self._plane.robots()},
            }
        )

    def _state(self, tick: int) -> str:
        if self.is_ending():
            return "ending"
        if self._steering.paused:
            return "paused"
        return "starting" if tick < 0 else "running"

    def _processes(self) -> list[dict[str, Any]]:
        plane, waits = self._plane, {AGENT.process(robot) for robot in self._waits_for}
        names = [child.name for child in plane.children]
        names += [it for it in (*plane.let_go, *plane.remote.processes) if it not in names]
        return [
            {
                "name": name,
                "state": self._state_of(name),
                "tick": plane.vitals.tick(name),
                "cpu": self._cpu_of(name),
                "waited_for": name in waits,
            }
            for name in names
        ]

    def _state_of(self, process: str) -> str:
        plane = self._plane
        if self.is_restarting(process):
            return "restarting"
        if process in plane.let_go:
            return "dropped"
        struck = plane.struck.get(process)
        if struck is not None and struck.kind == "frozen":
            return "frozen"
        if process in plane.held:
            return "held"
        child = plane.child(process)
        ended = child.ended() if child is not None else process not in plane.alive
        return "ended" if ended else "up"

    def _cpu_of(self, process: str) -> float | None:
        """Processors that a process of this machine has used of late."""
        child = self._plane.child(process)
        stat = None if child is None else kernel_stat(child.pid)
        if child is None or stat is None:
            return None
        rate = self._cpu.setdefault(child.pid, _Rate(_CPU_OVER_S))
        rate.note(self._plane.now(), stat.cpu_ticks / _TICKS_HZ)
        found = rate.rate()
        return None if found is None else round(found, 3)

    def _since(self, respond: Respond, since: int) -> None:
        events, number = self.events.since(since)
        respond({"events": [self._row(one) for one in events], "next": number})

    def _row(self, event: Event) -> dict[str, Any]:
        return {**event._asdict(), "t_s": self._orders.seconds(event.tick)}
