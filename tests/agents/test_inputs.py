"""A controller's input log, fed to another one, gives the same rows and frames bit for bit."""

from collections.abc import Callable
from math import nan

import pytest
from support.robot_bench import Bench

from agents.agent import Trouble
from agents.guard import Phase
from agents.inputs import feed
from bridge.frame import Frame
from bridge.network.fault_orders import FaultOrder
from bridge.network.inputs import Input, InputBuffer, Kind, entries
from bridge.network.messages import LeaderSpeed, PathState, PoseFix
from bridge.network.run_orders import LeaderOrder
from configs.faults.messages import LinkPartition
from configs.leader_speed import SpeedChange


class Logged:
    """A bench whose controller is logged, and a second one that is told what the log says."""

    def __init__(self, *overrides: str, **changes) -> None:
        self._blocks: list[bytes] = []
        self._log = InputBuffer(lambda _first, block, _final: self._blocks.append(block))
        self._made = (overrides, changes)
        self.bench = Bench("r2", *overrides, log=self._log, **changes)
        self.frames: list[list[Frame]] = []

    def tick(self) -> None:
        self.frames.append(self.bench.tick())

    def drive(self, ticks: int) -> None:
        for _ in range(self.bench.schedule.countdown_ticks + ticks):
            self.tick()
        assert self.bench.phase is Phase.DRIVING, self.bench.why

    def hear(self, s: float) -> None:
        tick, period_ns = self.bench.tick_now, self.bench.schedule.period_ns
        tick -= tick % self.bench.schedule.share_every
        self.bench.agent.receive_path_state("r1", PathState(tick, tick * period_ns, s, 0.5))

    def entries(self) -> list[Input]:
        self._log.finish()
        return list(entries(b"".join(self._blocks)))

    def assert_repeated(self) -> None:
        """The fed controller says what the logged one said."""
        overrides, changes = self._made
        other = Bench("r2", *overrides, **changes)
        log = self.entries()
        answers = [(entry, list(feed(other.agent, entry))) for entry in log]
        ends = (Kind.TICK, Kind.STOP)
        assert [sent for entry, sent in answers if entry.kind in ends] == self.frames
        assert [entry.sent() for entry in log if entry.kind in ends] == self.frames
        for bench in (self.bench, other):
            bench.agent.rows.finish()
        assert repr(other.rows) == repr(self.bench.rows)  # NaN included
        assert other.phase is self.bench.phase
        assert other.why == self.bench.why


def test_in_lockstep_with_neighbour_leader_and_a_fault_in_between() -> None:
    logged = Logged("host.rearm=true", "graph.leader=['r1','r2']")
    logged.bench.agent.receive_leader_speed(LeaderSpeed((SpeedChange(0, 0.5),)))
    logged.drive(1)
    for n in range(600):
        if n % 20 == 0:
            logged.hear(0.3 + 0.01 * n)
        if n == 50:
            logged.bench.reboot(0)
        logged.tick()
    assert any(event.kind == "stopped" for event in logged.bench.agent.guard.events)
    assert len(logged.bench.rows) > 100
    logged.assert_repeated()


REALTIME = "clock.mode='realtime'", "host.rearm=true"


def bus_fails(logged: Logged) -> None:
    logged.bench.agent.note_trouble(Trouble.BUS, "bus error: network is down")


def launcher_goes(logged: Logged) -> None:
    logged.bench.agent.note_trouble(Trouble.LAUNCHER, "cut off")


def machine_stalls(logged: Logged) -> None:
    logged.bench.agent.note_trouble(Trouble.MACHINE, "stalled for 0.3 s")
    logged.bench.silent.add(1)


def frames_not_sent(logged: Logged) -> None:
    logged.bench.silent.add(0)
    for _ in range(60):
        logged.tick()
    assert logged.bench.phase is Phase.STOPPED
    logged.bench.silent.clear()
    while logged.bench.phase is not Phase.REARMING:
        logged.tick()
    logged.bench.agent.note_unsent(logged.bench.tick_now)
    assert logged.bench.phase is Phase.STOPPED


def run_ends(logged: Logged) -> None:
    logged.bench.agent.end_at(logged.bench.tick_now + 3)


@pytest.mark.parametrize(
    "happens", [bus_fails, launcher_goes, machine_stalls, frames_not_sent, run_ends]
)
def test_in_real_time_with_all_that_its_loop_notes(happens: Callable[[Logged], None]) -> None:
    logged = Logged(*REALTIME)
    period_ns = logged.bench.schedule.period_ns

    def ticks(count: int) -> None:
        for n in range(count):
            tick = logged.bench.tick_now
            late_s = 1e-7 * (n % 13)
            now_ns = tick * period_ns + 500
            logged.bench.agent.keep_time(now_ns, late_s, nan if n % 7 == 0 else 3e-4 + late_s)
            if n % 20 == 3:
                logged.hear(0.001 * n)
            logged.tick()

    logged.drive(1)
    ticks(40)
    happens(logged)
    ticks(80)
    assert logged.bench.phase is not Phase.DRIVING
    logged.assert_repeated()


