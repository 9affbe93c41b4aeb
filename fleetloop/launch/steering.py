"""Control of a run that goes on: requests of its door become orders, answers of processes answers.

    request            arguments           answer, once it acts
    run.pause          -                   tick: the last one; no process goes on beyond it
    run.step           ticks               tick: the last one now
    run.resume         -                   tick: from which on time goes on
    run.speed          factor              tick: from which on; speed (0: as fast as it can)
    run.leader_speed   speed_m_s, ramp_s   tick, t_s: from which on v_r is, or goes towards, that
    run.leader         -                   leader: the section that repeats it
    run.stop           -                   tick: about where the run ends

What is asked in lockstep only is refused in real time. An order that can't be carried out is
refused with the reason. None of them changes what is computed but that of v_r, which is a step of
the scenario's section [leader] from then on, for controllers that re-join as well.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from math import ceil
from typing import Any

from bridge.network import keys
from bridge.network.link import Link, Publisher
from bridge.network.orders import OrderAnswer
from bridge.network.run_orders import LeaderOrder, Pace, PaceOrder
from configs.brief import Schedule
from configs.errors import ScenarioError
from configs.leader_speed import SpeedChange
from configs.ordered_speed import with_step
from configs.resolve import leader_brief
from configs.roles import AGENT, PLANT, takes_orders
from configs.scenario import Scenario
from fleetloop.door.requests import Request, Respond
from fleetloop.launch.fault_desk import AHEAD_S, ANSWER_S

STEPS_S = 50.0
"""Longest wait for the end of steps; less than a client waits for an answer."""
MOST_STEPS = 1 << 31
MOST_SPEED = 1e6


@dataclass(slots=True)
class _Pending:
    """An order that isn't answered yet."""

    awaited: set[str]  # processes
    deadline_s: float
    done: Callable[["_Pending"], None]
    ticks: dict[str, int] = field(default_factory=dict)
    refusals: dict[str, str] = field(default_factory=dict)

    @property
    def tick(self) -> int:
        """The tick that all, or most, have named."""
        named = [*self.ticks.values()]
        return max(set(named), key=named.count)


