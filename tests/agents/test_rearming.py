"""From a stop back to driving: what may lead there, and what may not, with the emulated drives."""

import pytest
from support.robot_bench import ZERO, Bench, commands, set_points
from support.robot_faults import (
    REARM,
    by_bus_error,
    by_lost_encoder_frames,
    by_lost_heartbeats,
    by_lost_pose,
    by_reboot,
    by_silence,
    failing,
    mend,
)

from agents.guard import Phase
from bridge.drives.odrive.frames import Command as Cmd

PASSING = [by_reboot, by_silence, by_lost_heartbeats, by_lost_encoder_frames, by_lost_pose]


@pytest.mark.parametrize("fault", [*PASSING, by_bus_error], ids=lambda fault: fault.__name__)
def test_once_the_fault_is_gone_the_whole_way_of_arming_leads_back_to_driving(fault) -> None:
    bench = Bench("r2", *REARM)
    bench.drive(5)
    fault(bench)
    failing(bench)
    bench.run(200)
    assert bench.phase is Phase.STOPPED
    mend(bench)
    gone = bench.tick_now if fault is not by_reboot else bench.tick_now - 200
    waiting = bench.until(Phase.REARMING)
    assert bench.tick_now - gone >= 250  # rearm_after_s
    arming = bench.until(Phase.DRIVING)
    for frames in waiting + arming:
        assert set_points(frames) == [ZERO, ZERO]
    said = [command for frames in arming for command in commands(frames)]
    steps = [Cmd.CLEAR_ERRORS, Cmd.SET_LIMITS, Cmd.SET_CONTROLLER_MODE]
    assert sorted(said.index(step) for step in steps) == [said.index(step) for step in steps]
    assert said.count(Cmd.SET_AXIS_STATE) >= 4
    assert bench.why == ""
    assert bench.closed() == [True, True]
    assert any(set_points(frames) != [ZERO, ZERO] for frames in bench.run(5))
    kinds = [event.kind for event in bench.agent.guard.events]
    assert kinds[-3:] == ["stopped", "rearming", "rearmed"]
    assert set(kinds[:-3]) <= {"armed", "drive_error"}


def test_an_estop_is_not_cleared_by_the_host_but_by_somebody_else() -> None:
    bench = Bench("r2", *REARM)
    bench.drive(5)
    bench.estop(0)
    failing(bench)
    for frames in bench.run(1000):
        assert Cmd.CLEAR_ERRORS not in commands(frames)
    assert bench.phase is Phase.STOPPED
    bench.axes[0].errors = bench.axes[0].disarm_reason = type(bench.axes[0].errors)(0)
    bench.until(Phase.DRIVING)


def test_an_estop_while_arming_again_stops_it() -> None:
    bench = Bench("r2", *REARM)
    bench.drive(5)
    bench.reboot(0)
    failing(bench)
    bench.until(Phase.REARMING)
    bench.run(10)
    bench.estop(1, heard=True)
    bench.run(1)
    assert bench.phase is Phase.STOPPED
    bench.run(1000)
    assert bench.phase is Phase.STOPPED
    assert "ESTOP_REQUESTED" in bench.why


def test_a_drive_that_does_not_close_its_loop_ends_the_attempt_by_name() -> None:
    bench = Bench("r2", *REARM, "host.rearm_attempts=1")
    bench.drive(5)
    bench.reboot(1)
    failing(bench)
    bench.until(Phase.REARMING)
    while bench.phase is Phase.REARMING:
        bench.speak()
        frames = list(bench.agent.step(bench.tick_now))
        bench.answer([frame for frame in frames if frame.can_id >> 5 != 1])  # it hears nothing
        bench.tick_now += 1
    assert bench.phase is Phase.STOPPED
    assert "could not arm again: left drive (node 1): no closed loop reported yet" in bench.why
    assert "IDLE" in bench.why
    bench.run(1000)
    assert bench.phase is Phase.STOPPED  # no attempt is left


def test_attempts_are_counted_over_the_run() -> None:
    bench = Bench("r2", *REARM, "host.rearm_attempts=2")
    bench.drive(5)
    for _ in range(2):
        bench.reboot(0)
        failing(bench)
        bench.until(Phase.DRIVING)
    bench.reboot(0)
    failing(bench)
    bench.run(1000)
    assert bench.phase is Phase.STOPPED


def test_a_frame_of_arming_that_was_not_sent_begins_it_anew() -> None:
    bench = Bench("r2", *REARM)
    bench.run(2)
    bench.agent.guard.note_unsent(bench.tick_now)
    assert Cmd.CLEAR_ERRORS in commands(bench.tick())
    bench.until(Phase.DRIVING)
    bench.reboot(0)
    failing(bench)
    bench.until(Phase.REARMING)
    bench.agent.guard.note_unsent(bench.tick_now)
    assert bench.phase is Phase.STOPPED
    bench.until(Phase.DRIVING)


def test_the_law_and_the_limiter_begin_anew_after_arming_again() -> None:
    bench = Bench("r2", *REARM, "host.torque_slew_limit_wheel_N_m_s=1.0")
    bench.drive(100)
    bench.reboot(0)
    failing(bench)
    bench.until(Phase.REARMING)
    *_, last = bench.until(Phase.DRIVING)
    assert set_points(last) == [ZERO, ZERO]
    bench.tick()
    assert all(
        abs(torque) <= 0.002 * 1.000001 for torque in bench.agent.guard.drives.sent_wheel_N_m
    )
