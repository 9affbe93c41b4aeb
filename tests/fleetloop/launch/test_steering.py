"""The desk of a run's pace and leader: what is ordered, answered and refused."""

from itertools import count
from types import SimpleNamespace
from typing import Any

import pytest

from bridge.network.fault_orders import FaultAnswer
from bridge.network.orders import order_of
from bridge.network.run_orders import LeaderOrder, Pace, PaceOrder
from configs.errors import ScenarioError
from configs.leader_speed import SpeedChange
from configs.loading import load
from configs.ordered_speed import with_step
from configs.resolve import leader_brief, schedule
from configs.roles import processes_of
from fleetloop.launch.fault_desk import ANSWER_S
from fleetloop.launch.steering import STEPS_S, Steering

REALTIME = ("clock.mode='realtime'",)
STEPS = "leader={speed_m_s=0.6, steps=[{t_s=5.0, speed_m_s=0.2, ramp_s=2.0}]}"


class Bench:
    """A desk whose processes are the test."""

    def __init__(self, scenario: str = "two_robots", *overrides: str) -> None:
        self.scenario = load(scenario, ("duration_s=20.0", *overrides))
        self.schedule = schedule(self.scenario)
        self.tick, self.now_s = 1000, 0.0
        self.absent: set[str] = set()
        self.sent: list[tuple[str, Any]] = []
        self.answers: list[dict[str, Any]] = []
        self.noted: list[tuple[str, str, int]] = []
        self.profiles: list[tuple[SpeedChange, ...]] = []
        self.desk = Steering(
            self.scenario,
            self.schedule,
            0.0,
            count(1),
            lambda process: process in self.absent,
            lambda: self.tick,
            lambda: self.now_s,
            lambda *event: self.noted.append(event),
        )
        self.desk.on_leader = lambda: self.profiles.append(self.desk.changes)
        link = SimpleNamespace(publisher=self._publisher)
        self.desk.open(link, "run", processes_of(self.scenario.names))

    def _publisher(self, key: str) -> SimpleNamespace:
        process = key.partition("@order/")[2]
        return SimpleNamespace(put=lambda put: self.sent.append((process, order_of(put))))

    def ask(self, request: str, **arguments: Any) -> None:
        self.desk.requests[request].act(self.answers.append, **arguments)

    def answer(self, process: str, tick: int, refusal: str = "") -> None:
        number = self.sent[-1][1].number
        assert self.desk.take(process, FaultAnswer(number, tick, refusal).encode())

    def lead(self, speed_m_s: float, ramp_s: float, tick: int) -> dict[str, Any]:
        self.ask("run.leader_speed", speed_m_s=speed_m_s, ramp_s=ramp_s)
        for robot in self.scenario.names:
            self.answer(f"agent/{robot}", tick)
        return self.answers[-1]


def test_pace_is_ordered_of_the_plant_and_its_answer_is_the_state() -> None:
    bench = Bench()
    for request, arguments, order in (
        ("run.pause", {}, PaceOrder(1, Pace.PAUSE)),
        ("run.step", {"ticks": 5}, PaceOrder(2, Pace.STEP, 5.0)),
        ("run.speed", {"factor": 0.5}, PaceOrder(3, Pace.SPEED, 0.5)),
        ("run.resume", {}, PaceOrder(4, Pace.RESUME)),
    ):
        bench.ask(request, **arguments)
        assert bench.sent[-1] == ("plant", order)
        assert len(bench.answers) == order.number - 1  # not before it acts
        bench.answer("plant", 1000 + order.number)
        assert bench.answers[-1]["tick"] == 1000 + order.number
        assert bench.desk.paused is (request != "run.resume")
    assert bench.desk.speed == 0.5


def test_what_the_plant_refuses_or_leaves_open_is_told() -> None:
    bench = Bench()
    bench.ask("run.step", ticks=5)
    bench.answer("plant", 0, "the run isn't paused")
    assert bench.answers == [{"error": "run.step: plant: the run isn't paused"}]
    bench.ask("run.pause")
    bench.now_s = ANSWER_S + bench.schedule.tick_deadline_s + 0.1
    bench.desk.look()
    assert "no answer in time" in bench.answers[-1]["error"]
    assert not bench.desk.paused
    bench.ask("run.step", ticks=5)
    bench.now_s += STEPS_S - 1.0
    bench.desk.look()
    assert len(bench.answers) == 2


