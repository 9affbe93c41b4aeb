"""Lockstep whose controllers are late, gone, or come again: what the plant does by its policy."""

from collections import deque
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from support.clocks import ManualClock
from support.robot_bench import BARE, NOWHERE
from support.scripted_hub import Controller, ScriptedHub

from bridge.network.fault_orders import FaultOrder
from bridge.network.messages import Silence
from bridge.network.run_orders import Pace, PaceOrder, Standstill
from bridge.network.telemetry import PLANT_ROW, RowBuffer
from bridge.process.lifecycle import Stop
from configs.brief import LEAD_TICKS
from configs.errors import InfrastructureError, PeerLostError
from configs.events import Event
from configs.faults.kinds import KINDS
from configs.loading import load
from configs.resolve import plant_brief
from configs.ticks import Ticks
from plant.absent import AbsentControllers
from plant.lockstep import ANSWER_SHARE, LockstepLoop
from plant.orders import PlantOrders
from plant.pacing import Pacing
from plant.robot import emulated_robot

TICKS = 100
SHARES = 10
COUNTDOWN = 125


class Bench:
    """A plant of two robots by the test's clock, and their controllers."""

    def __init__(self, on_late: str, *faults: str, speed: float = 0.0) -> None:
        overrides = (f"fault=[{', '.join(faults)}]", f"clock.on_late={on_late!r}")
        scenario = load("two_robots", (*BARE, "duration_s=0.2", *overrides))
        brief = plant_brief(scenario, network=NOWHERE)
        self.clock = ManualClock(10**9)
        self.hub = ScriptedHub(("r1", "r2"), self.clock)
        self.silent: dict[str, list[int]] = {"r1": [], "r2": []}
        self.events: list[Event] = []
        self.ticks: list[int] = []
        silences = {robot: SimpleNamespace(put=self._hear(robot)) for robot in self.silent}
        absent = AbsentControllers(brief, self.hub, silences, self.events.append)
        self.orders: deque[FaultOrder | PaceOrder] = deque()
        self.paced: list[tuple[Pace, int | str]] = []
        self.standstills: list[int] = []
        self.answers: list[int | str] = []
        self.relayed: list[tuple[str, FaultOrder | None]] = []
        inbox = SimpleNamespace(
            waiting=self.orders,
            take=lambda: [self.orders.popleft() for _ in range(len(self.orders))],
            answer=self._take_answer,
        )
        relays = {robot: SimpleNamespace(put=self._relay(robot)) for robot in self.silent}
        nowhere = SimpleNamespace(put=lambda _: None)
        self.schedule = brief.schedule
        robots = [emulated_robot(robot) for robot in brief.robots]
        self.loop = LockstepLoop(
            brief,
            robots,
            self.hub,
            [nowhere, nowhere],
            [RowBuffer(PLANT_ROW, lambda *_: None) for _ in robots],
            lambda state: self.ticks.append(state.tick),
            {},
            absent,
            PlantOrders(brief.schedule, inbox, relays, absent, Pacing(brief.schedule, speed)),
            clock=self.clock,
        )

    def _hear(self, robot: str) -> Callable[[bytes], None]:
        def put(payload: bytes) -> None:
            silence = Silence.decode(payload)
            assert silence is not None
            self.silent[robot].append(silence.tick)

        return put

    def _relay(self, robot: str) -> Callable[[bytes], None]:
        def put(payload: bytes) -> None:
            standstill = Standstill.decode(payload)
            if standstill is None:
                self.relayed.append((robot, FaultOrder.decode(payload)))
            else:
                self.standstills.append(standstill.tick)

        return put

    def _take_answer(self, order: FaultOrder | PaceOrder, tick: int | str) -> None:
        if isinstance(order, PaceOrder):
            self.paced.append((order.what, tick))
        else:
            self.answers.append(tick)

    def order(self, tick: int, kind: str, **order: Any) -> None:
        """Order a fault of r2's process, or its end, while the buses are at a tick."""
        fault = KINDS[kind](kind=kind, at_s=0.0)
        rest = {"from_tick": 0, "ticks": None, "exact": False} | order
        made = FaultOrder(1, rest.pop("ends", False), kind, ("r2",), fault, **rest)
        self.at("r1", tick, lambda: self.orders.append(made))

    def controller(self, robot: str) -> Controller:
        return self.hub.controllers[robot]

    def at(self, robot: str, tick: int, act: Callable[[], object]) -> None:
        """Do something once, when a controller was asked at a tick, before anybody answers."""
        before, done = self.hub.script, []
        asked_ns = Ticks(self.schedule).bus_time_ns(tick - 1)

        def script() -> None:
            before()
            if not done and asked_ns in self.controller(robot).stamps_ns:
                done.append(act())

        self.hub.script = script

    def stops(self, robot: str, tick: int) -> None:
        """Let a controller answer no more from a tick on, as one that hangs."""
        self.at(robot, tick, lambda: setattr(self.controller(robot), "answers", False))

    def run(self) -> None:
        self.loop.run(Stop())

    def told(self) -> list[tuple[int, str, str]]:
        return [(event.tick, event.source, event.kind) for event in self.events]


