"""Orders of faults and what becomes of them, as the launcher keeps account."""

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import pytest

from bridge.network.fault_orders import FaultOrder
from bridge.network.orders import OrderAnswer
from configs.deployment import Deployment
from configs.errors import ScenarioError
from configs.faults.absences import Absence
from configs.loading import load
from configs.resolve import schedule
from configs.roles import processes_of
from fleetloop.launch.fault_desk import REACHED_S, FaultDesk
from fleetloop.launch.order_book import ANSWER_S, OrderBook

REALTIME = "clock.mode='realtime'"
VCAN = {"interface": "socketcan", "channel": "vcan0"}
CUT = {"kind": "link_partition", "edges": ["r1 -> r2", "leader -> r1"]}


class Bench:
    """A desk whose processes are the test."""

    def __init__(self, *overrides: str, real: tuple[str, ...] = ()) -> None:
        self.scenario = load("two_robots", ("duration_s=20.0", *overrides))
        self.tick, self.now_s = 1000, 0.0
        self.absent: set[str] = set()
        self.paused = False
        self.sent: list[tuple[str, FaultOrder]] = []
        self.answers: list[dict[str, Any]] = []
        self.book = OrderBook(
            schedule(self.scenario),
            self.is_absent,
            lambda: self.tick,
            lambda: self.now_s,
        )
        self.desk = FaultDesk(
            self.scenario,
            Deployment.model_validate(
                {"robot": {name: {"bus": VCAN} for name in real}}
            ).fault_problem,
            self.book,
            lambda: self.paused,
        )
        self.absences: list[tuple[str, str, int, int | None]] = []
        self.desk.on_absences = self._absences
        link = SimpleNamespace(subscribe=lambda *_: None, publisher=self._publisher)
        self.book.open(link, "run", processes_of(self.scenario.names))

    def is_absent(self, process: str) -> bool:
        by_faults = self.desk.ledger.absent(self.tick, self.book.schedule.ticks)
        return process in self.absent or process in by_faults

    def _absences(self, absent: Iterable[Absence]) -> None:
        self.absences = [one[:4] for one in absent]

    def _publisher(self, key: str) -> SimpleNamespace:
        process = key.partition("@order/")[2]
        return SimpleNamespace(put=lambda order: self._put(process, order))

    def _put(self, process: str, payload: bytes) -> None:
        order = FaultOrder.decode(payload)
        assert order is not None
        self.sent.append((process, order))

    def ask(self, request: str, **arguments: Any) -> None:
        self.desk.requests[request].act(self.answers.append, **arguments)

    def inject(self, **fault: Any) -> None:
        self.ask("fault.inject", fault=fault)

    def answer(self, process: str, tick: int, refusal: str = "") -> None:
        number = self.sent[-1][1].number
        assert self.book.take(process, OrderAnswer(number, tick, refusal).encode())
        self.desk.look()

    def faults(self) -> dict[str, tuple[str, int, int | None]]:
        self.ask("fault.list")
        rows = self.answers.pop()["faults"]
        return {row["name"]: (row["state"], row["from_tick"], row["to_tick"]) for row in rows}


def test_a_fault_is_ordered_of_the_plant_and_answered_when_the_run_has_reached_its_tick() -> None:
    bench = Bench()
    bench.inject(kind="push", robots=["r2"], for_s=0.5)
    ((process, order),) = bench.sent
    assert process == "plant"
    assert (order.name, order.targets, order.ticks, order.exact) == ("push", ("r2",), 250, False)
    bench.answer("plant", 1017)
    assert bench.answers == []
    bench.tick = 1017
    bench.desk.look()
    (answer,) = bench.answers
    assert answer["fault"]["from_tick"] == 1017
    assert answer["fault"]["state"] == "acting"
    assert bench.faults() == {"push": ("acting", 1017, 1267)}
    bench.tick = 1267
    assert bench.faults() == {"push": ("over", 1017, 1267)}


def test_an_order_that_ends_the_run_is_answered_all_the_same() -> None:
    bench = Bench()
    bench.inject(kind="process_kill", robots=["r2"])
    bench.answer("plant", 1017)
    assert bench.answers == []
    bench.tick = 1019
    bench.desk.end()
    (answer,) = bench.answers
    assert (answer["fault"]["state"], answer["fault"]["from_tick"]) == ("acting", 1017)


def test_in_lockstep_the_plant_answers_for_controllers() -> None:
    bench = Bench()
    bench.inject(**CUT, at_s=3.0)
    ((process, order),) = bench.sent
    assert (process, order.targets) == ("plant", ("r1 -> r2", "leader -> r1"))
    assert (order.from_tick, order.exact) == (1500, True)
    bench.answer("agent/r1", 1500)  # it may be absent, and isn't waited for
    assert bench.answers == []
    bench.answer("plant", 1500)
    assert bench.answers[0]["fault"]["state"] == "planned"


