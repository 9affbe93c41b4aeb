"""Orders until they are answered, on those of the leader's speed."""

from types import SimpleNamespace
from typing import Any

import pytest

from bridge.network.orders import OrderAnswer
from bridge.network.run_orders import LeaderOrder
from configs.errors import ScenarioError
from configs.loading import load
from configs.resolve import schedule
from configs.roles import processes_of
from fleetloop.launch.order_book import ANSWER_S, OrderBook
from fleetloop.launch.steering import Steering

REALTIME = "clock.mode='realtime'"
R1, R2 = "agent/r1", "agent/r2"


class Bench:
    """Steering whose processes are the test."""

    def __init__(self, *overrides: str) -> None:
        scenario = load("two_robots", ("duration_s=20.0", *overrides))
        self.now_s = 0.0
        self.absent: set[str] = set()
        self.sent: list[tuple[str, LeaderOrder]] = []
        self.answers: list[dict[str, Any]] = []
        self.events: list[tuple[str, str, int]] = []
        self.book = OrderBook(
            schedule(scenario), self.absent.__contains__, lambda: 1000, lambda: self.now_s
        )
        self.steering = Steering(scenario, 0.0, self.book, lambda *it: self.events.append(it))
        link = SimpleNamespace(subscribe=lambda *_: None, publisher=self._publisher)
        self.book.open(link, "run", processes_of(scenario.names))

    def _publisher(self, key: str) -> SimpleNamespace:
        process = key.partition("@order/")[2]
        return SimpleNamespace(put=lambda payload: self._put(process, payload))

    def _put(self, process: str, payload: bytes) -> None:
        order = LeaderOrder.decode(payload)
        assert order is not None
        self.sent.append((process, order))

    def order(self, speed_m_s: float = 0.3) -> None:
        request = self.steering.requests["run.leader_speed"]
        request.act(self.answers.append, speed_m_s=speed_m_s, ramp_s=0.0)

    def answer(self, process: str, tick: int, refusal: str = "") -> None:
        number = self.sent[-1][1].number
        assert self.book.take(process, OrderAnswer(number, tick, refusal).encode())

    @property
    def told(self) -> list[str]:
        return [process for process, _ in self.sent]

    def step(self) -> tuple[float, float]:
        last = self.steering.scenario.leader.steps[-1]
        return last.t_s, last.speed_m_s


def test_in_lockstep_the_plant_is_told_and_all_controllers_answer() -> None:
    bench = Bench()
    bench.order()
    assert bench.told == ["plant"]
    bench.answer(R1, 1005)
    assert bench.answers == []
    bench.answer(R2, 1005)
    said = {"tick": 1005, "t_s": 2.01, "speed_m_s": 0.3, "ramp_s": 0.0}
    assert bench.answers == [said]
    assert bench.step() == (2.01, 0.3)
    assert bench.events == [("leader_speed", "0.3 m/s, ordered", 1005)]


def test_in_lockstep_the_plant_refuses_for_all() -> None:
    bench = Bench()
    bench.order()
    bench.answer("plant", 0, "the run ends before")
    assert bench.answers == [{"error": "run.leader_speed: plant: the run ends before"}]
    assert bench.steering.steered is None


def test_a_controller_that_is_killed_before_it_answers_is_not_waited_for() -> None:
    bench = Bench()
    bench.order()
    bench.answer(R1, 1005)
    bench.absent.add(R2)
    bench.book.look()
    (said,) = bench.answers
    assert said["tick"] == 1005
    assert said["refused"].keys() == {R2}
    assert bench.step() == (2.01, 0.3), "as a new process of it is told"


def test_in_real_time_a_controller_that_is_frozen_has_the_order_once_it_is_awake() -> None:
    bench = Bench(REALTIME)
    bench.absent.add(R1)
    bench.order()
    assert bench.told == [R1, R2]
    bench.answer(R2, 1100)
    assert bench.answers[0]["tick"] == 1100


def test_a_controller_that_is_started_again_is_told_again_what_it_has_not_answered() -> None:
    bench = Bench(REALTIME)
    bench.order()
    bench.answer(R1, 1100)
    bench.sent.clear()
    bench.book.repeat(R1)
    assert bench.told == []
    bench.book.repeat(R2)
    assert bench.told == [R2]
    bench.answer(R2, 1180)
    (said,) = bench.answers
    assert {said["tick"], *said["late"].values()} == {1100, 1180}
    bench.book.repeat(R2)
    assert bench.told == [R2]


def test_a_controller_that_was_absent_at_an_order_is_told_when_it_is_there() -> None:
    bench = Bench(REALTIME)
    bench.absent.add(R1)
    bench.order()
    bench.sent.clear()
    bench.book.repeat(R1)  # it is there before the others have answered
    assert bench.told == [R1]
    bench.answer(R2, 1100)
    bench.sent.clear()
    bench.book.repeat(R1)  # or afterwards
    bench.steering.repeat(R1)
    ((process, order),) = bench.sent
    assert (process, order.from_tick, order.speed_m_s) == (R1, 1100, 0.3)
    bench.steering.repeat("plant")
    assert len(bench.sent) == 1


def test_what_nobody_answers_is_refused_after_a_while() -> None:
    bench = Bench()
    bench.order()
    bench.now_s = ANSWER_S + 10.0
    bench.book.look()
    why = "no answer in time; whether it acts there is not known"
    assert bench.answers == [{"error": f"run.leader_speed: {R1}, {R2}: {why}"}]
    assert bench.book.take(R1, OrderAnswer(1, 1005).encode())  # too late: nothing happens
    assert not bench.book.take(R1, b"\xc1")
    assert bench.steering.steered is None


def test_where_all_controllers_are_absent_none_is_ordered_anything() -> None:
    bench = Bench(REALTIME)
    bench.absent |= {R1, R2}
    with pytest.raises(ScenarioError, match="no controller is there"):
        bench.order()
    assert bench.sent == []
