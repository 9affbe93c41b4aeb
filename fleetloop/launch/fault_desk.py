"""Faults ordered during a run: requests of its door become orders, answers of processes answers.

    request        arguments          answer
    fault.list     -                  faults: all of the run, each with its state; tables: the
                                      entries of [[fault]] that repeat them
    fault.inject   fault              fault: as it acts, from the tick at which it begins
    fault.clear    names ([]: all)    cleared: those that end, with the tick at which they do

An order without `at_s` begins as soon as it can, and is answered once the run has reached that
tick. One that can't be carried out is refused with the reason. In lockstep the plant answers for
all controllers. In real time each does, but for those that are absent: they have the order once
they are awake, or are told when they are started again, to which the launcher sees by itself.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any

from bridge.network import keys
from bridge.network.fault_orders import FaultOrder, targets_to
from bridge.network.link import Link, Publisher
from bridge.network.orders import OrderAnswer
from configs.brief import Schedule
from configs.errors import ScenarioError
from configs.faults.absences import Absence
from configs.faults.base import Fault
from configs.faults.ordered import ordered_fault
from configs.faults.plan import fresh_name, no_return, plan
from configs.faults.processes import ProcessStopped
from configs.roles import AGENT, LAUNCHER, PLANT, takes_orders
from configs.scenario import Scenario
from fleetloop.door.requests import Request, Respond
from fleetloop.launch.fault_ledger import Entry, FaultLedger

ANSWER_S = 3.0
"""Longest wait for the answers of processes, beyond the deadline of a tick."""
REACHED_S = 20.0
"""Longest wait until a tick is reached that processes have named."""
AHEAD_S = 0.2
"""In real time, so far ahead of the last progress all processes can have an order."""


@dataclass(slots=True)
class _Pending:
    """An order that isn't answered yet."""

    entry: Entry
    ends: bool
    awaited: set[str]  # processes
    deadline_s: float
    done: Callable[["_Pending"], None]
    at_once: bool  # answered when the run has reached its tick
    ticks: dict[str, int] = field(default_factory=dict)
    refusals: dict[str, str] = field(default_factory=dict)

    @property
    def tick(self) -> int:
        """The tick that all, or most, have named."""
        named = [*self.ticks.values()]
        return max(set(named), key=named.count)


