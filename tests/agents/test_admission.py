"""What of the messages that arrive is believed: dates, places and speeds that can't be are not."""

from dataclasses import replace
from math import isfinite

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.robot_bench import NOWHERE, SCENARIO, Bench

from agents.admission import LATE_MESSAGES_TOLERATED, Admission
from agents.agent import Agent
from agents.lockstep import deliver
from bridge.network.link import Arrival
from bridge.network.messages import LeaderSpeed, PathState, PoseFix
from configs.brief import LEAD_TICKS
from configs.leader_speed import SpeedChange
from configs.loading import load
from configs.reach import beyond
from configs.resolve import agent_brief

BRIEF = agent_brief(SCENARIO, "r2", network=NOWHERE, bus=())
SCHEDULE = BRIEF.schedule
PERIOD_NS, SHARE = SCHEDULE.period_ns, SCHEDULE.share_every
HOUR_NS = 3600 * 10**9
REALTIME = agent_brief(
    load("two_robots", ('clock.mode="realtime"',)), "r2", network=NOWHERE, bus=()
)


def admission_at(tick: int, brief=BRIEF) -> Admission:
    """The judge of a robot that has just computed this tick, at its very time."""
    admission = Admission(brief)
    admission.tick, admission.now_ns = tick, tick * PERIOD_NS
    return admission


def state(tick: int, s: float = 0.5, v_hat: float = 0.6) -> PathState:
    return PathState(tick, tick * PERIOD_NS, s, v_hat)


def refused(admission: Admission, message: PathState) -> str:
    """Why a path state of r1 is refused."""
    assert not admission.admits_path_state("r1", message)
    (line,) = admission.refusals.lines()
    assert line.startswith("refused 1 path state of r1: ")
    return line.partition(": ")[2]


def test_in_lockstep_what_the_schedule_knows_is_believed_once() -> None:
    admission = admission_at(SHARE)
    assert admission.admits_path_state("r1", state(2 * SHARE))
    assert refused(admission, state(2 * SHARE)).endswith("came twice")
    assert admission_at(SHARE).admits_path_state("r1", state(2 * SHARE))


def test_in_lockstep_what_is_over_is_refused() -> None:
    assert (
        refused(admission_at(SHARE), state(SHARE))
        == f"tick {SHARE} came when tick {SHARE} was over"
    )


