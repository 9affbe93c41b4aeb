"""Orders to the processes of a run and their answers, for all desks that order something.

An order has a number, and is pending until all that it awaits have answered, or for too long. In
lockstep the plant may refuse for all. A process that is absent isn't waited for; one that is there
again before it has answered is told again.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import count
from math import ceil

from bridge.network import keys
from bridge.network.link import Link, Publisher
from bridge.network.orders import OrderAnswer
from configs.brief import Schedule
from configs.roles import PLANT, takes_orders

ANSWER_S = 3.0
"""Longest wait for the answers of processes, beyond the deadline of a tick."""
AHEAD_S = 0.2
"""In real time, so far ahead of the last progress all processes can have an order."""


@dataclass(slots=True)
class PendingOrder:
    """An order that isn't answered yet."""

    number: int
    awaited: set[str]  # processes
    deadline_s: float
    done: Callable[["PendingOrder"], None]
    """Called once, when nobody is awaited any more."""
    told: dict[str, bytes] = field(default_factory=dict)
    """By process, the order as it has it."""
    ticks: dict[str, int] = field(default_factory=dict)
    refusals: dict[str, str] = field(default_factory=dict)

    @property
    def tick(self) -> int:
        """The tick that all, or most, have named."""
        named = [*self.ticks.values()]
        return max(set(named), key=named.count)


class OrderBook:
    """The orders of one run.

    Args:
        schedule: of the run.
        is_absent: whether a process is killed, frozen or dropped.
        tick: how far the run is.
        now_s: seconds on the launcher's clock of awake time.
    """

    def __init__(
        self,
        schedule: Schedule,
        is_absent: Callable[[str], bool],
        tick: Callable[[], int],
        now_s: Callable[[], float],
    ) -> None:
        self.schedule = schedule
        self.is_absent = is_absent
        self.tick = tick
        self.now_s = now_s
        self._numbers = count(1)
        self._pending: dict[int, PendingOrder] = {}
        self._publishers: dict[str, Publisher] = {}

    def open(self, link: Link, run: str, processes: Iterable[str]) -> None:
        """Declare what orders and answers need."""
        for process in filter(takes_orders, processes):
            link.subscribe(keys.answer(run, process), "answer")
            if process == PLANT.name or self.schedule.realtime:
                self._publishers[process] = link.publisher(keys.order(run, process))

    def seconds(self, tick: int) -> float:
        """Scenario time of a tick."""
        return round(tick * self.schedule.period_s, 9)

    def soonest(self) -> int:
        """A tick that no process has computed when an order arrives; in lockstep it chooses."""
        if not self.schedule.realtime:
            return 0
        return self.tick() + ceil(AHEAD_S / self.schedule.period_s)

    def expect(
        self,
        processes: Iterable[str],
        done: Callable[[PendingOrder], None],
        within_s: float | None = None,
    ) -> PendingOrder:
        """A new order that these processes are to answer, as far as they aren't absent.

        Args:
            processes: that are to answer.
            done: called once it is answered.
            within_s: the longest wait; None: as for any order.
        """
        awaited = {process for process in processes if not self.is_absent(process)}
        limit_s = ANSWER_S + self.schedule.tick_deadline_s if within_s is None else within_s
        pending = PendingOrder(next(self._numbers), awaited, self.now_s() + limit_s, done)
        self._pending[pending.number] = pending
        return pending

    def tell(self, pending: PendingOrder, process: str, payload: bytes) -> None:
        """Put an order to a process."""
        pending.told[process] = payload
        self.put(process, payload)

    def put(self, process: str, payload: bytes) -> None:
        """Put what no process answers."""
        self._publishers[process].put(payload)

    def take(self, process: str, payload: bytes) -> bool:
        """Take the answer of a process; whether it is well formed."""
        answer = OrderAnswer.decode(payload)
        pending = None if answer is None else self._pending.get(answer.number)
        if answer is None or pending is None:
            return answer is not None  # else it comes late
        for_all = process == PLANT.name and bool(answer.refusal)
        if process not in pending.awaited and not for_all:
            return True
        if answer.refusal:
            pending.refusals[process] = answer.refusal
        else:
            pending.ticks[process] = answer.tick
        pending.awaited -= pending.awaited if for_all else {process}
        if not pending.awaited:
            self.complete(pending)
        return True

    def repeat(self, process: str) -> None:
        """Tell a process, which may have been started again, what it hasn't answered."""
        for pending in self._pending.values():
            answered = process in pending.ticks or process in pending.refusals
            if process in pending.told and not answered:
                self.put(process, pending.told[process])

    def look(self) -> None:
        """Wait no longer for who doesn't answer in time, or has become absent."""
        now_s = self.now_s()
        for pending in [*self._pending.values()]:
            late = now_s > pending.deadline_s
            left = {process for process in pending.awaited if late or self.is_absent(process)}
            if left:
                why = "no answer in time" if late else "absent before it answered"
                why += "; whether it acts there is not known"
                pending.refusals |= dict.fromkeys(sorted(left), why)
                pending.awaited -= left
                if not pending.awaited:
                    self.complete(pending)

    def complete(self, pending: PendingOrder) -> None:
        """An order waits for nobody any more."""
        del self._pending[pending.number]
        pending.done(pending)