class FaultDesk:
    """Orders faults of one run.

    Args:
        scenario: of the run.
        schedule: of the run.
        fault_problem: why a fault can't act on a robot where the deployment places it.
        is_absent: whether a process is killed, frozen or dropped.
        tick: how far the run is.
        now_s: seconds on the launcher's clock of awake time.
        numbers: of orders, which no other desk of the run uses.
        is_paused: whether the run stands still: no tick is waited for.
    """

    def __init__(
        self,
        scenario: Scenario,
        schedule: Schedule,
        fault_problem: Callable[[Fault, str], str | None],
        is_absent: Callable[[str], bool],
        tick: Callable[[], int],
        now_s: Callable[[], float],
        numbers: Iterator[int],
        is_paused: Callable[[], bool],
    ) -> None:
        self.ledger = FaultLedger(scenario)
        self._scenario = scenario
        self._schedule = schedule
        self._fault_problem = fault_problem
        self._is_absent = is_absent
        self._tick = tick
        self._clock_s = now_s
        self._publishers: dict[str, Publisher] = {}
        self._pending: dict[int, _Pending] = {}
        self._reached: list[tuple[int, float, Callable[[], None]]] = []
        self._numbers = numbers
        self._is_paused = is_paused
        self.on_absences: Callable[[Iterable[Absence]], None] = lambda _: None
        """Called with the absences of controllers by all faults when these change."""
        self.requests: Mapping[str, Request] = {
            "fault.list": Request({}, self._list),
            "fault.inject": Request({"fault": dict}, self._inject, changes=True),
            "fault.clear": Request({"names": list}, self._clear, changes=True),
        }

    def now(self) -> tuple[int, float]:
        """How far the run is: tick and scenario time [s]."""
        tick = self._tick()
        return tick, self._seconds(tick)

    def open(self, link: Link, run: str, processes: Iterable[str]) -> None:
        """Declare what orders and answers need."""
        for process in filter(takes_orders, processes):
            link.subscribe(keys.answer(run, process), "answer")
            if process == PLANT.name or self._schedule.realtime:
                self._publishers[process] = link.publisher(keys.order(run, process))

    def take(self, process: str, payload: bytes) -> bool:
        """Take the answer of a process; whether it is well formed."""
        answer = OrderAnswer.decode(payload)
        pending = None if answer is None else self._pending.get(answer.number)
        if answer is None or pending is None:
            return answer is not None  # else it comes late
        if process not in pending.awaited:  # in lockstep the plant answers for all
            return True
        if answer.refusal:
            pending.refusals[process] = answer.refusal
        else:
            pending.ticks[process] = answer.tick
        pending.awaited.discard(process)
        if not pending.awaited:
            self._complete(answer.number)
        return True

    def repeat(self, process: str) -> None:
        """Tell a controller, which may have been started again, what the scenario doesn't say."""
        role, _, robot = process.partition("/")
        tick = self._tick()
        for entry in self.ledger.differing(tick) if role == AGENT.name else ():
            targets = targets_to(entry.targets, robot)
            if entry.fault.PLACE != "agent" or not targets:
                continue
            begins = max(entry.from_tick, tick)
            last = entry.to_tick
            ticks = None if entry.cleared or last is None else last - begins
            order = FaultOrder(
                0, entry.cleared, entry.name, targets, entry.fault, begins, ticks, False
            )
            told = process if self._schedule.realtime else PLANT.name
            self._publishers[told].put(order.encode())

    def look(self) -> None:
        """Answer what waits for too long, or for a tick that is reached."""
        now_s, tick = self._clock_s(), self._tick()
        for number, pending in list(self._pending.items()):
            if now_s > pending.deadline_s:
                within = f"no answer in {ANSWER_S:g} s; whether it acts there is not known"
                pending.refusals |= dict.fromkeys(sorted(pending.awaited), within)
                self._complete(number)
        waits = not self._is_paused()
        due = [one for one in self._reached if one[0] <= tick or now_s > one[1] or not waits]
        self._reached = [one for one in self._reached if one not in due]
        for _, _, respond in due:
            respond()

    # --- requests --------------------------------------------------------------------------------

    def _list(self, respond: Respond) -> None:
        tick = self._tick()
        rows, tables = self.ledger.rows(tick), self.ledger.tables()
        respond({"tick": tick, "t_s": self._seconds(tick), "faults": rows, "tables": tables})

    def _inject(self, respond: Respond, fault: dict[str, Any]) -> None:
        tick = self._tick()
        names = [*self.ledger.names, *(it.entry.name for it in self._pending.values())]
        ordered = ordered_fault(fault, self._scenario, max(self._seconds(tick), 0.0), names)
        name = ordered.name or fresh_name(ordered.kind, names)
        planned = plan(ordered, name, self._scenario)
        first, last = planned[0].from_tick, planned[0].to_tick
        entry = Entry(name, ordered, tuple(one.target for one in planned), first, last, True)
        self._refuse_unreachable(ordered, entry.targets)

        def done(pending: _Pending) -> None:
            if pending.ticks:
                self._note_beginning(pending)
            if pending.refusals:
                respond({"error": _refused(pending)})
            else:
                row = self.ledger.row
                self._when_reached(pending, lambda: respond({"fault": row(entry, self._tick())}))

        self._order(entry, done, ends=False, exact="at_s" in fault)

    def _clear(self, respond: Respond, names: list[Any]) -> None:
        if not all(isinstance(name, str) for name in names):
            raise ScenarioError("names must be texts")
        entries = self.ledger.to_end(names, self._tick())
        left, refused = [*entries], []
        stay = {one.name: problem for one in entries if (problem := self._no_return(one))}
        if names and stay:
            raise ScenarioError("\n".join(f"{name}: {why}" for name, why in stay.items()))
        entries = [one for one in entries if one.name not in stay]
        if not entries:
            respond({"cleared": []})

        def done(pending: _Pending) -> None:
            left.remove(pending.entry)
            if pending.ticks:
                self.ledger.end(pending.entry, pending.tick)
                self._follow(pending.entry.fault)
            if pending.refusals:
                refused.append(_refused(pending))
            if left:
                return
            if refused:
                respond({"error": "; ".join(refused)})
            else:
                self._when_reached(pending, answer)

        def answer() -> None:
            respond({"cleared": [self.ledger.row(one, self._tick()) for one in entries]})

        for entry in entries:
            self._order(entry, done, ends=True, exact=False)

    # --- orders ----------------------------------------------------------------------------------

    def _order(
        self, entry: Entry, done: Callable[[_Pending], None], *, ends: bool, exact: bool
    ) -> None:
        """Order a fault, or its end, of the processes that it concerns."""
        number = next(self._numbers)
        fault, lasts = entry.fault, None
        if not ends and entry.to_tick is not None:
            lasts = entry.to_tick - entry.from_tick
        from_tick = entry.from_tick if exact else self._soonest()
        order = FaultOrder(number, ends, entry.name, entry.targets, fault, from_tick, lasts, exact)
        told = self._receivers(fault, entry.targets)
        awaited = {process for process in told if not self._is_absent(process)}
        ticks: dict[str, int] = {}
        if ends and self._schedule.realtime and _has_stopped(entry, from_tick):
            awaited, from_tick = set(), max(from_tick, entry.from_tick + 1)
        if not awaited:
            ticks[LAUNCHER.name] = from_tick
        limit_s = ANSWER_S + self._schedule.tick_deadline_s
        self._pending[number] = _Pending(
            entry, ends, awaited, self._clock_s() + limit_s, done, not exact, ticks
        )
        for process, targets in told.items():
            self._publishers[process].put(order._replace(targets=targets).encode())
        if not awaited:
            self._complete(number)

    def _receivers(self, fault: Fault, targets: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
        """The processes that are told of a fault, with its targets at each."""
        if fault.PLACE == "plant" or not self._schedule.realtime:
            return {PLANT.name: targets}
        heard = {name: targets_to(targets, name) for name in self._scenario.names}
        return {AGENT.process(name): those for name, those in heard.items() if those}

    def _soonest(self) -> int:
        """A tick that no process has computed when the order arrives; in lockstep it chooses."""
        if not self._schedule.realtime:
            return 0
        return self._tick() + ceil(AHEAD_S / self._schedule.period_s)

    def _refuse_unreachable(self, fault: Fault, targets: tuple[str, ...]) -> None:
        """Refuse what no process of this run can carry out.

        Raises:
            ScenarioError: the text says why.
        """
        for target in targets:
            if (problem := self._fault_problem(fault, target)) is not None:
                raise ScenarioError(f"{target}: {problem}")
            if fault.PLACE == "process" and self._is_absent(AGENT.process(target)):
                raise ScenarioError(f"{target}: its controller is absent: {fault.kind} can't act")

    def _no_return(self, entry: Entry) -> str | None:
        """Why a controller that is absent by a fault couldn't be there again."""
        if not _has_stopped(entry, self._tick()):
            return None
        return no_return(replace(entry.fault, for_s=1.0), self._scenario)

    def _follow(self, fault: Fault) -> None:
        """Tell of a fault that began, or ended, who follows the absences of controllers."""
        if fault.PLACE == "process":
            self.on_absences(self.ledger.absences(self._schedule.ticks))

    def _complete(self, number: int) -> None:
        pending = self._pending.pop(number)
        pending.done(pending)

    def _note_beginning(self, pending: _Pending) -> None:
        """The fault acts where it was taken, from the ticks that were named."""
        entry, tick = pending.entry, pending.tick
        if entry.to_tick is not None:
            entry.to_tick += tick - entry.from_tick
        entry.from_tick = tick
        entry.ticks = {it: at for it, at in pending.ticks.items() if at != tick}
        entry.fault = replace(entry.fault, name=entry.name, at_s=self._seconds(tick))
        self.ledger.add(entry)
        self._follow(entry.fault)

    def _when_reached(self, pending: _Pending, respond: Callable[[], None]) -> None:
        """Answer once the run has reached a tick; what was ordered for a later one at once."""
        tick = pending.tick if pending.at_once else self._tick()
        self._reached.append((tick, self._clock_s() + REACHED_S, respond))

    def _seconds(self, tick: int) -> float:
        return round(tick * self._schedule.period_s, 9)


def _has_stopped(entry: Entry, tick: int) -> bool:
    """Whether controllers are killed or frozen by a fault at a tick."""
    return isinstance(entry.fault, ProcessStopped) and entry.from_tick <= tick


def _refused(pending: _Pending) -> str:
    """What the processes have against an order; where it acts all the same is said, too."""
    why = "; ".join(f"{process}: {text}" for process, text in pending.refusals.items())
    what = "not cleared" if pending.ends else "not applied"
    elsewhere = f"; at {', '.join(pending.ticks)} it is" if pending.ticks else ""
    return f"{pending.entry.name}: {what}: {why}{elsewhere}"
