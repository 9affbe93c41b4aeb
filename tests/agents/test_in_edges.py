"""Edges that come and go at one controller: sums, what it waits for, what it takes no notice of."""

from support.robot_bench import Bench

from bridge.network.messages import LeaderSpeed, PathState
from configs.edges import FOREVER, LEADER, InEdge
from configs.leader_speed import SpeedChange
from configs.ticks import Ticks

GAPS = ((0, 20), (40, 60), (81, FOREVER))


def bench(**changes) -> Bench:
    one = Bench("r2", **({"hears": (InEdge("r1", 1.0, GAPS),)} | changes))
    one.run(one.schedule.countdown_ticks)
    return one


def say(one: Bench, tick: int, s: float = 0.0) -> None:
    one.agent.receive_path_state("r1", PathState(tick, tick * one.schedule.period_ns, s, 0.6))


def test_a_neighbour_counts_from_its_first_path_state_in_a_window_until_the_window_ends() -> None:
    one = bench()
    counted = []
    for tick in range(100):
        if Ticks(one.schedule).shares(tick):
            say(one, tick)
        one.tick()
        counted.append(one.agent._neighbours.sums(tick * one.schedule.period_ns, 0.0).neighbours)
    every = one.schedule.share_every
    first = [0, 40, -(-81 // every) * every]
    expected = [
        any(begin <= tick < end for begin, end in zip(first, (20, 60, 100), strict=True))
        for tick in range(100)
    ]
    assert counted == [int(one) for one in expected]


def test_nothing_is_awaited_of_an_edge_that_does_not_exist() -> None:
    one = bench()
    every = one.schedule.share_every
    awaited = []
    for tick in range(0, 100, every):
        if one.agent.missing(tick):
            awaited.append(tick)
            say(one, tick)
        one.run(every)
    assert awaited == [
        tick for tick in range(0, 100, every) if tick < 20 or 40 <= tick < 60 or tick >= 81
    ]


def test_what_is_said_in_a_gap_is_discarded_unseen() -> None:
    one = bench()
    one.run(21)
    say(one, 30, s=1e9)  # beyond reach
    assert one.agent.refusals() == []
    say(one, 41 - 41 % one.schedule.share_every, s=1e9)
    assert len(one.agent.refusals()) == 1


def test_in_lockstep_every_speaker_is_awaited_at_the_start_in_real_time_those_of_tick_0() -> None:
    hears = InEdge("r1"), InEdge("r9", 1.0, ((40, FOREVER),))
    assert Bench("r2", hears=hears).agent.missing_to_start() == ["the path variable of r9"]
    assert Bench("r2", "clock.mode='realtime'", hears=hears).agent.missing_to_start() == []


def test_a_leader_link_counts_while_it_exists() -> None:
    one = Bench("r1", hears=(), leader_link=InEdge(LEADER, 2.0, ((10, 20),)))
    one.agent.receive_leader_speed(LeaderSpeed((SpeedChange(0, 0.3),)))
    one.run(one.schedule.countdown_ticks)
    estimates = []
    for _ in range(31):
        one.tick()
        estimates.append(one.agent.share(0).v_hat)
    assert len(set(estimates[:10])) == 1
    assert estimates[9] > estimates[10] > estimates[19] > 0.3
    assert len(set(estimates[19:])) == 1
