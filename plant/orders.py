"""Orders of faults to the plant, and in lockstep those to controllers, which it hands on.

A controller waits for the pose of each tick at which the localisation system takes one. An order
that is put before such a pose arrives before it; so the tick at which that pose is due is the first
one at which all controllers have the order, however far they are now.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, Protocol

from bridge.network.fault_orders import FaultOrder, targets_to
from bridge.network.link import Publisher
from configs.brief import Schedule
from plant.bus.port import Bus


class Inbox(Protocol):
    """Where orders arrive."""

    waiting: deque[Any]

    def take(self) -> list[FaultOrder]:
        """The orders that have come."""

    def answer(self, order: FaultOrder, tick: int | str) -> None:
        """Say the tick at which an order acts, or why it doesn't."""


class PlantOrders:
    """Carries out the orders to one plant.

    Args:
        schedule: of the run.
        inbox: where they arrive.
        relays: to the controller of each robot; none in real time.
    """

    def __init__(self, schedule: Schedule, inbox: Inbox, relays: Mapping[str, Publisher]) -> None:
        self._schedule = schedule
        self._inbox = inbox
        self._relays = relays
        self.waiting = inbox.waiting
        """Orders that have come; loops look whether there are any."""

    def take(self, buses: Iterable[Bus], earliest: int) -> None:
        """Carry out what has come; `earliest` is the first tick that no bus has begun."""
        schedules = {
            robot.brief.robot: bus.faults.schedule for bus in buses for robot in bus.robots
        }
        for order in self._inbox.take():
            of_controllers = order.fault.PLACE == "agent"
            first = self._first_heard(earliest) if of_controllers else earliest
            tick = order.tick(first, self._schedule.ticks)
            if isinstance(tick, str):
                self._inbox.answer(order, tick)
            elif of_controllers:
                self._hand_on(order, tick)
            else:
                self._inbox.answer(order, order.act(schedules, tick, self._schedule.period_s))

    def _first_heard(self, earliest: int) -> int:
        """The tick at which the first pose is due that isn't taken yet."""
        every = self._schedule.localise_every
        taken = -(-max(earliest, 0) // every) * every
        return taken + self._schedule.pose_delay_ticks

    def _hand_on(self, order: FaultOrder, tick: int) -> None:
        heard = {robot: targets_to(order.targets, robot) for robot in self._relays}
        if sum(map(len, heard.values())) < len(order.targets):
            self._inbox.answer(order, "not all of its robots are in this run, in lockstep")
            return
        for robot, targets in heard.items():
            if targets:
                told = order._replace(targets=targets, from_tick=tick, exact=True)
                self._relays[robot].put(told.encode())
