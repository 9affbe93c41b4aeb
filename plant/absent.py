"""Controllers that lockstep goes on without: who they are, until when, and who is told.

    state       from                                           until
    held        late under `hold`, or frozen as planned        it answers the present question again
    dropped     late under `drop`, or its process has gone     a new process is on its bus, if the
                                                               scenario has one

A bus doesn't wait for an absent controller. To its neighbours the plant says in its place that
there is no path state at a tick, of every tick at which one is due. So each of them waits for
exactly one message, of the robot or of the plant, and none waits in vain. A controller publishes
the path state of a tick before it answers the tick before: absent from tick k on, its last one is
of tick k; there again with the answer to tick m, its first one is of tick m + 1.

A controller that has to come again is waited for before its tick begins. Absences are planned by
the scenario, or by an order (`plant.orders`), which may also end one before its time.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import Enum, auto
from typing import Final

from bridge.can_bus.hub import Hub
from bridge.network.link import Publisher
from bridge.network.messages import Silence
from configs.brief import PlantBrief
from configs.edges import FOREVER
from configs.events import Event
from configs.faults.absences import Absence, overlapping
from configs.ticks import Ticks

_AT_ONCE: Final = -FOREVER


class State(Enum):
    """The state of an absent controller."""

    HELD = auto()
    RECALLED = auto()  # held before; the bus waits for it again
    DROPPED = auto()
    BACK = auto()  # dropped before; a new process is on the bus, and the bus waits for it


_WAITED_FOR = (State.RECALLED, State.BACK)


class AbsentControllers:
    """The absent controllers of all buses.

    Args:
        brief: of the plant.
        hub: of the controllers.
        silences: by robot; none if nobody may be absent.
        announce: told of every event.
    """

    def __init__(
        self,
        brief: PlantBrief,
        hub: Hub,
        silences: Mapping[str, Publisher],
        announce: Callable[[Event], None],
    ) -> None:
        self._policy = brief.schedule.on_late
        self.allowed = self._policy != "abort"
        """Whether the run goes on without a controller."""
        self._shares = Ticks(brief.schedule).shares
        self._hub = hub
        self._silences = silences
        self._announce = announce
        self._period_s = brief.schedule.period_s
        self._planned: dict[str, list[Absence]] = {}
        self.plan(brief.absences)
        self._states: dict[str, State] = {}
        self._wakes: dict[str, int] = {}
        """By robot whose controller is frozen as planned, the tick at which it is awake again."""
        self._returns: dict[str, int] = {}
        """By robot whose controller is started again as planned, the tick of that."""
        self._causes: dict[str, str] = {}
        """By robot, the fault of the planned absence that began last."""

    # --- planned absences ------------------------------------------------------------------------

    def problem(self, wanted: Sequence[Absence]) -> str | None:
        """Why these can't be planned as well, None if they can."""
        for one in wanted if self.allowed else ():
            if one.robot in self._states:
                return f"the controller of {one.robot} is absent"
            overlap = overlapping((*self._planned.get(one.robot, ()), one))
            if overlap is not None:
                return overlap.problem(self._period_s)
        return None

    def plan(self, wanted: Iterable[Absence]) -> None:
        """Plan these as well."""
        for one in wanted if self.allowed else ():
            planned = self._planned.setdefault(one.robot, [])
            planned.append(one)
            planned.sort(key=lambda it: it.from_tick)

    def curtail(self, name: str, robots: Iterable[str], tick: int) -> bool:
        """End the absences by a fault at a tick; whether there are any.

        One that would begin at that tick or later is forgotten.
        """
        found = not self.allowed  # then the first one ends the run
        for robot in robots:
            planned = self._planned.get(robot, [])
            of_fault = [one for one in planned if one.name == name]
            self._planned[robot] = [
                one.ended(tick) if one.name == name else one
                for one in planned
                if one.name != name or one.from_tick < tick
            ]
            found |= bool(of_fault)
            for ends in (self._wakes, self._returns):
                if self._causes.get(robot) == name and robot in ends:
                    ends[robot] = min(ends[robot], tick)
                    found = True
        return found

    # --- through the ticks -----------------------------------------------------------------------

    def any_of(self, robots: list[str]) -> bool:
        """Whether one of them is absent."""
        return any(robot in self._states for robot in robots)

    def due_tick(self, robots: list[str]) -> int:
        """The tick from which on `begin` has something to do for these robots."""
        if self.any_of(robots):
            return _AT_ONCE
        planned = [self._planned[it][0].from_tick for it in robots if self._planned.get(it)]
        return min(planned, default=FOREVER)

    def begin(self, robots: list[str], tick: int) -> list[str]:
        """Begin a tick of one bus; return the robots whose new processes it has to wait for."""
        awaited = []
        for robot in robots:
            self._begin_planned(robot, tick)
            state = self._states.get(robot)
            if state is State.HELD and self._may_answer(robot, tick):
                self._hub.recall(robot)
                self._states[robot] = State.RECALLED
            elif state is State.DROPPED and tick >= self._returns.get(robot, FOREVER):
                del self._returns[robot]
                self._states[robot] = State.BACK
                self._hub.expel(robot, "another process is its controller now")
                self._tell(tick, robot, "awaited", "until its controller is started again")
                awaited.append(robot)
        return awaited

    def end(self, robots: list[str], tick: int) -> None:
        """End a tick of one bus: who has answered is there again, the others have no path state."""
        shares = self._shares(tick + 1)
        for robot in robots:
            state = self._states.get(robot)
            if state in _WAITED_FOR and self._hub.joined(robot):
                del self._states[robot]
                self._tell(tick, robot, "back", "its controller answers again")
                continue
            if state is State.BACK:
                self._drop(robot, tick, "its controller has left its bus again")
            if state is not None and shares:
                self._silences[robot].put(Silence(tick + 1).encode())

    def late(self, robots: list[str], tick: int) -> None:
        """Go on without these, who didn't answer in time."""
        for robot in robots:
            if self._policy == "hold":
                self._hold(robot, tick, "its controller didn't answer in time")
            else:
                self._drop(robot, tick, "its controller didn't answer in time")
                self._hub.expel(robot, "dropped: it didn't answer in time")

    def gone(self, robot: str, tick: int) -> None:
        """Go on without one whose process has gone."""
        state = self._states.get(robot)
        if state in (State.DROPPED, State.BACK):  # the process of before
            return
        self._drop(robot, tick, "its controller has left its bus")

    def _begin_planned(self, robot: str, tick: int) -> None:
        planned = self._planned.get(robot)
        if not planned or tick < planned[0].from_tick:
            return
        absence = planned.pop(0)
        if self._states.get(robot) in (State.DROPPED, State.BACK):  # nothing is there to be killed
            return
        self._causes[robot] = absence.name
        until = FOREVER if absence.to_tick is None else absence.to_tick
        if absence.frozen and self._policy == "hold":
            self._wakes[robot] = until
            self._hold(robot, tick, "its controller is frozen")
            return
        self._returns[robot] = until
        if absence.frozen:
            # It still hears the question of this tick, and freezes itself with that.
            self._hub.excuse(robot)
            self._drop(robot, tick, "its controller is frozen")

    def _may_answer(self, robot: str, tick: int) -> bool:
        wakes = self._wakes.get(robot)
        if wakes is None:
            return self._hub.awake(robot)
        if tick >= wakes:
            del self._wakes[robot]  # should it be late again, as soon as it answers
            return True
        return False

    def _hold(self, robot: str, tick: int, why: str) -> None:
        self._hub.excuse(robot)
        if robot not in self._states:
            self._tell(tick, robot, "held", why)
        self._states[robot] = State.HELD

    def _drop(self, robot: str, tick: int, why: str) -> None:
        self._states[robot] = State.DROPPED
        self._tell(tick, robot, "dropped", why)

    def _tell(self, tick: int, robot: str, kind: str, text: str) -> None:
        self._announce(Event(tick, robot, kind, text))
