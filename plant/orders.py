"""Orders of faults to the plant, and in lockstep those to controllers, which it hands on.

A controller waits for the pose of each tick at which the localisation system takes one. An order
that is put before such a pose arrives before it; so the tick at which that pose is due is the first
one at which all controllers have the order, however far they are now. Faults of their processes act
before a tick's messages are heard: they begin and end at the tick after that. The plant plans the
absences that they make. It answers for all controllers: of those that are absent one that is held
comes to the order when it catches up, a new process is told when it is started.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from typing import Any, Protocol

from bridge.fault_schedule import FaultSchedule
from bridge.network.fault_orders import FaultOrder, targets_to
from bridge.network.link import Publisher
from bridge.network.orders import Order
from bridge.network.run_orders import LeaderOrder, Pace, PaceOrder, Standstill, order_tick
from configs.brief import Schedule
from configs.faults.absences import absences
from plant.absent import AbsentControllers
from plant.bus.port import Bus
from plant.pacing import Pacing


class Inbox(Protocol):
    """Where orders arrive."""

    waiting: deque[Any]

    def take(self) -> list[Order]:
        """The orders that have come."""

    def answer(self, order: Order, tick: int | str) -> None:
        """Say the tick at which an order acts, or why it doesn't."""


class PlantOrders:
    """Carries out the orders to one plant.

    Args:
        schedule: of the run.
        inbox: where they arrive.
        relays: to the controller of each robot; none in real time.
        absent: the controllers that lockstep goes on without; None in real time.
        pacing: of lockstep; None in real time.
    """

    def __init__(
        self,
        schedule: Schedule,
        inbox: Inbox,
        relays: Mapping[str, Publisher],
        absent: AbsentControllers | None = None,
        pacing: Pacing | None = None,
    ) -> None:
        self.pacing = pacing
        self.awaited: list[PaceOrder] = []
        """Orders that are answered when the run stands."""
        self._schedule = schedule
        self._inbox = inbox
        self._relays = relays
        self._absent = absent
        self.waiting = inbox.waiting
        """Orders that have come; loops look whether there are any."""

    def take(self, buses: Iterable[Bus], earliest: int, now_ns: int = 0) -> None:
        """Carry out what has come.

        Args:
            buses: with the robots.
            earliest: the first tick that no bus has begun.
            now_ns: by the loop's clock, in lockstep.
        """
        schedules = {
            robot.brief.robot: bus.faults.schedule for bus in buses for robot in bus.robots
        }
        for order in self._inbox.take():
            if isinstance(order, PaceOrder):
                self._keep_pace(order, earliest, now_ns)
                continue
            if isinstance(order, LeaderOrder):
                self._change_speed(order, earliest)
                continue
            first = earliest
            if order.fault.PLACE != "plant":
                first = self._first_heard(earliest) + (order.fault.PLACE == "process")
            tick = order.tick(first, self._schedule.ticks)
            if isinstance(tick, int):
                tick = self._refusal(order, tick, schedules) or tick
            self._inbox.answer(order, tick)

    def _keep_pace(self, order: PaceOrder, earliest: int, now_ns: int) -> None:
        """Pause, let go on, step or hold to a speed; a run that is to stand is waited for."""
        pacing = self.pacing
        if pacing is None:
            self._inbox.answer(order, "in real time the pace is that of the wall clock")
            return
        tick: int | str = earliest
        match order.what:
            case Pace.PAUSE:
                tick = pacing.pause(earliest - 1)
            case Pace.STEP:
                tick = pacing.step(int(order.value))
                if isinstance(tick, int):
                    pacing.anchor(earliest, now_ns)
            case Pace.RESUME:
                pacing.resume()
                pacing.anchor(earliest, now_ns)
                for awaited in self.awaited:
                    self._inbox.answer(awaited, "the run was told to go on before it stood")
                self.awaited.clear()
            case Pace.SPEED:
                pacing.set_speed(order.value, earliest, now_ns)
        if isinstance(tick, int) and order.what in (Pace.PAUSE, Pace.STEP):
            self.awaited.append(order)
        else:
            self._inbox.answer(order, tick)

    def stands(self, tick: int) -> None:
        """Answer those who wait until no bus goes on beyond a tick."""
        awaited, self.awaited = self.awaited, []
        for order in awaited:
            self._inbox.answer(order, tick)

    def tell_of_standstill(self, tick: int) -> None:
        """Tell all controllers that time stands still before a tick."""
        told = Standstill(tick).encode()
        for relay in self._relays.values():
            relay.put(told)

    def _change_speed(self, order: LeaderOrder, earliest: int) -> None:
        """Hand an order of v_r on to all controllers, which answer it."""
        first, ticks = self._first_heard(earliest), self._schedule.ticks
        tick = order_tick(order.from_tick, first, ticks, exact=order.exact)
        if isinstance(tick, str):
            self._inbox.answer(order, tick)
            return
        told = order._replace(from_tick=tick, exact=True).encode()
        for relay in self._relays.values():
            relay.put(told)

    def _refusal(
        self, order: FaultOrder, tick: int, schedules: Mapping[str, FaultSchedule]
    ) -> str | None:
        """Have an order act at a tick; why it can't, None if it does."""
        if order.fault.PLACE == "plant":
            acts = order.act(schedules, tick, self._schedule.period_s)
            return acts if isinstance(acts, str) else None
        refusal = self._unreached(order) or self._absences(order, tick)
        if refusal is None:
            self._hand_on(order, tick)
        return refusal

    def _first_heard(self, earliest: int) -> int:
        """The tick at which the first pose is due that isn't taken yet."""
        every = self._schedule.localise_every
        taken = -(-max(earliest, 0) // every) * every
        return taken + self._schedule.pose_delay_ticks

    def _absences(self, order: FaultOrder, tick: int) -> str | None:
        """Plan the absences by a fault, or their end; why that can't be."""
        absent, period_s = self._absent, self._schedule.period_s
        planned = [order.planned(target, tick, period_s) for target in order.targets]
        wanted = absences(planned, self._schedule.ticks)
        if absent is None or not wanted:
            return None
        if order.ends:
            found = absent.curtail(order.name, order.targets, tick)
            return None if found else "no controller is absent by it, or will be"
        if (problem := absent.problem(wanted)) is not None:
            return problem
        absent.plan(wanted)
        return None

    def _unreached(self, order: FaultOrder) -> str | None:
        """Why a target is out of reach, None if none is."""
        heard = sum(len(targets_to(order.targets, robot)) for robot in self._relays)
        if heard < len(order.targets):
            return "not all of its robots are in this run, in lockstep"
        return None

    def _hand_on(self, order: FaultOrder, tick: int) -> None:
        for robot, relay in self._relays.items():
            if targets := targets_to(order.targets, robot):
                told = order._replace(targets=targets, from_tick=tick, exact=True)
                relay.put(told.encode())