def test_in_real_time_every_controller_is_ordered_what_concerns_it_some_time_ahead() -> None:
    bench = Bench("clock.mode='realtime'")
    bench.inject(**CUT)
    assert {process: order.targets for process, order in bench.sent} == {
        "agent/r1": ("leader -> r1",),
        "agent/r2": ("r1 -> r2",),
    }
    assert {order.from_tick for _, order in bench.sent} == {1100}
    bench.answer("agent/r1", 1100)
    bench.answer("agent/r2", 1103)
    bench.tick = 1103
    bench.desk.look()
    fault = bench.answers[0]["fault"]
    assert (fault["from_tick"], fault["ticks"]) in (
        (1100, {"agent/r2": 1103}),
        (1103, {"agent/r1": 1100}),
    )


def test_in_real_time_who_is_absent_has_the_order_later() -> None:
    bench = Bench(REALTIME)
    bench.absent = {"agent/r1"}
    bench.inject(**CUT)
    assert [process for process, _ in bench.sent] == ["agent/r1", "agent/r2"]
    bench.answer("agent/r2", 1103)
    assert bench.faults() == {"link_partition": ("planned", 1103, None)}
    bench.absent.add("agent/r2")
    bench.ask("fault.clear", names=[])
    assert bench.faults() == {"link_partition": ("cleared", 1103, 1103)}


def test_a_refusal_of_a_process_is_the_answer_and_the_fault_is_none() -> None:
    bench = Bench()
    bench.inject(**CUT)
    bench.answer("plant", 0, "the run ends before")
    assert bench.answers == [{"error": "link_partition: not applied: plant: the run ends before"}]
    assert bench.faults() == {}


def test_what_is_not_answered_is_told_after_a_while() -> None:
    bench = Bench()
    bench.inject(kind="push")
    bench.now_s = ANSWER_S + 10.0
    bench.book.look()
    assert "plant: no answer" in bench.answers[0]["error"]
    assert bench.book.take("plant", OrderAnswer(1, 1017).encode())  # too late: nothing happens
    assert not bench.book.take("plant", b"\xc1")


def test_a_run_that_stands_still_is_not_waited_for() -> None:
    bench = Bench()
    bench.inject(kind="push")
    bench.answer("plant", 1017)
    bench.now_s = REACHED_S + 1.0
    bench.desk.look()
    assert bench.answers[0]["fault"]["state"] == "planned"


def test_all_that_acts_or_is_planned_is_cleared() -> None:
    bench = Bench('fault=[{kind="push", at_s=9.0}, {kind="drive_estop", at_s=1.0}]')
    bench.ask("fault.clear", names=[])
    ((process, order),) = bench.sent
    assert (process, order.ends, order.name) == ("plant", True, "push")
    bench.tick = 1017
    bench.answer("plant", 1017)
    assert [one["name"] for one in bench.answers[0]["cleared"]] == ["push"]
    assert bench.faults() == {"push": ("cleared", 4500, 4500), "drive_estop": ("over", 500, None)}
    bench.ask("fault.clear", names=[])
    assert bench.answers[-1] == {"cleared": []}
    for name, why in (
        ("drive_estop", "happened at an instant, at tick 500"),
        ("push", "was cleared already"),
        ("shove", "no such fault in this run; there are: push, drive_estop"),
    ):
        with pytest.raises(ScenarioError, match=why):
            bench.ask("fault.clear", names=[name])


def test_a_controller_that_is_there_again_is_told_what_the_scenario_does_not_say() -> None:
    listed = 'fault=[{kind="link_delay", at_s=1.0, edges=["r1 -> r2"]}]'
    bench = Bench("clock.mode='realtime'", listed)
    bench.inject(kind="link_loss", edges=["r1 -> r2"], for_s=1.0, name="lossy")
    bench.answer("agent/r2", 1100)
    bench.inject(kind="push")
    bench.answer("plant", 1100)
    bench.ask("fault.clear", names=["link_delay"])
    bench.answer("agent/r2", 1100)
    bench.sent.clear()
    bench.tick = 1200
    for process in ("plant", "recorder", "agent/r1"):
        bench.desk.repeat(process)
    assert bench.sent == []
    bench.desk.repeat("agent/r2")
    told = [(process, it.name, it.ends, it.from_tick, it.ticks) for process, it in bench.sent]
    assert told == [
        ("agent/r2", "lossy", False, 1200, 400),
        ("agent/r2", "link_delay", True, 1200, None),
    ]


def test_no_order_is_taken_that_no_process_could_carry_out() -> None:
    bench = Bench(real=("r2",))
    with pytest.raises(ScenarioError, match="r2: isn't emulated: push can't act on it"):
        bench.inject(kind="push")
    bench.inject(kind="push", robots=["r1"])
    assert [process for process, _ in bench.sent] == ["plant"]