@pytest.fixture
def benches(runtime_folder) -> Iterator[Callable[..., Bench]]:
    made: list[Bench] = []

    def make(on_late: str, *faults: str, speed: float = 0.0) -> Bench:
        made.append(Bench(on_late, *faults, speed=speed))
        return made[-1]

    yield make
    for bench in made:
        bench.hub.end()


def test_without_anybody_late_every_policy_is_the_same(benches) -> None:
    for policy in ("abort", "hold", "drop"):
        bench = benches(policy)
        bench.run()
        stamps = [Ticks(bench.schedule).bus_time_ns(tick) for tick in range(-COUNTDOWN, TICKS + 1)]
        assert bench.controller("r1").stamps_ns == bench.controller("r2").stamps_ns == stamps
        assert (bench.events, bench.silent) == ([], {"r1": [], "r2": []})
        bench.hub.end()


def test_abort_ends_the_run_with_the_name_of_the_late_one(benches) -> None:
    bench = benches("abort")
    bench.stops("r2", 40)
    began_s = bench.clock.monotonic_s()
    with pytest.raises(InfrastructureError, match=r"tick 40 .* of r2 within 1\.8 s"):
        bench.run()
    limit_s = ANSWER_SHARE * bench.schedule.tick_deadline_s
    assert limit_s < bench.clock.monotonic_s() - began_s < limit_s + 0.3


def test_abort_ends_the_run_with_the_name_of_the_one_that_left(benches) -> None:
    bench = benches("abort")
    bench.at("r2", 40, bench.controller("r2").leave)
    with pytest.raises(PeerLostError, match=r"tick 40 .* r2 left its bus"):
        bench.run()


@pytest.mark.parametrize("policy", ["hold", "drop"])
def test_the_others_go_on_without_one_that_left(policy: str, benches) -> None:
    bench = benches(policy)
    bench.at("r2", 40, bench.controller("r2").leave)
    bench.run()
    assert bench.told() == [(40, "r2", "dropped")]
    # The path state of tick 40 was published before the answer to tick 39.
    assert bench.silent == {"r1": [], "r2": [50, 60, 70, 80, 90, 100]}
    assert len(bench.controller("r1").stamps_ns) == COUNTDOWN + TICKS + 1


def test_a_dropped_controller_is_told_so_and_costs_one_deadline(benches) -> None:
    bench = benches("drop")
    bench.stops("r2", 43)
    began_s = bench.clock.monotonic_s()
    bench.run()
    limit_s = ANSWER_SHARE * bench.schedule.tick_deadline_s
    assert limit_s < bench.clock.monotonic_s() - began_s < limit_s + 0.5
    assert bench.told() == [(43, "r2", "dropped")]
    assert bench.silent["r2"] == [50, 60, 70, 80, 90, 100]
    late = bench.controller("r2")
    late.answers = True
    late.answer()
    assert late.goodbye == "dropped: it didn't answer in time"


def test_a_held_controller_is_waited_for_again_once_it_answers(benches) -> None:
    bench = benches("hold")
    late = bench.controller("r2")
    bench.stops("r2", 43)
    bench.at("r1", 75, lambda: setattr(late, "answers", True))
    bench.run()
    (held, back) = bench.events
    assert (held.tick, held.source, held.kind) == (43, "r2", "held")
    assert (back.source, back.kind) == ("r2", "back")
    # It heard every question, late ones as well, and the plant spoke for it meanwhile.
    assert len(late.stamps_ns) == COUNTDOWN + TICKS + 1
    assert bench.silent["r2"] == list(range(50, back.tick + 1, SHARES))
    assert 60 <= back.tick <= 80