def test_in_lockstep_nothing_from_further_ahead_than_a_bus_may_be_is_believed() -> None:
    far = -(-(SHARE + LEAD_TICKS + 3) // SHARE) * SHARE
    assert "ahead" in refused(admission_at(SHARE), state(far))
    hour = HOUR_NS // PERIOD_NS
    assert refused(admission_at(0), state(hour)) == "dated 3600 s ahead"


@pytest.mark.parametrize("brief", [BRIEF, REALTIME])
def test_a_time_that_is_not_its_tick_s_is_refused(brief) -> None:
    lie = PathState(2 * SHARE, 2 * SHARE * PERIOD_NS + HOUR_NS, 0.5, 0.6)
    assert "is not at" in refused(admission_at(SHARE, brief), lie)


def test_a_tick_at_which_nothing_is_shared_is_refused() -> None:
    assert SHARE > 1
    assert "nothing is shared at tick" in refused(admission_at(SHARE), state(SHARE + 1))


@pytest.mark.parametrize(
    ("s", "v_hat"), [(1e300, 0.6), (-1e300, 0.6), (1800.0, 0.6), (0.5, 1e300), (0.5, -50.0)]
)
@pytest.mark.parametrize("brief", [BRIEF, REALTIME])
def test_what_the_scenario_can_not_reach_is_refused(brief, s: float, v_hat: float) -> None:
    said = refused(admission_at(SHARE, brief), state(2 * SHARE, s, v_hat))
    assert "where this scenario has" in said


def test_in_real_time_a_neighbour_dated_an_hour_ahead_is_refused_and_heard_when_right() -> None:
    admission = admission_at(SHARE, REALTIME)
    ticks = HOUR_NS // PERIOD_NS // SHARE * SHARE
    assert refused(admission, state(ticks)).startswith("dated 3")
    assert admission.admits_path_state("r1", state(2 * SHARE))


def test_in_real_time_data_from_before_the_silence_limit_is_refused() -> None:
    old = round(BRIEF.coordination.silence_limit_s * 1e9) // PERIOD_NS // SHARE * SHARE
    assert admission_at(old, REALTIME).admits_path_state("r1", state(0))
    assert "back" in refused(admission_at(old + SHARE, REALTIME), state(0))


def test_in_real_time_old_and_repeated_data_is_refused() -> None:
    admission = admission_at(4 * SHARE, REALTIME)
    assert admission.admits_path_state("r1", state(3 * SHARE))
    assert not admission.admits_path_state("r1", state(3 * SHARE))
    assert not admission.admits_path_state("r1", state(2 * SHARE))
    assert admission.admits_path_state("r3", state(2 * SHARE))  # each neighbour by itself
    assert len(admission.refusals.lines()) == 2


def test_where_somebody_starts_is_believed_until_control_begins() -> None:
    assert admission_at(-1).admits_path_state("r1", state(-1))
    assert admission_at(-1).admits_pose(PoseFix(-1, 0, 0.0, 0.0, 0.0))
    begun = admission_at(0)
    assert not begun.admits_path_state("r1", state(-1))
    assert not begun.admits_pose(PoseFix(-1, 0, 0.0, 0.0, 0.0))
    assert begun.refusals.lines() == []  # late, and no lie
    for _ in range(2 * LATE_MESSAGES_TOLERATED):
        begun.admits_path_state("r1", state(-1))
    assert begun.refusals.floods() == [f"r1 ({LATE_MESSAGES_TOLERATED + 1} messages)"]


def test_poses_are_dated_like_path_states_and_of_this_world() -> None:
    tick = SCHEDULE.localise_every * 3
    good = PoseFix(tick, tick * PERIOD_NS, 1.0, 2.0, 3.0)
    admission = admission_at(tick)  # it is due a little later
    assert admission.admits_pose(good)
    assert not admission.admits_pose(good)
    assert not admission_at(tick + SCHEDULE.pose_delay_ticks).admits_pose(good)
    assert not admission_at(tick).admits_pose(good._replace(x_m=1e300))
    assert not admission_at(tick).admits_pose(good._replace(theta_rad=-1e9))
    assert not admission_at(tick).admits_pose(good._replace(t_ns=good.t_ns + PERIOD_NS))
    assert not admission_at(0, REALTIME).admits_pose(
        PoseFix(HOUR_NS // PERIOD_NS, HOUR_NS, 0.0, 0.0, 0.0)
    )
    assert admission_at(tick, REALTIME).admits_pose(good)


def test_poses_of_others_are_due_a_tick_later_even_if_ones_own_are_due_at_once() -> None:
    at_once = agent_brief(
        load("two_robots", ("localisation.delay_s=0.0",)), "r2", network=NOWHERE, bus=()
    )
    tick = SCHEDULE.localise_every * 3
    pose = PoseFix(tick, tick * PERIOD_NS, 1.0, 2.0, 3.0)
    assert not admission_at(tick, at_once).admits_pose(pose)
    assert admission_at(tick, at_once).admits_pose(pose, "r1")
    assert not admission_at(tick + 1, at_once).admits_pose(pose, "r1")


def test_a_leader_that_is_faster_than_the_scenario_is_not_followed() -> None:
    admission = admission_at(0)
    assert admission.admits_leader_speed(LeaderSpeed((SpeedChange(0, 0.6),)))
    ramp = SpeedChange(0, 0.6), SpeedChange(10, 1e9, 5)
    assert not admission.admits_leader_speed(LeaderSpeed(ramp))
    (line,) = admission.refusals.lines()
    assert line.startswith("refused 1 speed of the leader: v_r = 1e+09 m/s")


def test_states_of_far_ticks_are_not_kept() -> None:
    bench = Bench("r2")
    bench.drive(1)
    for tick in range(0, 100_000 * SHARE, SHARE):
        bench.agent.receive_path_state("r1", state(tick))
    assert sum(map(len, bench.agent._reception._path_states.values())) <= LEAD_TICKS // SHARE + 2
    assert any("path states of r1" in line for line in bench.agent.remarks())


def test_a_wait_that_names_what_is_missing_says_what_was_refused_of_it() -> None:
    bench = Bench("r2")
    bench.run(SCHEDULE.countdown_ticks)
    bench.agent.receive_path_state("r1", state(0, s=1e6))
    assert bench.agent.missing(0) == ["path state of r1"]
    (line,) = bench.agent.refusals()
    assert line.startswith("refused 1 path state of r1: s = 1e+06 m at 0 s")


def test_what_is_no_message_is_counted_by_its_sender() -> None:
    bench = Bench("r2")
    for kind in ("path/r1", "pose", "leader"):
        deliver(bench.agent, Arrival(kind, "key", b"\xc1"))
    assert bench.agent.refusals() == [
        "refused 1 path state of r1: not well formed",
        "refused 1 pose of the localisation system: not well formed",
        "refused 1 speed of the leader: not well formed",
    ]


ints = st.integers(-(2**63), 2**63 - 1)
floats = st.floats(allow_nan=False, allow_infinity=False)
extreme = st.one_of(
    st.builds(PathState, ints, ints, floats, floats),
    st.builds(lambda k, s, v: state(k * SHARE, s, v), st.integers(-2, 30), floats, floats),
    st.builds(PoseFix, ints, ints, floats, floats, floats),
    st.builds(
        lambda k, x, y, a: PoseFix(k, k * PERIOD_NS, x, y, a),
        st.integers(-2, 300), floats, floats, floats,
    ),
)  # fmt: skip


@pytest.mark.parametrize("brief", [BRIEF, REALTIME])
@given(st.lists(extreme, max_size=30))
def test_whatever_peers_say_the_controller_goes_on_with_numbers(brief, said) -> None:
    bench = Bench("r2", schedule=replace(brief.schedule))
    bench.run(SCHEDULE.countdown_ticks)
    agent: Agent = bench.agent
    for n, message in enumerate(said):
        agent.admission.now_ns = n * PERIOD_NS
        if isinstance(message, PathState):
            agent.receive_path_state("r1", message)
        else:
            agent.receive_pose(message)
        bench.tick()
        shared = agent.share(n + 1)
        assert isfinite(shared.s)
        assert beyond(BRIEF.reach, shared.t_ns * 1e-9, shared.s, shared.v_hat) is None