class Steering:
    """Orders of one run's pace and leader.

    Args:
        scenario: of the run.
        schedule: of the run.
        speed: to which it is held; 0: as fast as it can.
        numbers: of orders, which no other desk of the run uses.
        is_absent: whether a process is killed, frozen or dropped.
        tick: how far the run is.
        now_s: seconds on the launcher's clock of awake time.
        note: notes an event: kind, text, tick.
    """

    def __init__(
        self,
        scenario: Scenario,
        schedule: Schedule,
        speed: float,
        numbers: Iterator[int],
        is_absent: Callable[[str], bool],
        tick: Callable[[], int],
        now_s: Callable[[], float],
        note: Callable[[str, str, int], None],
    ) -> None:
        self.scenario = scenario
        """Of the run, with the steps of v_r that were ordered."""
        self.speed = speed
        """To which it is held now."""
        self.paused = False
        self.steered: Scenario | None = None
        """The scenario with the steps of v_r that were ordered; None: none was."""
        self._latest_s = 0.0  # of these, the latest
        self._schedule = schedule
        self._numbers = numbers
        self._is_absent = is_absent
        self._tick = tick
        self._clock_s = now_s
        self._note = note
        self._publishers: dict[str, Publisher] = {}
        self._pending: dict[int, _Pending] = {}
        self.on_leader: Callable[[], None] = lambda: None
        """Called when the leader's speed was ordered."""
        self.on_stop: Callable[[str], None] = lambda _: None
        """Called with the reason when the run is to end."""
        pace = {
            "run.pause": Request({}, partial(self._keep_pace, Pace.PAUSE), changes=True),
            "run.resume": Request({}, partial(self._keep_pace, Pace.RESUME), changes=True),
            "run.step": Request({"ticks": int}, self._step, changes=True),
            "run.speed": Request({"factor": float}, self._set_speed, changes=True),
        }
        self.requests: Mapping[str, Request] = {
            **pace,
            "run.leader_speed": Request(
                {"speed_m_s": float, "ramp_s": float}, self._change_leader_speed, changes=True
            ),
            "run.leader": Request({}, self._leader),
            "run.stop": Request({}, self._stop, changes=True),
        }

    def open(self, link: Link, run: str, processes: Iterable[str]) -> None:
        """Declare what orders need; answers come to the fault desk's subscriptions."""
        for process in filter(takes_orders, processes):
            if process == PLANT.name or self._schedule.realtime:
                self._publishers[process] = link.publisher(keys.order(run, process))

    def take(self, process: str, payload: bytes) -> bool:
        """Take the answer of a process to an order of this desk; False if it isn't one."""
        answer = OrderAnswer.decode(payload)
        pending = None if answer is None else self._pending.get(answer.number)
        if answer is None or pending is None:
            return False
        if answer.refusal:
            pending.refusals[process] = answer.refusal
            if process == PLANT.name:  # it speaks for all
                pending.awaited.clear()
        else:
            pending.ticks[process] = answer.tick
        pending.awaited.discard(process)
        if not pending.awaited:
            self._complete(answer.number)
        return True

    def look(self) -> None:
        """Answer what waits for too long."""
        now_s = self._clock_s()
        for number, pending in list(self._pending.items()):
            if now_s > pending.deadline_s:
                late = "no answer in time; whether it acts there is not known"
                pending.refusals |= dict.fromkeys(sorted(pending.awaited), late)
                self._complete(number)

    def seconds(self, tick: int) -> float:
        """Scenario time of a tick."""
        return round(tick * self._schedule.period_s, 9)

    # --- pace ------------------------------------------------------------------------------------

    def _keep_pace(self, what: Pace, respond: Respond, value: float = 0.0) -> None:
        if self._schedule.realtime:
            raise ScenarioError(
                f"run.{what}: this run keeps real time, whose pace nobody sets; a run in lockstep"
                " (--clock lockstep) has one"
            )
        limit_s = STEPS_S if what is Pace.STEP else ANSWER_S + self._schedule.tick_deadline_s

        def done(pending: _Pending) -> None:
            if pending.refusals:
                respond({"error": f"run.{what}: {_why(pending)}"})
                return
            if what in (Pace.PAUSE, Pace.RESUME):
                self.paused = what is Pace.PAUSE
            elif what is Pace.SPEED:
                self.speed = value
            tick = pending.tick
            said = {"tick": tick, "t_s": self.seconds(tick)}
            respond(said | ({"speed": value} if what is Pace.SPEED else {}))

        number = self._await({PLANT.name}, limit_s, done)
        self._publishers[PLANT.name].put(PaceOrder(number, what, value).encode())

    def _step(self, respond: Respond, ticks: int) -> None:
        if not 1 <= ticks <= MOST_STEPS:
            raise ScenarioError(f"run.step: ticks = {ticks}: must be 1 to {MOST_STEPS}")
        self._keep_pace(Pace.STEP, respond, float(ticks))

    def _set_speed(self, respond: Respond, factor: float) -> None:
        if not (factor == 0.0 or 1.0 / MOST_SPEED <= factor <= MOST_SPEED):
            raise ScenarioError(
                f"run.speed: factor = {factor:g}: must be {1.0 / MOST_SPEED:g} to {MOST_SPEED:g}"
                " times real time, or 0: as fast as the machine allows"
            )
        self._keep_pace(Pace.SPEED, respond, factor)

    # --- the leader's speed ----------------------------------------------------------------------

    def _change_leader_speed(self, respond: Respond, speed_m_s: float, ramp_s: float) -> None:
        schedule, now = self._schedule, self._tick()
        from_tick = now + ceil(AHEAD_S / schedule.period_s) if schedule.realtime else 0
        soon_s = max(self.seconds(max(now + 1, from_tick)), self._latest_s)
        reach = with_step(self.scenario, soon_s, speed_m_s, ramp_s).reach

        def done(pending: _Pending) -> None:
            if not pending.ticks:
                respond({"error": f"run.leader_speed: {_why(pending)}"})
                return
            tick = pending.tick
            t_s = self.seconds(tick)
            self.scenario = with_step(self.scenario, t_s, speed_m_s, ramp_s)
            self.steered, self._latest_s = self.scenario, t_s
            how = f" along a ramp of {ramp_s:g} s" if ramp_s else ""
            self._note("leader_speed", f"{speed_m_s:g} m/s{how}, ordered", tick)
            self.on_leader()
            said = {"tick": tick, "t_s": t_s, "speed_m_s": speed_m_s, "ramp_s": ramp_s}
            late = {process: at for process, at in pending.ticks.items() if at != tick}
            respond(said | ({"late": late} if late else {}) | _refused(pending))

        controllers = map(AGENT.process, self.scenario.names)
        awaited = {process for process in controllers if not self._is_absent(process)}
        number = self._await(awaited, ANSWER_S + schedule.tick_deadline_s, done)
        order = LeaderOrder(number, from_tick, False, speed_m_s, round(ramp_s * 1e9), reach)
        for process in awaited if schedule.realtime else (PLANT.name,):
            self._publishers[process].put(order.encode())

    def _leader(self, respond: Respond) -> None:
        leader = self.scenario.leader
        steps = [
            {"t_s": one.t_s, "speed_m_s": one.speed_m_s}
            | ({"ramp_s": one.ramp_s} if one.ramp_s else {})
            for one in leader.steps
        ]
        respond({"leader": {"speed_m_s": leader.speed_m_s, "steps": steps}})

    @property
    def changes(self) -> tuple[SpeedChange, ...]:
        """Of v_r, with the ordered ones."""
        return leader_brief(self.scenario).speed_changes

    # --- the end ---------------------------------------------------------------------------------

    def _stop(self, respond: Respond) -> None:
        tick = self._tick()
        respond({"tick": tick, "t_s": self.seconds(tick)})
        self.on_stop("stopped by its operator")

    # --- orders ----------------------------------------------------------------------------------

    def _await(
        self, awaited: Iterable[str], limit_s: float, done: Callable[[_Pending], None]
    ) -> int:
        """The number of an order that is now to be answered."""
        number = next(self._numbers)
        self._pending[number] = _Pending({*awaited}, self._clock_s() + limit_s, done)
        return number

    def _complete(self, number: int) -> None:
        pending = self._pending.pop(number)
        pending.done(pending)


def _why(pending: _Pending) -> str:
    """What the processes have against an order; the same reason once."""
    reasons: dict[str, list[str]] = {}
    for process, text in pending.refusals.items():
        reasons.setdefault(text, []).append(process)
    return "; ".join(f"{', '.join(them)}: {text}" for text, them in reasons.items())


def _refused(pending: _Pending) -> dict[str, Any]:
    return {"refused": dict(pending.refusals)} if pending.refusals else {}