def test_a_stop_before_the_end_is_an_input_too() -> None:
    logged = Logged()
    logged.drive(30)
    logged.frames.append(list(logged.bench.agent.shut_down()))
    logged.assert_repeated()
    assert logged.bench.phase is Phase.DONE


def test_a_controller_that_was_started_again_says_so_first() -> None:
    logged = Logged(*REALTIME, "host.restarts=1", rejoins=True)
    first, *_ = logged.entries()
    assert (first.kind, first.begin()) == (Kind.BEGIN, (True, 0))


def test_start_messages_that_say_the_same_again_are_logged_once() -> None:
    logged = Logged()
    fix = PoseFix(-1, 0, 1.9, 0.1, 1.5)
    for _ in range(5):
        logged.bench.agent.receive_pose(fix)
    kinds = [entry.kind for entry in logged.entries()]
    assert kinds.count(Kind.POSE) == 2  # the bench's own, then this one


def test_a_fault_that_was_ordered_is_repeated_at_its_tick_and_one_that_was_refused_is_not() -> None:
    logged = Logged("graph.leader=['r1','r2']")
    logged.bench.agent.receive_leader_speed(LeaderSpeed((SpeedChange(0, 0.5),)))
    logged.drive(1)
    cut = LinkPartition(kind="link_partition", at_s=0.0)
    for n in range(300):
        if n % 20 == 0:
            logged.hear(0.3 + 0.01 * n)
        if n == 50:
            order = FaultOrder(1, False, "cut", ("r1 -> r2",), cut, 0, 100, False)
            began = logged.bench.agent.take_order(order, logged.bench.tick_now)
            assert began == logged.bench.tick_now
            assert "nothing here" in logged.bench.agent.take_order(
                order._replace(targets=("r2 -> r1",)), logged.bench.tick_now
            )
        logged.tick()
    changes = [it for it in logged.bench.agent.guard.events if it.kind.startswith("fault")]
    assert [(it.tick - began, it.kind) for it in changes] == [
        *((0, "fault_applied"), (100, "fault_cleared"))
    ]
    assert [it.kind for it in logged.entries()].count(Kind.ORDER) == 1
    logged.assert_repeated()


def test_an_ordered_speed_of_the_leader_is_repeated_and_what_was_refused_is_not() -> None:
    logged = Logged("graph.leader=['r1','r2']")
    agent = logged.bench.agent
    agent.receive_leader_speed(LeaderSpeed((SpeedChange(0, 0.5),)))
    logged.drive(1)
    reach = agent.brief.reach
    for n in range(200):
        if n % 20 == 0:
            logged.hear(0.3 + 0.01 * n)
        if n == 50:
            order = LeaderOrder(1, 0, False, 0.1, 0, reach)
            began = agent.take_leader_order(order, logged.bench.tick_now)
            assert began == logged.bench.tick_now
        if n == 60:
            gone = LeaderOrder(2, 5, True, 0.9, 0, reach)
            assert "tick 5 has gone" in agent.take_leader_order(gone, logged.bench.tick_now)
        logged.tick()
    assert [it.kind for it in logged.entries()].count(Kind.LEADER_ORDER) == 1
    logged.assert_repeated()


def test_an_order_of_the_leaders_speed_that_is_repeated_only_brings_its_reach() -> None:
    bench = Bench("r1")
    bench.agent.receive_leader_speed(LeaderSpeed((SpeedChange(0, 0.5),)))
    bench.drive(1)
    fast = bench.agent.brief.reach._replace(v_max_m_s=3.0)
    order = LeaderOrder(1, bench.tick_now + 3, False, 0.1, 10**9, bench.agent.brief.reach)
    acts = bench.agent.take_leader_order(order, bench.tick_now)
    assert acts == order.from_tick
    known = bench.agent._reception.leader
    bench.drive(10)
    again = order._replace(number=0, reach=fast)
    assert bench.agent.take_leader_order(again, bench.tick_now) == acts
    assert bench.agent._reception.leader == known
    assert bench.agent.admission.reach == fast


def test_with_an_ordered_speed_neighbours_are_believed_what_they_say_then() -> None:
    bench = Bench("r2")
    every, period_ns = bench.schedule.share_every, bench.schedule.period_ns
    bench.drive(every // 2)

    def believed(tick: int) -> bool:
        said = PathState(tick, tick * period_ns, 0.5, 5.0)
        return bench.agent.admission.admits_path_state("r1", said)

    assert not believed(every)
    fast = bench.agent.brief.reach._replace(v_max_m_s=3.0, v_margin_m_s=3.0)
    bench.agent.take_leader_order(LeaderOrder(1, 0, False, 2.5, 0, fast), bench.tick_now)
    assert believed(every)
