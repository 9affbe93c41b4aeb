"""Faults of a plant on its own, ordered by the program that started it."""

from collections import deque
from collections.abc import Mapping, Sequence
from math import ceil
from queue import Empty, SimpleQueue
from typing import Any

from bridge.network.fault_orders import FaultOrder
from bridge.network.orders import Order
from configs.brief import Schedule
from configs.errors import ScenarioError
from configs.faults.base import RobotFault
from configs.faults.kinds import KINDS
from configs.faults.ordered import ordered_fault
from configs.faults.plan import fresh_name, names_of, plan
from configs.parameters import MOST_S
from configs.scenario import Scenario
from plant.orders import PlantOrders

ANSWER_S = 2.0
"""Longest wait for the plant's loop."""


class LocalInbox:
    """Orders to the plant of this process: from the thread that asks to its loop."""

    def __init__(self) -> None:
        self.waiting: deque[FaultOrder] = deque()
        self._answers: SimpleQueue[int | str] = SimpleQueue()

    def take(self) -> list[Order]:
        """The orders that have come."""
        return [self.waiting.popleft() for _ in range(len(self.waiting))]

    def answer(self, _: Order, tick: int | str) -> None:
        """Say the tick at which an order acts, or why it doesn't."""
        self._answers.put(tick)

    def ask(self, order: FaultOrder) -> int:
        """The tick at which an order acts; one order at a time.

        Raises:
            ScenarioError: it doesn't; the text says why.
        """
        self.waiting.append(order)
        try:
            tick = self._answers.get(timeout=ANSWER_S)
        except Empty:
            raise ScenarioError(f"{order.name}: the plant stands still") from None
        if isinstance(tick, str):
            raise ScenarioError(f"{order.name}: {tick}")
        return tick


class PlantFaults:
    """Orders faults of a plant on its own.

    Args:
        scenario: of the plant.
        schedule: of the plant.
        robots: that it emulates.
    """

    def __init__(self, scenario: Scenario, schedule: Schedule, robots: Sequence[str]) -> None:
        self._scenario = scenario.model_copy(update={"duration_s": MOST_S, "until_s": None})
        self._schedule = schedule
        self._robots = tuple(robots)
        self._inbox = LocalInbox()
        self._ordered: dict[str, FaultOrder] = {}
        self.orders = PlantOrders(schedule, self._inbox, {})
        """For the plant's loop."""

    def inject(self, table: Mapping[str, Any], tick: int) -> dict[str, Any]:
        """Apply a fault, with the keys of [[fault]]; of all robots of this plant if none is named.

        Returns its name and the tick from which on it acts.

        Raises:
            ScenarioError: it can't act; the text says why.
        """
        period_s = self._schedule.period_s
        names = [*names_of(self._scenario.fault), *self._ordered]
        now_s = max(tick, 0) * period_s
        fault = ordered_fault(self._placed(table), self._scenario, now_s, names)
        if fault.PLACE != "plant":
            raise ScenarioError(f"{fault.kind}: a plant on its own has no controllers")
        name = fault.name or fresh_name(fault.kind, names)
        planned = plan(fault, name, self._scenario)
        ticks = None if fault.for_s is None else ceil(fault.for_s / period_s - 1e-6)
        order = FaultOrder(
            *(0, False, name, tuple(one.target for one in planned), fault),
            *(planned[0].from_tick, ticks, "at_s" in table),
        )
        begins = self._inbox.ask(order)
        self._ordered[name] = order
        return {"fault": {"name": name, "tick": begins, "t_s": begins * period_s}}

    def _placed(self, table: Mapping[str, Any]) -> Mapping[str, Any]:
        """A fault of all robots of the plant, if none is named and it is one of robots."""
        made = KINDS.get(str(table.get("kind")))
        of_robots = made is not None and issubclass(made, RobotFault)
        return {"robots": self._robots, **table} if of_robots else table

    def clear(self, name: str) -> dict[str, Any]:
        """End a fault that was ordered; return its name and the tick from which on it is over.

        Raises:
            ScenarioError: there is none, or it happened at an instant.
        """
        order = self._ordered.get(name)
        if order is None or order.fault.INSTANT:
            known = ", ".join(it for it, one in self._ordered.items() if not one.fault.INSTANT)
            raise ScenarioError(f"{name}: no fault to clear; there are: {known or 'none'}")
        tick = self._inbox.ask(order._replace(ends=True, from_tick=0, exact=False))
        return {"fault": {"name": name, "tick": tick, "t_s": tick * self._schedule.period_s}}
