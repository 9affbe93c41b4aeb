"""The transitions of the table in `agents.agent`, with the real emulated drives.

Those from STOPPED and REARMING are `test_rearming`'s.
"""

from dataclasses import replace
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.robot_bench import ZERO, Bench, commands, set_points
from support.robot_faults import (
    REARM,
    by_bus_error,
    by_estop,
    by_estop_on_the_bus,
    by_lost_encoder_frames,
    by_lost_heartbeats,
    by_lost_pose,
    by_reboot,
    by_silence,
    failing,
    mend,
)

from agents.guard import Phase
from bridge.drives.odrive.frames import AxisError
from bridge.drives.odrive.frames import Command as Cmd
from bridge.network.messages import PoseFix
from configs.errors import InfrastructureError

# --- arming ---------------------------------------------------------------------------------------


def test_the_steps_of_arming_come_in_their_order_on_the_bus() -> None:
    sent = [commands(frames) for frames in Bench().run(3)]
    torque = Cmd.SET_INPUT_TORQUE
    assert sent == [
        [Cmd.SET_AXIS_STATE, Cmd.CLEAR_ERRORS, torque] * 2,
        [Cmd.SET_LIMITS, Cmd.SET_CONTROLLER_MODE, torque] * 2,
        [torque, torque, Cmd.SET_AXIS_STATE, Cmd.SET_AXIS_STATE],
    ]


def test_an_estop_while_ready_is_not_cleared_and_names_itself_at_tick_0() -> None:
    bench = Bench()
    bench.until(Phase.READY)
    bench.estop(1)
    bench.until(Phase.ARMING)
    assert bench.tick_now < 0
    with pytest.raises(InfrastructureError, match=r"r2: drives not armed.*left.*ESTOP_REQUESTED"):
        while True:
            frames = bench.tick()
            assert Cmd.CLEAR_ERRORS not in commands(frames)
    assert bench.closed() == [False, False]


def test_encoder_frames_that_fail_for_a_moment_before_tick_0_are_armed_over() -> None:
    bench = Bench("r2", "clock.countdown_s=1.0")
    bench.until(Phase.READY)
    bench.silent = {0}
    bench.until(Phase.ARMING)
    bench.silent = set()
    bench.until(Phase.READY)
    bench.until(Phase.DRIVING)


def test_drives_that_never_speak_end_the_countdown_with_both_their_names() -> None:
    bench = Bench()
    bench.silent = {0, 1}
    bench.run(bench.schedule.countdown_ticks)
    with pytest.raises(InfrastructureError, match=r"right drive \(node 0\): no heartbeat heard"):
        bench.tick()


def test_a_drive_that_says_no_more_than_heartbeats_is_named_for_its_encoder() -> None:
    bench = Bench()
    bench.mute = {(1, Cmd.GET_ENCODER_ESTIMATES)}
    bench.run(bench.schedule.countdown_ticks)
    with pytest.raises(InfrastructureError, match=r"left drive \(node 1\): no encoder frame heard"):
        bench.tick()


def test_a_countdown_that_is_too_short_says_in_which_state_the_drives_are() -> None:
    bench = Bench()
    schedule = replace(bench.schedule, countdown_ticks=10)
    bench = Bench("r2", schedule=schedule)
    bench.run(10)
    with pytest.raises(InfrastructureError, match=r"it is IDLE, last result .*fleetloop check"):
        bench.tick()


# --- stopping -------------------------------------------------------------------------------------


FAULTS = {
    by_estop: "right drive (node 0) dropped out: ESTOP_REQUESTED",
    by_estop_on_the_bus: "left drive (node 1) dropped out: ESTOP_REQUESTED",
    by_reboot: "left drive (node 1) dropped out: left closed loop without an error",
    by_silence: "right drive (node 0): no encoder frames any more",
    by_lost_heartbeats: "right drive (node 0): no heartbeat for 0.5 s",
    by_lost_encoder_frames: "left drive (node 1): no encoder frames any more",
    by_lost_pose: "no pose from the localisation system for 0.50 s",
    by_bus_error: "bus error: network is down",
}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.__name__)
def test_a_fault_stops_both_wheels_in_the_tick_in_which_it_is_known(fault) -> None:
    bench = Bench()
    bench.drive(5)
    fault(bench)
    *_, last = failing(bench)
    assert FAULTS[fault] in bench.why
    assert commands(last) == [Cmd.SET_INPUT_TORQUE] * 2 + [Cmd.SET_AXIS_STATE] * 2
    assert set_points(last) == [ZERO, ZERO]
    bench.silent = set()
    bench.run(50)  # a drive that was away is told as soon as it is back
    assert bench.torques() == (0.0, 0.0)
    assert bench.closed() == [False, False]


