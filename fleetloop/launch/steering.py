"""Control of a run that goes on: requests of its door become orders, answers of processes answers.

    request            arguments           answer, once it acts
    run.pause          -                   tick: the last one; no process goes on beyond it
    run.step           ticks               tick: the last one now
    run.resume         -                   tick: from which on time goes on
    run.speed          factor              tick: from which on; speed (0: as fast as it can)
    run.leader_speed   speed_m_s, ramp_s   tick: from which on v_r is, or goes towards, that; late,
                                           refused: processes with another tick, or a reason
    run.leader         -                   leader: the section that repeats it
    run.stop           -                   tick: about where the run ends

Every tick comes with its time, t_s. What is asked in lockstep only is refused in real time. An
order that can't be carried out is refused with the reason. None of them changes what is computed
but that of v_r, which is a step of the scenario's section [leader] from then on, for controllers
that re-join as well.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from bridge.network.run_orders import LeaderOrder, Pace, PaceOrder
from configs.errors import ScenarioError
from configs.leader_speed import SpeedChange
from configs.ordered_speed import with_step
from configs.resolve import leader_brief
from configs.roles import AGENT, PLANT
from configs.scenario import Scenario
from fleetloop.door.requests import Request, Respond
from fleetloop.launch.order_book import OrderBook, PendingOrder
from fleetloop.numbers import FASTEST, SLOWEST

STEPS_S = 50.0
"""Longest wait for the end of steps; less than a client waits for an answer."""
MOST_STEPS = 1 << 31


class Steering:
    """Orders of one run's pace and leader.

    Args:
        scenario: of the run.
        speed: to which it is held; 0: as fast as it can.
        orders: of the run.
        note: notes an event: kind, text, tick.
    """

    def __init__(
        self,
        scenario: Scenario,
        speed: float,
        orders: OrderBook,
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
        self._latest: LeaderOrder | None = None
        self._orders = orders
        self._note = note
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

    # --- pace ------------------------------------------------------------------------------------

    def _keep_pace(self, what: Pace, respond: Respond, value: float = 0.0) -> None:
        orders = self._orders
        if orders.schedule.realtime:
            raise ScenarioError(
                f"run.{what}: this run keeps real time, whose pace nobody sets; a run in lockstep"
                " (--clock lockstep) has one"
            )

        def done(pending: PendingOrder) -> None:
            if pending.refusals:
                respond({"error": f"run.{what}: {_why(pending)}"})
                return
            if what in (Pace.PAUSE, Pace.RESUME):
                self.paused = what is Pace.PAUSE
            elif what is Pace.SPEED:
                self.speed = value
            tick = pending.tick
            said = {"tick": tick, "t_s": orders.seconds(tick)}
            respond(said | ({"speed": value} if what is Pace.SPEED else {}))

        within_s = STEPS_S if what is Pace.STEP else None
        pending = orders.expect([PLANT.name], done, within_s)
        orders.tell(pending, PLANT.name, PaceOrder(pending.number, what, value).encode())

    def _step(self, respond: Respond, ticks: int) -> None:
        if not 1 <= ticks <= MOST_STEPS:
            raise ScenarioError(f"run.step: ticks = {ticks}: must be 1 to {MOST_STEPS}")
        self._keep_pace(Pace.STEP, respond, float(ticks))

    def _set_speed(self, respond: Respond, factor: float) -> None:
        if factor and not SLOWEST <= factor <= FASTEST:
            raise ScenarioError(
                f"run.speed: factor = {factor:g}: must be {SLOWEST:g} to {FASTEST:g}"
                " times real time, or 0: as fast as the machine allows"
            )
        self._keep_pace(Pace.SPEED, respond, factor)

    # --- the leader's speed ----------------------------------------------------------------------

    def _change_leader_speed(self, respond: Respond, speed_m_s: float, ramp_s: float) -> None:
        orders, from_tick = self._orders, self._orders.soonest()
        soon_s = max(orders.seconds(max(orders.tick() + 1, from_tick)), self._latest_s)
        reach = with_step(self.scenario, soon_s, speed_m_s, ramp_s).reach

        def done(pending: PendingOrder) -> None:
            if not pending.ticks:
                respond({"error": f"run.leader_speed: {_why(pending)}"})
                return
            tick = pending.tick
            t_s = orders.seconds(tick)
            self.scenario = with_step(self.scenario, t_s, speed_m_s, ramp_s)
            self.steered, self._latest_s = self.scenario, t_s
            self._latest = order._replace(number=0, from_tick=tick)
            how = f" along a ramp of {ramp_s:g} s" if ramp_s else ""
            self._note("leader_speed", f"{speed_m_s:g} m/s{how}, ordered", tick)
            self.on_leader()
            said = {"tick": tick, "t_s": t_s, "speed_m_s": speed_m_s, "ramp_s": ramp_s}
            late = {process: at for process, at in pending.ticks.items() if at != tick}
            respond(said | ({"late": late} if late else {}) | _refused(pending))

        controllers = [AGENT.process(robot) for robot in self.scenario.names]
        if all(map(orders.is_absent, controllers)):
            raise ScenarioError("run.leader_speed: no controller is there to follow the leader")
        pending = orders.expect(controllers, done)
        ramp_ns = round(ramp_s * 1e9)
        order = LeaderOrder(pending.number, from_tick, False, speed_m_s, ramp_ns, reach)
        # Who is absent in real time has it once it is awake.
        for process in controllers if orders.schedule.realtime else (PLANT.name,):
            orders.tell(pending, process, order.encode())

    def repeat(self, process: str) -> None:
        """Tell a controller the latest order, if it was started before that and hadn't listened.

        In real time: it has the speeds by its hellos, and needs the reach. In lockstep the plant
        hands orders on, to all.
        """
        role, _, _ = process.partition("/")
        if self._latest is not None and role == AGENT.name and self._orders.schedule.realtime:
            self._orders.put(process, self._latest.encode())

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
        tick = self._orders.tick()
        respond({"tick": tick, "t_s": self._orders.seconds(tick)})
        self.on_stop("stopped by its operator")


def _why(pending: PendingOrder) -> str:
    """What the processes have against an order; the same reason once."""
    reasons: dict[str, list[str]] = {}
    for process, text in pending.refusals.items():
        reasons.setdefault(text, []).append(process)
    return "; ".join(f"{', '.join(them)}: {text}" for text, them in reasons.items())


def _refused(pending: PendingOrder) -> dict[str, Any]:
    return {"refused": dict(pending.refusals)} if pending.refusals else {}