def test_who_waits_for_a_late_one_is_not_late_itself(benches) -> None:
    """r1 is at a later tick and answers no more until r2 is dropped, as if it waited for it."""
    bench = benches("drop")
    bench.stops("r2", 40)
    bench.stops("r1", 50)
    before = bench.hub.script

    def heard() -> None:
        before()
        if bench.silent["r2"]:
            bench.controller("r1").answers = True

    bench.hub.script = heard
    bench.run()
    assert bench.told() == [(40, "r2", "dropped")]


def test_a_frozen_controller_is_not_waited_for_from_its_tick_until_its_tick(benches) -> None:
    fault = "{kind='process_freeze', at_s=0.08, for_s=0.1, robots=['r2']}"
    bench = benches("hold", fault)
    late = bench.controller("r2")
    bench.stops("r2", 40)
    # Awake when the plant waits for it, at tick 90.
    bench.at("r1", 91, lambda: setattr(late, "answers", True))
    began_s = bench.clock.monotonic_s()
    bench.run()
    assert bench.told() == [(40, "r2", "held"), (90, "r2", "back")]
    assert bench.silent["r2"] == [50, 60, 70, 80, 90]
    assert bench.clock.monotonic_s() - began_s < 0.5


KILL = "{kind='process_kill', at_s=0.08, for_s=0.1, robots=['r2']}"


def comes_again(bench: Bench, tick: int) -> None:
    """Let a new process of r2 be on its bus a while after it is awaited."""
    before = bench.hub.script

    def script() -> None:
        before()
        if bench.told()[-1:] == [(tick, "r2", "awaited")] and bench.clock.now_ns > 5 * 10**9:
            bench.hub.again("r2")
            bench.hub.script = before

    bench.hub.script = script


def test_time_stands_still_until_a_killed_controller_has_come_again(benches) -> None:
    bench = benches("drop", KILL)
    bench.at("r2", 40, bench.controller("r2").leave)
    comes_again(bench, 90)
    bench.run()
    said = [(40, "dropped"), (90, "awaited"), (90, "back")]
    assert bench.told() == [(tick, "r2", kind) for tick, kind in said]
    assert bench.silent["r2"] == [50, 60, 70, 80, 90]
    stamps = [Ticks(bench.schedule).bus_time_ns(tick) for tick in range(90, TICKS + 1)]
    assert bench.controller("r2").stamps_ns == stamps
    assert bench.ticks[-1] >= 90


def test_a_killed_controller_that_does_not_come_again_ends_the_run(benches) -> None:
    bench = benches("drop", KILL)
    bench.at("r2", 40, bench.controller("r2").leave)
    with pytest.raises(InfrastructureError, match=r"tick 90 .* r2 did not come again within 20 s"):
        bench.run()


def test_an_ordered_kill_is_planned_where_its_controller_has_the_order(benches) -> None:
    bench = benches("drop")
    bench.order(30, "process_kill")
    ordered: list[int] = []

    def leave() -> None:
        (tick,) = bench.answers
        assert isinstance(tick, int)
        ordered.append(tick)
        bench.at("r2", tick, bench.controller("r2").leave)

    bench.at("r2", 32, leave)
    bench.order(60, "process_kill", ends=True)
    bench.at("r1", 62, lambda: comes_again(bench, int(bench.answers[1])))
    bench.run()
    kill, end = bench.answers
    # Buses are two ticks apart at most: the next pose that is due there, and the tick after.
    every, delay = bench.schedule.localise_every, bench.schedule.pose_delay_ticks
    assert (kill - 1 - delay) % every == 0
    assert 31 < kill <= 33 + every + delay
    assert bench.told() == [
        (tick, "r2", kind) for tick, kind in ((kill, "dropped"), (end, "awaited"), (end, "back"))
    ]
    relayed = [(robot, it.ends, it.from_tick, it.exact) for robot, it in bench.relayed]
    assert relayed == [("r2", False, kill, True), ("r2", True, end, True)]


