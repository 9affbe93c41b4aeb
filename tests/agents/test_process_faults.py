"""A controller's process that kills, freezes or slows itself at the tick of its fault."""

import pytest
from support.clocks import ManualClock
from support.robot_bench import NOWHERE

from agents.process_faults import ProcessFaults
from configs.edges import FOREVER
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
