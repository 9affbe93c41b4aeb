"""A controller that was started again in a run that goes on."""

import pytest
from support.robot_bench import Bench

from agents.guard import Phase
from bridge.network.messages import LeaderSpeed, PathState
from configs.leader_speed import SpeedChange

LATE = 1500
"""Its first tick."""


def again(robot: str, *overrides: str) -> Bench:
    """A controller of two_robots whose predecessor was killed, and drives that were left idle."""
    bench = Bench(robot, "clock.mode='realtime'", "host.restarts=1", *overrides, rejoins=True)
    bench.tick_now = LATE
    return bench


def run(bench: Bench, ticks: int) -> None:
    for _ in range(ticks):
        bench.agent.admission.now_ns = bench.tick_now * bench.schedule.period_ns
        bench.tick()


def hear(bench: Bench, s: float) -> None:
    """Its neighbour says its path variable, which moves at 0.6 m/s."""
    period_ns, tick = bench.schedule.period_ns, bench.tick_now
    tick -= tick % bench.schedule.share_every
    bench.agent.admission.now_ns = bench.tick_now * period_ns
    bench.agent.receive_path_state("r1", PathState(tick, tick * period_ns, s, 0.6))


def test_it_says_nothing_until_it_hears_a_neighbour_and_takes_its_place() -> None:
    bench = again("r2")
    assert bench.agent.missing_to_start() == []
    run(bench, 100)
    assert not bench.agent.speaks(bench.tick_now)
    hear(bench, 1.8)
    run(bench, 1)
    assert bench.agent.speaks(bench.tick_now)
    state = bench.agent.share(bench.tick_now)
    assert (state.s, state.v_hat) == (pytest.approx(1.8, abs=0.02), pytest.approx(0.6))
    (joined,) = (it for it in bench.agent.guard.events if it.kind == "rejoined")
    assert joined.text.startswith("at s = 1.8")


def test_it_arms_its_drives_as_after_a_stop_though_robots_do_not_rearm() -> None:
    bench = again("r2")
    hear(bench, 1.8)
    while bench.phase is not Phase.DRIVING:
        assert bench.tick_now < LATE + 2000, bench.phase
        assert bench.torques() == (0.0, 0.0)
        run(bench, 1)
    assert bench.closed() == [True, True]
    run(bench, 20)
    assert bench.torques() != (0.0, 0.0)


def test_without_in_neighbours_its_path_variable_goes_on_as_if_nothing_had_happened() -> None:
    bench = again("r1")
    ramp = SpeedChange(0, 0.6), SpeedChange(1_000_000_000, 0.2, 1_000_000_000)
    bench.agent.receive_leader_speed(LeaderSpeed(ramp))
    before = Bench("r1")
    before.agent.receive_leader_speed(LeaderSpeed(ramp))
    before.run(before.schedule.countdown_ticks)
    run(bench, 20)
    before.run(bench.tick_now)
    assert bench.agent.speaks(bench.tick_now)
    assert bench.agent.share(bench.tick_now) == before.agent.share(bench.tick_now)


def test_linked_to_the_leader_it_begins_without_neighbours_once_a_silent_one_counts_no_more() -> (
    None
):
    bench = again("r2", "graph.leader=['r1', 'r2']", "coordination.silence_limit_s=0.5")
    bench.agent.receive_leader_speed(LeaderSpeed((SpeedChange(0, 0.6),)))
    run(bench, 249)
    assert not bench.agent.speaks(bench.tick_now)
    run(bench, 5)
    assert bench.agent.speaks(bench.tick_now)
    state = bench.agent.share(bench.tick_now)
    assert state.s == pytest.approx(0.6 * bench.tick_now * 0.002, abs=0.02)
    assert state.v_hat == pytest.approx(0.6, abs=1e-3)
    hear(bench, state.s - 0.1)
    run(bench, 20)
    assert bench.agent.share(bench.tick_now).s < state.s + 20 * 0.6 * 0.002  # it agrees with it


def test_without_link_to_the_leader_it_waits_for_a_neighbour_however_long() -> None:
    bench = again("r2", "coordination.silence_limit_s=0.5")
    run(bench, 600)
    assert not bench.agent.speaks(bench.tick_now)


def test_without_the_leaders_word_it_does_not_begin() -> None:
    bench = again("r1")
    run(bench, 20)
    assert not bench.agent.speaks(bench.tick_now)


def test_without_a_pose_it_does_not_begin() -> None:
    bench = again("r2")
    bench.pose = None
    hear(bench, 1.8)
    run(bench, 400)
    assert not bench.agent.speaks(bench.tick_now)
    assert bench.phase is Phase.STOPPED
