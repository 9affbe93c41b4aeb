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

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from bridge.network.fault_orders import FaultOrder, targets_to
from configs.errors import ScenarioError
from configs.faults.absences import Absence
from configs.faults.base import Fault
from configs.faults.ordered import ordered_fault
from configs.faults.plan import fresh_name, no_return, plan
from configs.faults.processes import ProcessStopped
from configs.roles import AGENT, LAUNCHER, PLANT
from configs.scenario import Scenario
from fleetloop.door.requests import Request, Respond
from fleetloop.launch.fault_ledger import Entry, FaultLedger
from fleetloop.launch.order_book import OrderBook, PendingOrder

REACHED_S = 20.0
"""Longest wait until a tick is reached that processes have named."""


class FaultDesk:
    """Orders faults of one run.

    Args:
        scenario: of the run.
        fault_problem: why a fault can't act on a robot where the deployment places it.
        orders: of the run.
        is_paused: whether the run stands still: no tick is waited for.
    """

    def __init__(
        self,
        scenario: Scenario,
        fault_problem: Callable[[Fault, str], str | None],
        orders: OrderBook,
        is_paused: Callable[[], bool],
    ) -> None:
        self.ledger = FaultLedger(scenario)
        self._scenario = scenario
        self._fault_problem = fault_problem
        self._orders = orders
        self._coming: set[str] = set()  # names of faults whose orders aren't answered
        self._reached: list[tuple[int, float, Callable[[], None]]] = []
        self._is_paused = is_paused
        self.on_absences: Callable[[Iterable[Absence]], None] = lambda _: None
        """Called with the absences of controllers by all faults when these change."""
        self.requests: Mapping[str, Request] = {
            "fault.list": Request({}, self._list),
            "fault.inject": Request({"fault": dict}, self._inject, changes=True),
            "fault.clear": Request({"names": list}, self._clear, changes=True),
        }

    def repeat(self, process: str) -> None:
        """Tell a controller, which may have been started again, what the scenario doesn't say."""
        role, _, robot = process.partition("/")
        tick = self._orders.tick()
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
            told = process if self._orders.schedule.realtime else PLANT.name
            self._orders.put(told, order.encode())

    def look(self) -> None:
        """Answer what waits for a tick that is reached, or for too long."""
        now_s, tick = self._orders.now_s(), self._orders.tick()
        waits = not self._is_paused()
        due = [one for one in self._reached if one[0] <= tick or now_s > one[1] or not waits]
        self._reached = [one for one in self._reached if one not in due]
        for _, _, respond in due:
            respond()

    def end(self) -> None:
        """Answer what still waits for a tick: the run ends, perhaps by a fault that was ordered."""
        for _, _, respond in self._reached:
            respond()
        self._reached.clear()

    # --- requests --------------------------------------------------------------------------------

    def _list(self, respond: Respond) -> None:
        tick = self._orders.tick()
        rows, tables = self.ledger.rows(tick), self.ledger.tables()
        respond({"tick": tick, "t_s": self._orders.seconds(tick), "faults": rows, "tables": tables})

    def _inject(self, respond: Respond, fault: dict[str, Any]) -> None:
        tick = self._orders.tick()
        names = [*self.ledger.names, *self._coming]
        ordered = ordered_fault(fault, self._scenario, max(self._orders.seconds(tick), 0.0), names)
        name = ordered.name or fresh_name(ordered.kind, names)
        planned = plan(ordered, name, self._scenario)
        first, last = planned[0].from_tick, planned[0].to_tick
        entry = Entry(name, ordered, tuple(one.target for one in planned), first, last, True)
        self._refuse_unreachable(ordered, entry.targets)

        def done(pending: PendingOrder) -> None:
            self._coming.discard(name)
            if pending.ticks:
                self._note_beginning(entry, pending)
            if pending.refusals:
                respond({"error": _refused(entry, pending, "not applied")})
            else:
                row, now = self.ledger.row, self._orders.tick
                reached = now() if exact else pending.tick  # what is planned is said at once
                self._when_reached(reached, lambda: respond({"fault": row(entry, now())}))

        exact = "at_s" in fault
        self._coming.add(name)
        self._order(entry, done, ends=False, exact=exact)

    def _clear(self, respond: Respond, names: list[Any]) -> None:
        if not all(isinstance(name, str) for name in names):
            raise ScenarioError("names must be texts")
        entries = self.ledger.to_end(names, self._orders.tick())
        left, refused = [*entries], []
        stay = {one.name: problem for one in entries if (problem := self._no_return(one))}
        if names and stay:
            raise ScenarioError("\n".join(f"{name}: {why}" for name, why in stay.items()))
        entries = [one for one in entries if one.name not in stay]
        if not entries:
            respond({"cleared": []})

        def done(entry: Entry, pending: PendingOrder) -> None:
            left.remove(entry)
            if pending.ticks:
                self.ledger.end(entry, pending.tick)
                self._follow(entry.fault)
            if pending.refusals:
                refused.append(_refused(entry, pending, "not cleared"))
            if left:
                return
            if refused:
                respond({"error": "; ".join(refused)})
            else:
                self._when_reached(pending.tick, answer)

        def answer() -> None:
            tick = self._orders.tick()
            respond({"cleared": [self.ledger.row(one, tick) for one in entries]})

        for entry in entries:
            self._order(entry, partial(done, entry), ends=True, exact=False)

    # --- orders ----------------------------------------------------------------------------------

    def _order(
        self, entry: Entry, done: Callable[[PendingOrder], None], *, ends: bool, exact: bool
    ) -> None:
        """Order a fault, or its end, of the processes that it concerns."""
        orders, fault, lasts = self._orders, entry.fault, None
        if not ends and entry.to_tick is not None:
            lasts = entry.to_tick - entry.from_tick
        from_tick = entry.from_tick if exact else orders.soonest()
        told = self._receivers(fault, entry.targets)
        by_launcher = ends and orders.schedule.realtime and _has_stopped(entry, from_tick)
        pending = orders.expect(() if by_launcher else told, done)
        for process, targets in told.items():
            order = FaultOrder(
                pending.number, ends, entry.name, targets, fault, from_tick, lasts, exact
            )
            orders.tell(pending, process, order.encode())
        if not pending.awaited:
            tick = max(from_tick, entry.from_tick + 1) if by_launcher else from_tick
            pending.ticks[LAUNCHER.name] = tick
            orders.complete(pending)

    def _receivers(self, fault: Fault, targets: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
        """The processes that are told of a fault, with its targets at each."""
        if fault.PLACE == "plant" or not self._orders.schedule.realtime:
            return {PLANT.name: targets}
        heard = {name: targets_to(targets, name) for name in self._scenario.names}
        return {AGENT.process(name): those for name, those in heard.items() if those}

    def _refuse_unreachable(self, fault: Fault, targets: tuple[str, ...]) -> None:
        """Refuse what no process of this run can carry out.

        Raises:
            ScenarioError: the text says why.
        """
        for target in targets:
            if (problem := self._fault_problem(fault, target)) is not None:
                raise ScenarioError(f"{target}: {problem}")
            if fault.PLACE == "process" and self._orders.is_absent(AGENT.process(target)):
                raise ScenarioError(f"{target}: its controller is absent: {fault.kind} can't act")

    def _no_return(self, entry: Entry) -> str | None:
        """Why a controller that is absent by a fault couldn't be there again."""
        if not _has_stopped(entry, self._orders.tick()):
            return None
        return no_return(replace(entry.fault, for_s=1.0), self._scenario)

    def _follow(self, fault: Fault) -> None:
        """Tell of a fault that began, or ended, who follows the absences of controllers."""
        if fault.PLACE == "process":
            self.on_absences(self.ledger.absences(self._orders.schedule.ticks))

    def _note_beginning(self, entry: Entry, pending: PendingOrder) -> None:
        """The fault acts where it was taken, from the ticks that were named."""
        tick = pending.tick
        if entry.to_tick is not None:
            entry.to_tick += tick - entry.from_tick
        entry.from_tick = tick
        entry.ticks = {it: at for it, at in pending.ticks.items() if at != tick}
        entry.fault = replace(entry.fault, name=entry.name, at_s=self._orders.seconds(tick))
        self.ledger.add(entry)
        self._follow(entry.fault)

    def _when_reached(self, tick: int, respond: Callable[[], None]) -> None:
        """Answer once the run has reached a tick."""
        self._reached.append((tick, self._orders.now_s() + REACHED_S, respond))


def _has_stopped(entry: Entry, tick: int) -> bool:
    """Whether controllers are killed or frozen by a fault at a tick."""
    return isinstance(entry.fault, ProcessStopped) and entry.from_tick <= tick


def _refused(entry: Entry, pending: PendingOrder, what: str) -> str:
    """What the processes have against an order; where it acts all the same is said, too."""
    why = "; ".join(f"{process}: {text}" for process, text in pending.refusals.items())
    elsewhere = f"; at {', '.join(pending.ticks)} it is" if pending.ticks else ""
    return f"{entry.name}: {what}: {why}{elsewhere}"