def test_orders_that_cannot_act_are_refused_and_a_planned_absence_is_forgotten(benches) -> None:
    bench = benches("drop", "{kind='process_kill', at_s=0.16, robots=['r2']}")
    bench.order(30, "process_freeze", from_tick=70, ticks=20, exact=True)
    bench.order(32, "process_restart", from_tick=20, exact=True)
    bench.order(34, "process_kill", ends=True)
    bench.order(50, "process_kill", ends=True)
    bench.run()
    overlap, gone, ended, nothing = bench.answers
    assert overlap == (
        "the process of r2 is absent from 0.14 s on, and can't be killed or frozen then"
    )
    assert str(gone).startswith("tick 20 has gone: tick ")
    assert 34 < int(ended) < 80
    assert nothing == "no controller is absent by it, or will be"
    assert bench.told() == []
    assert [(it.name, it.ends) for _, it in bench.relayed] == [("process_kill", True)]


def test_an_ordered_freeze_is_held_until_it_is_ended(benches) -> None:
    bench = benches("hold")
    late = bench.controller("r2")
    bench.order(30, "process_freeze")
    bench.at("r2", 32, lambda: bench.stops("r2", int(bench.answers[0])))
    bench.order(70, "process_freeze", ends=True)
    bench.at("r1", 72, lambda: bench.at("r1", int(bench.answers[1]), awake))

    def awake() -> None:
        late.answers = True

    began_s = bench.clock.monotonic_s()
    bench.run()
    frozen_tick, end = bench.answers
    assert bench.told() == [(frozen_tick, "r2", "held"), (end, "r2", "back")]
    assert bench.clock.monotonic_s() - began_s < 0.5


def test_a_run_is_paused_stepped_and_sped_and_computes_the_same_ticks(benches) -> None:
    bench = benches("abort")
    bench.at("r1", 40, lambda: bench.orders.append(PaceOrder(1, Pace.PAUSE)))
    asked: list[Pace] = []
    reached_ns = {}

    def ask(what: Pace, value: float = 0.0) -> None:
        if what not in asked:
            asked.append(what)
            bench.orders.append(PaceOrder(1, what, value))

    before = bench.hub.script

    def script() -> None:
        before()
        now_ns = bench.clock.now_ns
        for what, tick in bench.paced:
            reached_ns.setdefault(what, (now_ns, tick))
        if Pace.PAUSE in reached_ns and now_ns - reached_ns[Pace.PAUSE][0] > 3 * 10**9:
            stamps = {bench.controller(robot).stamps_ns[-1] for robot in ("r1", "r2")}
            assert Pace.STEP in asked or stamps == {
                Ticks(bench.schedule).bus_time_ns(reached_ns[Pace.PAUSE][1])
            }
            ask(Pace.STEP, 10.0)
        if Pace.STEP in reached_ns:
            ask(Pace.SPEED, 0.5)
            ask(Pace.RESUME)

    bench.hub.script = script
    began_ns = bench.clock.now_ns
    bench.run()
    stamps = [Ticks(bench.schedule).bus_time_ns(tick) for tick in range(-COUNTDOWN, TICKS + 1)]
    assert bench.controller("r1").stamps_ns == bench.controller("r2").stamps_ns == stamps
    paused = reached_ns[Pace.PAUSE][1]
    assert 40 <= paused <= 40 + LEAD_TICKS
    assert reached_ns[Pace.STEP][1] == paused + 10
    assert bench.ticks.count(paused) > 20
    assert set(bench.standstills) >= {paused + 1}
    slow_s = (TICKS - paused - 10) * bench.schedule.period_s / 0.5
    assert bench.clock.now_ns - began_ns > (3.0 + 0.9 * slow_s) * 1e9


def test_at_a_speed_tick_by_tick_in_its_time(benches) -> None:
    bench = benches("abort", speed=2.0)
    began_ns = bench.clock.now_ns
    bench.run()
    passed_s = (bench.clock.now_ns - began_ns) * 1e-9
    assert passed_s == pytest.approx(TICKS * bench.schedule.period_s / 2.0, rel=0.1)
    assert bench.loop.counters.overruns == 0


def test_what_a_run_waits_for_is_told_while_it_does(benches) -> None:
    bench = benches("abort")
    bench.stops("r2", 40)
    waited: set[tuple[str, ...]] = set()
    before = bench.hub.script

    def script() -> None:
        before()
        waited.add(tuple(bench.loop.waits_for()))

    bench.hub.script = script
    with pytest.raises(InfrastructureError):
        bench.run()
    assert waited == {(), ("r2",)}
