"""Faults of a controller's own process: it kills, freezes or slows itself at the tick.

They are the scenario's, or ordered; in lockstep they act at exact ticks. A process that is about to
be killed or frozen first hands on what it has for others (`hand_on`), says so, and waits until the
launcher has heard it: then all that it said before has arrived, and the launcher knows that it is
by plan. A killed one also has a last word. A frozen process stands still here until it is awake
again.
"""

from collections.abc import Callable

from bridge.fault_schedule import FaultSchedule
from bridge.network.fault_orders import FaultOrder
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import freeze_self, kill_self
from configs.brief import AgentBrief
from configs.edges import FOREVER
from configs.faults.absences import Absence, absences, overlapping
from configs.faults.base import PlannedFault
from configs.faults.processes import ProcessSlow


class ProcessFaults:
    """The faults of one controller's process.

    Args:
        brief: of the controller.
        note: notes an event: tick, kind, text.
        kill: kills this process.
        freeze: stops this process, and returns when it is awake again.
        clock: of the time by which a slow process takes longer.
    """

    __slots__ = (
        *("_clock", "_extra_s", "_freeze", "_kill", "_note", "_period_s", "_robot", "_ticks"),
        *("awake", "due_tick", "hand_on", "heard", "last_word", "mute_tick", "schedule"),
    )

    def __init__(
        self,
        brief: AgentBrief,
        note: Callable[[int, str, str], None],
        *,
        kill: Callable[[], None] = kill_self,
        freeze: Callable[[], None] = freeze_self,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._note = note
        self._robot = brief.robot
        self._period_s, self._ticks = brief.schedule.period_s, brief.schedule.ticks
        self._kill = kill
        self._freeze = freeze
        self._clock = clock
        self._extra_s = 0.0
        self.hand_on: Callable[[Absence], None] = lambda _: None
        """Hands on all rows before an absence."""
        self.awake: Callable[[], None] = lambda: None
        """Called when this process is awake again."""
        self.heard: Callable[[], None] = lambda: None
        """Returns once the launcher has heard the last event."""
        self.last_word: Callable[[], None] = lambda: None
        """Says the report, and returns once the launcher has it."""
        self.mute_tick = -FOREVER
        """Until here the plant says in lockstep that the robot has no path state."""
        self.schedule = FaultSchedule(one for one in brief.faults if one.fault.PLACE == "process")
        self.due_tick = self.schedule.next_tick
        """The tick from which on `begin` has something to do."""

    def skip_to(self, tick: int) -> None:
        """Forget what happened to the process that this one replaces."""
        self.schedule.due(tick - 1)
        self._look()

    def begin(self, tick: int) -> None:
        """Let the faults of a tick act, before anything of the tick is done."""
        for change in self.schedule.due(tick):
            self._note(tick, change.event.kind, change.event.text)
            if change.acts and not isinstance(change.planned.fault, ProcessSlow):
                self._strike(tick, change.planned)
        self._look()
        if self._extra_s:
            self._clock.sleep(self._extra_s)

    def take(self, order: FaultOrder, tick: int) -> int | str:
        """Take an order at a tick, whose faults act by now; the tick at which it acts, or why not.

        It may end a fault that has frozen this process until now.
        """
        acts = order.tick(tick + 1, self._ticks)
        if isinstance(acts, int) and not order.ends:
            acts = self._overlap(order.planned(self._robot, acts, self._period_s)) or acts
        if isinstance(acts, int):
            acts = order.act({self._robot: self.schedule}, acts, self._period_s)
            self._look()
        return acts

    def _overlap(self, planned: PlannedFault) -> str | None:
        """Why a fault can't be planned as well, None if it can."""
        wanted = absences([planned], self._ticks)
        overlap = overlapping((*absences(self.schedule.known, self._ticks), *wanted))
        return overlap.problem(self._period_s) if wanted and overlap is not None else None

    def _strike(self, tick: int, planned: PlannedFault) -> None:
        (absence,) = absences([planned], self._ticks)
        self.hand_on(absence)
        self._note(tick, "frozen" if absence.frozen else "killed", f"by fault {planned.name}")
        self.heard()
        if absence.frozen:
            self._freeze()
            self.awake()
        else:
            self.last_word()
            self._kill()

    def _look(self) -> None:
        acting = (one.fault for one in self.schedule.acting)
        self._extra_s = sum(fault.extra_s for fault in acting if isinstance(fault, ProcessSlow))
        frozen = absences(self.schedule.acting)
        ends = [FOREVER if one.to_tick is None else one.to_tick for one in frozen if one.frozen]
        self.mute_tick = max(ends, default=-FOREVER)
        self.due_tick = -FOREVER if self._extra_s else self.schedule.next_tick