@pytest.mark.parametrize(
    ("request_", "arguments", "why"),
    [
        ("run.step", {"ticks": 0}, "ticks = 0: must be 1 to"),
        ("run.step", {"ticks": -1}, "ticks = -1: must be 1 to"),
        ("run.speed", {"factor": -1.0}, "factor = -1: must be 1e-06 to 1e"),
        ("run.leader_speed", {"speed_m_s": 0.1, "ramp_s": -2.0}, "ramp_s = -2.0: must be 0 or m"),
    ],
)
def test_values_out_of_bounds_are_refused_and_ordered_of_nobody(
    request_: str, arguments: dict[str, Any], why: str
) -> None:
    bench = Bench()
    with pytest.raises(ScenarioError) as refusal:
        bench.ask(request_, **arguments)
    assert why in str(refusal.value)
    assert bench.sent == []


def test_in_real_time_there_is_no_pace_and_each_controller_is_told_of_the_leader() -> None:
    bench = Bench("two_robots_100hz", *REALTIME)
    for request, arguments in (("run.pause", {}), ("run.speed", {"factor": 2.0})):
        with pytest.raises(ScenarioError, match="keeps real time, whose pace nobody sets"):
            bench.ask(request, **arguments)
    bench.ask("run.leader_speed", speed_m_s=0.3, ramp_s=0.0)
    assert {process for process, _ in bench.sent} == {"agent/r1", "agent/r2"}
    assert bench.sent[0][1].from_tick == 1000 + 20  # 0.2 s
    bench.answer("agent/r1", 1020)
    bench.answer("agent/r2", 1021)
    said = bench.answers[-1]
    assert (said["tick"], said["late"]) in ((1020, {"agent/r2": 1021}), (1021, {"agent/r1": 1020}))


def test_a_speed_of_the_leader_is_a_step_of_the_scenario_from_then_on() -> None:
    bench = Bench("two_robots", STEPS)
    said = bench.lead(0.9, 1.0, 1010)
    process, order = bench.sent[-1]
    assert process == "plant"
    assert isinstance(order, LeaderOrder)
    listed = with_step(bench.scenario, said["t_s"], 0.9, 1.0)
    assert order.reach == listed.reach != bench.scenario.reach
    assert bench.desk.steered == listed
    assert bench.profiles[-1] == leader_brief(listed).speed_changes
    assert bench.noted == [("leader_speed", "0.9 m/s along a ramp of 1 s, ordered", 1010)]
    bench.ask("run.leader")
    assert bench.answers[-1]["leader"]["steps"] == [
        {"t_s": said["t_s"], "speed_m_s": 0.9, "ramp_s": 1.0},
        {"t_s": 5.0, "speed_m_s": 0.2, "ramp_s": 2.0},
    ]


def test_a_ramp_within_another_is_refused_in_the_words_of_the_section() -> None:
    bench = Bench("two_robots", STEPS)
    with pytest.raises(ScenarioError, match="begins within the ramp before it, from 2"):
        bench.ask("run.leader_speed", speed_m_s=0.1, ramp_s=10.0)
    bench.tick = 2700  # t = 5.4 s, within the scenario's
    with pytest.raises(ScenarioError, match="begins within the ramp before it, from 5 s to 7 s"):
        bench.ask("run.leader_speed", speed_m_s=0.1, ramp_s=0.0)


def test_an_order_that_has_not_begun_gives_way_to_the_next() -> None:
    bench = Bench()
    bench.lead(0.3, 1.0, 1010)
    bench.lead(0.2, 1.0, 1010)
    assert [one.speed_m_s for one in bench.desk.changes] == [0.6, 0.2]


def test_absent_controllers_are_not_waited_for_and_refusals_are_told() -> None:
    bench = Bench()
    bench.absent.add("agent/r2")
    bench.ask("run.leader_speed", speed_m_s=0.3, ramp_s=0.0)
    bench.answer("agent/r1", 0, "v_r changes at 5 s, within its ramp")
    assert bench.answers == [
        {"error": "run.leader_speed: agent/r1: v_r changes at 5 s, within its ramp"}
    ]
    assert bench.desk.steered is None


def test_answers_to_others_are_left_to_them() -> None:
    bench = Bench()
    bench.ask("run.pause")
    assert not bench.desk.take("plant", FaultAnswer(99, 5).encode())
    assert not bench.desk.take("plant", b"?")
