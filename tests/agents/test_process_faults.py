"""A controller's process that kills, freezes or slows itself at the tick of its fault."""

import pytest
from support.clocks import ManualClock
from support.robot_bench import NOWHERE

from agents.process_faults import ProcessFaults
from bridge.network.fault_orders import FaultOrder
from configs.edges import FOREVER
from configs.faults.kinds import KINDS
from configs.loading import load
from configs.resolve import agent_brief


class Bench:
    """The faults of r2's process, and all that it does because of them, in order."""

    def __init__(self, *faults: str, realtime: bool = True) -> None:
        mode = "clock.mode='realtime'" if realtime else "clock.on_late='drop'"
        scenario = load("two_robots", (f"fault=[{', '.join(faults)}]", mode))
        self.clock = ManualClock()
        self.done: list[object] = []
        self.faults = ProcessFaults(
            agent_brief(scenario, "r2", network=NOWHERE, bus=()),
            lambda tick, kind, text: self.done.append((tick, kind, text)),
            kill=lambda: self.done.append("killed"),
            freeze=lambda: self.done.append("frozen"),
            clock=self.clock,
        )
        self.faults.hand_on = lambda it: self.done.append(("hands on", it.to_tick is not None))
        self.faults.heard = lambda: self.done.append("heard")
        self.faults.last_word = lambda: self.done.append("last word")

    def ticks(self, first: int, last: int) -> None:
        """As a loop does."""
        for tick in range(first, last + 1):
            if tick >= self.faults.due_tick:
                self.faults.begin(tick)


def test_a_killed_process_says_its_last_before() -> None:
    bench = Bench('{kind="process_kill", at_s=1.0, robots=["r2"]}')
    bench.ticks(0, 499)
    assert bench.done == []
    bench.ticks(500, 500)
    assert bench.done == [
        (500, "fault_applied", "process_kill"),
        ("hands on", False),
        (500, "killed", "by fault process_kill"),
        *("heard", "last word", "killed"),
    ]


@pytest.mark.parametrize(
    ("fault", "returns"),
    [
        ('{kind="process_kill", at_s=1.0, for_s=1.0}', True),
        ('{kind="process_kill", at_s=1.0, for_s=9.0}', False),
        ('{kind="process_restart", at_s=1.0}', True),
        ('{kind="process_kill", at_s=1.0}', False),
    ],
)
def test_rows_end_with_a_process_unless_another_will_have_more(fault: str, returns: bool) -> None:
    bench = Bench(fault)
    bench.ticks(500, 500)
    assert bench.done[1] == ("hands on", returns)
    assert bench.done[-1] == "killed"


def test_a_frozen_process_goes_on_from_where_it_was() -> None:
    bench = Bench('{kind="process_freeze", at_s=1.0, for_s=0.1, name="nap"}')
    bench.ticks(500, 549)
    assert bench.faults.mute_tick == 550
    bench.ticks(550, 700)
    assert bench.done == [
        (500, "fault_applied", "nap (process_freeze)"),
        ("hands on", True),
        (500, "frozen", "by fault nap"),
        *("heard", "frozen"),
        (550, "fault_cleared", "nap (process_freeze)"),
    ]
    assert bench.faults.mute_tick == -FOREVER
    assert Bench().faults.mute_tick == -FOREVER


def test_a_slow_process_takes_longer_at_each_tick_of_the_fault() -> None:
    bench = Bench(
        '{kind="process_slow", at_s=1.0, for_s=0.02, extra_s=0.25}',
        '{kind="process_slow", at_s=1.01, for_s=0.01, extra_s=0.5}',
    )
    bench.ticks(0, 499)
    assert bench.clock.monotonic_s() == 0.0
    bench.ticks(500, 504)
    assert bench.clock.monotonic_s() == pytest.approx(5 * 0.25)
    bench.ticks(505, 600)
    assert bench.clock.monotonic_s() == pytest.approx(10 * 0.25 + 5 * 0.5)
    assert bench.faults.due_tick == FOREVER
    ticks = [done[0] for done in bench.done if isinstance(done, tuple)]
    assert ticks == [500, 505, 510, 510]


def test_faults_of_others_and_of_the_process_before_do_nothing() -> None:
    bench = Bench(
        '{kind="process_kill", at_s=0.5, robots=["r1"]}',
        '{kind="process_kill", at_s=0.8, for_s=0.2, robots=["r2"]}',
        '{kind="process_slow", at_s=0.8, extra_s=0.25, robots=["r2"]}',
        '{kind="process_restart", at_s=1.2, robots=["r2"]}',
    )
    bench.faults.skip_to(500)
    bench.ticks(500, 599)
    assert bench.done == [(500, "fault_cleared", "process_kill_2 (process_kill)")]
    assert bench.clock.monotonic_s() == pytest.approx(100 * 0.25)
    bench.ticks(600, 600)
    assert bench.done[-1] == "killed"


def ordered(kind: str, *, ends: bool = False, at: int = 0, lasts: int | None = None) -> FaultOrder:
    fault = KINDS[kind](kind=kind, at_s=0.0)
    return FaultOrder(1, ends, kind, ("r2",), fault, at, lasts, at > 0)


def test_an_order_acts_at_the_next_tick_at_the_earliest() -> None:
    bench = Bench()
    assert bench.faults.take(ordered("process_kill"), 100) == 101
    bench.ticks(100, 100)
    assert bench.done == []
    bench.ticks(101, 101)
    assert bench.done[-1] == "killed"


@pytest.mark.parametrize(
    ("order", "why"),
    [
        (ordered("process_kill", at=100), "tick 100 has gone: tick 101 is the next"),
        (ordered("process_restart", at=5000), "the run ends before: it has 2000 ticks"),
        (ordered("process_freeze", at=490, lasts=20), "the process of r2 is absent from 0.98 s"),
        (ordered("process_kill", at=520), "the process of r2 is absent from 1 s on"),
    ],
)
def test_an_order_that_cannot_act_is_refused(order: FaultOrder, why: str) -> None:
    bench = Bench('{kind="process_freeze", at_s=1.0, for_s=0.1}')
    assert str(bench.faults.take(order, 100)).startswith(why)
    bench.ticks(100, 499)
    assert bench.done == []


def test_slow_and_frozen_processes_are_let_go_by_order() -> None:
    bench = Bench()
    bench.faults.take(ordered("process_slow"), 100)
    bench.faults.take(ordered("process_freeze", at=120), 100)
    bench.ticks(100, 120)
    assert bench.faults.mute_tick == FOREVER
    assert bench.faults.take(ordered("process_slow", ends=True), 120) == 121
    assert bench.faults.take(ordered("process_freeze", ends=True, at=150), 120) == 150
    assert bench.faults.mute_tick == 150
    bench.ticks(121, 160)
    assert bench.clock.monotonic_s() == pytest.approx(20 * 0.002)
    ticks = [(it[0], it[1]) for it in bench.done if isinstance(it, tuple) and it[0] in (121, 150)]
    assert ticks == [(121, "fault_cleared"), (150, "fault_cleared")]