def test_a_fault_is_known_within_its_limit() -> None:
    within_s = {by_estop: 0.11, by_silence: 0.055, by_lost_heartbeats: 0.61, by_lost_pose: 0.51}
    for fault, limit_s in within_s.items():
        bench = Bench()
        bench.drive(5)
        fault(bench)
        assert len(failing(bench, 400)) * bench.schedule.period_s <= limit_s, fault.__name__


def test_an_estop_that_is_seen_on_the_bus_stops_in_the_next_tick() -> None:
    bench = Bench()
    bench.drive(5)
    bench.estop(1, heard=True)
    assert len(failing(bench)) == 1


def test_ages_have_the_limits_that_the_scenario_gives() -> None:
    bench = Bench("r2", "host.pose_age_limit_s=0.1", "host.encoder_age_limit_s=0.02")
    bench.drive(5)
    bench.silent = {0}
    assert len(failing(bench)) in (10, 11)
    bench = Bench("r2", "host.pose_age_limit_s=0.1", "host.encoder_age_limit_s=0.02")
    bench.drive(5)
    bench.pose = None
    assert 45 <= len(failing(bench)) <= 55


def test_odometry_alone_needs_no_pose() -> None:
    bench = Bench("r2", "localisation.source='odometry'")
    bench.pose = None
    bench.drive(600)


@pytest.mark.parametrize("torque", [nan, inf, -inf])
def test_a_torque_that_is_not_finite_never_reaches_the_bus(torque: float) -> None:
    bench = Bench()
    bench.drive(5)
    frames = list(bench.agent.guard.command(bench.tick_now, torque, 0.1))
    assert set_points(frames) == [ZERO, ZERO]
    assert "not finite" in bench.why


def test_a_stopped_robot_stays_stopped_unless_told_otherwise() -> None:
    bench = Bench()
    bench.drive(5)
    bench.silent = {0}
    failing(bench)
    bench.silent = set()
    for frames in bench.run(1500):
        assert set_points(frames) == [ZERO, ZERO]
    assert bench.phase is Phase.STOPPED


def test_an_encoder_that_jumps_or_a_pose_that_does_is_not_believed() -> None:
    limits = ("host.encoder_mismatch_limit_wheel_rad=1.0", "host.pose_mismatch_limit_m=0.3")
    bench = Bench("r2", *limits)
    bench.drive(50)
    bench.axes[0].update_encoder(1.0, 0.0)
    failing(bench, 3)
    assert "right encoder: angle and speed disagree by 6.3 rad" in bench.why
    bench = Bench("r2", *limits)
    bench.drive(50)
    bench.pose = (3.95, 0.05, 1.57)
    failing(bench, 20)
    assert "pose and odometry are 2 m apart" in bench.why


# --- limits, dry run, end -------------------------------------------------------------------------


def test_torque_and_slew_limits_hold_on_the_bus_from_the_first_tick() -> None:
    free, held = (
        Bench("r2", *limits)
        for limits in (
            (),
            ("host.torque_limit_wheel_N_m=0.3", "host.torque_slew_limit_wheel_N_m_s=5.0"),
        )
    )
    last = (0.0, 0.0)
    for bench in (free, held):
        bench.run(bench.schedule.countdown_ticks)
    for _ in range(100):
        free.tick()
        held.tick()
        sent = held.torques()
        for torque, before in zip(sent, last, strict=True):
            assert abs(torque) <= 0.3 * 1.000001
            assert abs(torque - before) <= 5.0 * 0.002 * 1.00001
        last = sent
    assert max(map(abs, free.torques())) > 0.31
    assert max(map(abs, last)) == pytest.approx(0.3)


def test_a_dry_run_computes_and_records_and_sends_nothing() -> None:
    wet, dry = Bench(), Bench("r2", "host.dry_run=true")
    for bench in (wet, dry):
        bench.run(bench.schedule.countdown_ticks)
    assert dry.phase is Phase.READY
    wet.tick()
    assert all(frames == [] for frames in dry.run(20))
    assert dry.phase is Phase.DRIVING
    assert dry.closed() == [False, False]
    wet.agent.rows.finish(), dry.agent.rows.finish()
    assert dry.rows[0] == wet.rows[0]
    assert "dry run: nothing was sent to the drives" in dry.agent.guard.remarks()
    assert list(dry.agent.shut_down()) == []


