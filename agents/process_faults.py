"""Faults of a controller's own process: it kills, freezes or slows itself at the tick.

So in lockstep they act at exact ticks. A process that is about to be killed or frozen first hands
on what it has for others (`hand_on`), says so, and waits until the launcher has heard it: then all
that it said before has arrived, and the launcher knows that it is by plan. A killed one also has a
last word. A frozen process stands still here until it is awake again.
"""

from collections.abc import Callable

from bridge.fault_schedule import FaultSchedule
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.lifecycle import freeze_self, kill_self
from configs.brief import AgentBrief
from configs.edges import FOREVER
from configs.faults.absences import absences
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
        *("_clock", "_extra_s", "_freeze", "_kill", "_note", "_ticks"),
        *("due_tick", "hand_on", "heard", "last_word", "mute_tick", "schedule"),
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
        self._ticks = brief.schedule.ticks
        self._kill = kill
        self._freeze = freeze
        self._clock = clock
        self._extra_s = 0.0
        self.hand_on: Callable[[bool], None] = lambda _: None
        """Hands on all rows; told whether a process of this robot will have more."""
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

    def _strike(self, tick: int, planned: PlannedFault) -> None:
        freezes = planned.fault.kind == "process_freeze"
        (absence,) = absences([planned], self._ticks)
        self.hand_on(absence.to_tick is not None)
        self._note(tick, "frozen" if freezes else "killed", f"by fault {planned.name}")
        self.heard()
        if freezes:
            self.mute_tick = FOREVER if planned.to_tick is None else planned.to_tick
            self._freeze()
        else:
            self.last_word()
            self._kill()

    def _look(self) -> None:
        acting = (one.fault for one in self.schedule.acting)
        self._extra_s = sum(fault.extra_s for fault in acting if isinstance(fault, ProcessSlow))
        self.due_tick = -FOREVER if self._extra_s else self.schedule.next_tick
