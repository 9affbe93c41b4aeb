"""In lockstep: neighbours that have no path state, and a controller that re-joins among others."""

import pytest
from support.robot_bench import Bench

from bridge.network.messages import PathState, PoseFix
from configs.brief import LEAD_TICKS

LATE = 500
"""The first tick of a controller that re-joins; path states are due at every tenth."""


def state(tick: int) -> PathState:
    return PathState(tick, tick * 2_000_000, 0.6 * tick * 0.002, 0.6)


def bench(*overrides: str, **changes) -> Bench:
    return Bench("r2", "clock.on_late='drop'", *overrides, **changes)


def test_a_path_state_is_not_missing_at_a_tick_of_silence() -> None:
    agent = bench().agent
    assert "path state of r1" in agent.missing(10)
    agent.receive_silence("r1", 10)
    assert "path state of r1" not in agent.missing(10)
    assert "path state of r1" in agent.missing(20)


def test_a_silent_neighbour_leaves_the_sums_by_age() -> None:
    robot = bench("coordination.silence_limit_s=0.1")
    robot.run(robot.schedule.countdown_ticks)
    heard = []
    for tick in range(151):
        if tick % 10 == 0:
            if tick <= 50:
                robot.agent.receive_path_state("r1", state(tick))
            else:
                robot.agent.receive_silence("r1", tick)
        robot.tick()
        heard.append(robot.agent._neighbours.carried_on(tick * 2_000_000)[0])
    # The last path state is of tick 50; 0.1 s are 50 ticks.
    assert heard == [1.0] * 101 + [0.0] * 50


@pytest.mark.parametrize("tick", [15, 10_000, -1])
def test_a_silence_that_cannot_be_is_refused_or_says_nothing(tick: int) -> None:
    agent = bench().agent
    agent.receive_silence("r1", tick)
    assert len(agent.refusals()) == (tick >= 0)


def test_the_start_waits_for_the_word_of_the_plant_on_each_neighbour() -> None:
    robot = bench()
    assert "the plant's word of r1" in robot.agent.missing_to_start()
    robot.agent.receive_silence("r1", -1)
    assert "the plant's word of r1" not in robot.agent.missing_to_start()
    assert "the plant's word of r1" not in Bench("r2").agent.missing_to_start()


def again() -> Bench:
    robot = bench(rejoins=True, resumes_tick=LATE)
    robot.tick_now = LATE
    return robot


def test_one_that_rejoins_awaits_poses_from_its_first_tick_and_others_beyond_the_lead() -> None:
    agent = again().agent
    first = LATE + LEAD_TICKS + 2
    due = [tick for tick in range(LATE, LATE + 41) if "path state of r1" in agent.missing(tick)]
    assert due == [tick for tick in range(LATE, LATE + 41) if tick >= first and tick % 10 == 0]
    assert "pose" not in agent.missing(LATE)  # that of the tick before
    assert "pose" in agent.missing(LATE + 1 + (-LATE) % 5)


def test_what_was_said_before_it_listened_is_discarded_unseen() -> None:
    robot = again()
    robot.pose = None
    agent = robot.agent
    agent.receive_path_state("r1", state(LATE + 10))
    agent.receive_silence("r1", LATE + 10)
    agent.receive_pose(PoseFix(LATE - 5, (LATE - 5) * 2_000_000, 0.0, 0.0, 0.0))
    robot.run(30)
    assert agent.refusals() == []
    assert not agent.speaks(robot.tick_now)
    agent.receive_path_state("r1", state(LATE + 40))
    assert "path state of r1" not in agent.missing(LATE + 40)


def test_it_rejoins_with_the_first_path_state_that_is_due() -> None:
    robot = again()
    robot.run(10)
    robot.agent.receive_path_state("r1", state(LATE + 20))
    robot.run(10)
    assert not robot.agent.speaks(robot.tick_now)
    robot.run(1)
    assert robot.agent.speaks(robot.tick_now)
    assert robot.agent.share(robot.tick_now).s == pytest.approx(0.6 * (LATE + 21) * 0.002)