def test_a_dry_run_names_drives_that_could_not_be_driven() -> None:
    bench = Bench("r2", "host.dry_run=true")
    bench.estop(1)
    bench.run(bench.schedule.countdown_ticks)
    with pytest.raises(InfrastructureError, match="ESTOP_REQUESTED"):
        bench.tick()
    bench = Bench("r2", "host.dry_run=true")
    bench.drive(5)
    bench.silent = {1}
    failing(bench)
    assert "left drive (node 1): no encoder frames any more" in bench.why


@pytest.mark.parametrize("phase", [Phase.ARMING, Phase.READY, Phase.DRIVING, Phase.STOPPED])
@pytest.mark.parametrize("estop", [False, True])
def test_leaving_disarms_from_every_phase_as_configured(phase: Phase, estop: bool) -> None:
    bench = Bench("r2", f"host.on_exit='{'estop' if estop else 'idle'}'")
    if phase is Phase.STOPPED:
        bench.drive(5)
        bench.estop(0)
    bench.until(phase)
    bench.run(2)
    frames = list(bench.agent.shut_down())
    assert bench.phase is Phase.DONE
    assert set_points(frames) == [ZERO, ZERO]
    assert commands(frames).count(Cmd.ESTOP) == (2 if estop else 0)
    bench.answer(frames)
    assert bench.closed() == [False, False]
    assert bench.torques() == (0.0, 0.0)
    latched = [bool(axis.errors & AxisError.ESTOP_REQUESTED) for axis in bench.axes]
    assert not estop or latched == [True, True]


# --- whatever happens -----------------------------------------------------------------------------

HAPPENINGS = {
    "estop 0": lambda bench: bench.estop(0),
    "estop 1 heard": lambda bench: bench.estop(1, heard=True),
    "reboot 0": lambda bench: bench.reboot(0),
    "reboot 1": lambda bench: bench.reboot(1),
    "silence 0": lambda bench: bench.silent.add(0),
    "silence 1": lambda bench: bench.silent.add(1),
    "no heartbeat 0": lambda bench: bench.mute.add((0, Cmd.HEARTBEAT)),
    "no encoder 1": lambda bench: bench.mute.add((1, Cmd.GET_ENCODER_ESTIMATES)),
    "no pose": lambda bench: setattr(bench, "pose", None),
    "bus down": by_bus_error,
    "unsent": lambda bench: bench.agent.guard.note_unsent(bench.tick_now),
    "all well": mend,
    "cleared": lambda bench: [
        axis.on_frame(frame, bench.now_ns)
        for axis in bench.axes
        for frame in [bench.agent.guard.drives._axes[axis.node_id].frame(Cmd.CLEAR_ERRORS, b"\0")]
    ],
}


@given(
    st.lists(
        st.tuples(st.sampled_from(sorted(HAPPENINGS)), st.integers(0, 400)), min_size=1, max_size=8
    ),
    st.integers(1, 200),
)
def test_torque_is_sent_only_while_both_drives_are_armed_and_well(happenings, start) -> None:
    bench = Bench("r2", *REARM, "host.rearm_after_s=0.2", "host.rearm_attempts=1000")
    bench.until(Phase.READY)
    bench.run(-bench.tick_now + start)
    zero_since_stop = True
    was = bench.phase
    for name, ticks in happenings:
        HAPPENINGS[name](bench)
        for _ in range(ticks):
            # As the host knows it when it computes.
            bench.speak()
            drives, guard = bench.agent.guard.drives, bench.agent.guard
            well = drives.fault(bench.now_ns) is None and not guard.bus_fault
            armed = drives.armed
            frames = list(bench.agent.step(bench.tick_now))
            bench.answer(frames)
            bench.tick_now += 1
            torques = set_points(frames)
            assert len(torques) == 2
            if torques != [ZERO, ZERO]:
                assert armed
                assert well
                assert was is bench.phase is Phase.DRIVING
                assert zero_since_stop
            if Cmd.CLEAR_ERRORS in commands(frames):
                assert torques == [ZERO, ZERO]
                assert bench.phase is Phase.REARMING
            if was is Phase.DRIVING and bench.phase is not Phase.DRIVING:
                zero_since_stop = torques == [ZERO, ZERO]
                assert Cmd.SET_AXIS_STATE in commands(frames)
            was = bench.phase


def test_a_pose_of_the_future_does_not_stand_in_for_those_to_come() -> None:
    schedule = replace(Bench().schedule, realtime=True)
    bench = Bench("r2", schedule=schedule)
    bench.drive(5)
    bench.pose = None
    bench.agent.receive_pose(PoseFix(10**6, 0, 1.95, 0.05, 1.57))
    failing(bench)
    assert "no pose" in bench.why