def test_two_faults_have_two_names_though_the_first_is_not_answered_yet() -> None:
    bench = Bench()
    bench.inject(kind="push")
    bench.inject(kind="push")
    assert [order.name for _, order in bench.sent] == ["push", "push_2"]
    with pytest.raises(ScenarioError, match="another fault of this run has this name"):
        bench.inject(kind="push", name="push_2")


def test_in_lockstep_the_plant_answers_for_the_controllers_that_are_killed() -> None:
    bench = Bench("clock.on_late='drop'")
    bench.inject(kind="process_kill")
    ((process, order),) = bench.sent
    assert (process, order.targets) == ("plant", ("r1", "r2"))
    bench.answer("plant", 1017)
    bench.tick = 1017
    bench.ask("fault.clear", names=["process_kill"])
    assert [process for process, _ in bench.sent] == ["plant", "plant"]
    assert {it[2:] for it in bench.absences} == {(1017, None)}
    bench.answer("plant", 1040)
    assert bench.absences == [("process_kill", robot, 1017, 1040) for robot in ("r1", "r2")]
    planned = [one for one in bench.desk.ledger.planned() if one.target == "r2"]
    assert [(one.from_tick, one.to_tick) for one in planned] == [(1017, 1040)]


def test_in_real_time_the_launcher_ends_the_absence_of_who_does_not_answer() -> None:
    bench = Bench(REALTIME)
    bench.inject(kind="process_freeze", name="nap", for_s=5.0)
    assert [process for process, _ in bench.sent] == ["agent/r1", "agent/r2"]
    bench.answer("agent/r1", 1100)
    bench.answer("agent/r2", 1103)
    assert bench.absences == [("nap", "r1", 1100, 3600), ("nap", "r2", 1103, 3600)]
    bench.sent.clear()
    bench.tick = 1200
    bench.ask("fault.clear", names=["nap"])
    # They are told all the same: they note the end once they are awake.
    assert [(process, it.ends, it.from_tick) for process, it in bench.sent] == [
        *(("agent/r1", True, 1300), ("agent/r2", True, 1300))
    ]
    assert bench.absences == [("nap", "r1", 1100, 1300), ("nap", "r2", 1103, 1300)]
    bench.tick = 1300
    bench.desk.look()
    assert bench.answers[-1]["cleared"][0]["state"] == "cleared"


def test_what_slows_a_process_is_ended_by_it() -> None:
    bench = Bench(REALTIME)
    bench.inject(kind="process_slow", robots=["r1"])
    bench.answer("agent/r1", 1100)
    bench.tick = 1200
    bench.ask("fault.clear", names=["process_slow"])
    assert bench.sent[-1][1].ends
    assert bench.faults()["process_slow"] == ("acting", 1100, None)
    bench.answer("agent/r1", 1300)
    assert bench.faults()["process_slow"] == ("acting", 1100, 1300)
    assert bench.absences == []


def test_no_fault_of_a_process_is_ordered_of_one_that_is_absent() -> None:
    bench = Bench(REALTIME)
    bench.absent = {"agent/r2"}
    with pytest.raises(ScenarioError, match="r2: its controller is absent: process_slow can't act"):
        bench.inject(kind="process_slow")
    bench.inject(kind="process_slow", robots=["r1"])


def test_one_that_was_killed_is_absent_before_it_is_seen_to_have_ended() -> None:
    bench = Bench(REALTIME)
    bench.inject(kind="process_kill", robots=["r2"])
    bench.answer("agent/r2", 1100)
    bench.tick = 1100
    bench.desk.look()
    with pytest.raises(ScenarioError, match="r2: its controller is absent: process_slow can't act"):
        bench.inject(kind="process_slow", robots=["r2"])
    # What concerns its links is told to it when it is started again, and awaited of nobody.
    bench.inject(kind="link_loss", edges=["r1 -> r2"], probability=0.5)
    bench.tick = 1200
    bench.desk.look()
    assert bench.answers[-1]["fault"]["name"] == "link_loss"


def test_where_none_could_come_again_none_is_ordered_to_or_started() -> None:
    bench = Bench()
    with pytest.raises(
        ScenarioError, match=r"\"process_kill\": ends a lockstep run: needs clock\."
    ):
        bench.inject(kind="process_kill", for_s=1.0)
    odometry = "localisation.source='odometry'"
    bench = Bench(REALTIME, odometry)
    with pytest.raises(ScenarioError, match="odometry alone doesn't know where the robot is"):
        bench.inject(kind="process_restart")
    bench.inject(kind="process_kill", robots=["r1"])
    bench.answer("agent/r1", 1100)
    bench.inject(kind="process_freeze", robots=["r2"])
    bench.answer("agent/r2", 1100)
    bench.tick = 1100
    with pytest.raises(ScenarioError, match="process_kill: odometry alone doesn't know"):
        bench.ask("fault.clear", names=["process_kill"])
    bench.ask("fault.clear", names=[])
    assert bench.absences == [
        ("process_kill", "r1", 1100, None),
        ("process_freeze", "r2", 1100, 1200),
    ]
