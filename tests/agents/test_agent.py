"""One controller's phases, told everything by the test."""

import pytest
from support.controller_rows import COLUMNS
from support.robot_bench import NOWHERE, SCENARIO, Bench

from agents.agent import Agent
from agents.guard import Phase
from bridge.drives.odrive.frames import Command, identifier
from bridge.frame import Frame
from bridge.network.messages import LeaderSpeed, PathState, PoseFix
from bridge.network.telemetry import RowBuffer, row_of
from configs.errors import InfrastructureError
from configs.leader_speed import SpeedChange
from configs.resolve import agent_brief
from configs.ticks import Ticks


def test_a_controller_arms_in_the_countdown_and_drives_from_tick_0() -> None:
    bench = Bench()
    assert bench.agent.phase is Phase.ARMING
    bench.run(bench.schedule.countdown_ticks)
    assert bench.agent.phase is Phase.READY
    frames = bench.tick()
    assert bench.agent.phase is Phase.DRIVING
    assert [frame.can_id for frame in frames] == [0x00E, 0x02E]
    assert any(axis.torque_demand_shaft(0.0) != 0.0 for axis in bench.axes)


def test_no_torque_but_zero_is_sent_before_control_starts() -> None:
    bench = Bench()
    for frames in bench.run(bench.schedule.countdown_ticks):
        for frame in frames:
            if frame.can_id in (0x00E, 0x02E):
                assert frame.data == bytes(4)


def test_drives_that_do_not_arm_in_time_are_an_error_that_says_why() -> None:
    bench = Bench()
    for _ in range(bench.schedule.countdown_ticks):
        for axis in bench.axes:
            axis.on_frame(Frame(identifier(axis.node_id, Command.ESTOP), b""), 0)
        bench.tick()
    with pytest.raises(InfrastructureError, match=r"r2.*ESTOP_REQUESTED"):
        bench.tick()


def test_a_drive_that_drops_out_stops_both_wheels_and_sharing_goes_on() -> None:
    bench = Bench()
    bench.run(bench.schedule.countdown_ticks)
    bench.tick()
    stop = Frame(identifier(1, Command.ESTOP), b"")
    bench.axes[1].on_frame(stop, Ticks(bench.schedule).bus_time_ns(0))
    bench.run(119)
    assert bench.agent.phase is Phase.STOPPED
    assert "left drive (node 1) dropped out: ESTOP_REQUESTED" in bench.agent.guard.stop_reason
    assert [axis.torque_demand_shaft(0.0) for axis in bench.axes] == [0.0, 0.0]
    before = bench.agent.share(120).s
    bench.run(20)
    assert bench.agent.share(140).s > before


def test_the_closing_tick_disarms() -> None:
    bench = Bench()
    bench.run(bench.schedule.countdown_ticks)
    bench.tick()
    bench.tick_now = bench.schedule.ticks
    bench.tick()
    assert bench.agent.phase is Phase.DONE
    assert [axis.torque_demand_shaft(0.0) for axis in bench.axes] == [0.0, 0.0]


def test_what_is_missing_is_named() -> None:
    brief = agent_brief(SCENARIO, "r1", network=NOWHERE, bus=())
    agent = Agent(brief, RowBuffer(row_of(brief.signals), lambda *_: None))
    assert agent.missing_to_start() == ["the localisation system", "the leader"]
    agent.receive_leader_speed(LeaderSpeed((SpeedChange(0, 0.6),)))
    agent.receive_pose(PoseFix(-1, 0, 0.0, 0.0, 0.0))
    assert agent.missing_to_start() == []
    bench = Bench("r2")
    assert bench.agent.missing(0) == ["path state of r1"]
    assert bench.agent.missing(1) == ["pose"]  # of tick 0, a period late
    assert bench.agent.missing(2) == []
    bench.agent.receive_path_state("r1", PathState(0, 0, 0.0, 0.6))
    bench.agent.receive_pose(PoseFix(0, 0, 0.0, 0.0, 0.0))
    assert bench.agent.missing(0) == bench.agent.missing(1) == []


def test_a_row_holds_what_was_used_and_commanded() -> None:
    bench = Bench()
    bench.run(bench.schedule.countdown_ticks)
    bench.agent.receive_path_state("r1", PathState(0, 0, 0.0, 0.6))
    bench.tick()
    bench.agent.rows.finish()
    (row,) = (dict(zip(COLUMNS, values, strict=True)) for values in bench.rows)
    assert row["t_s"] == 0.0
    assert (row["x_used_m"], row["y_used_m"]) == (1.95, 0.05)
    assert (row["s"], row["s_dot"], row["v_r_hat"], row["neighbours"]) == (0.0, 0.6, 0.6, 1.0)
    assert (row["x_d_m"], row["y_d_m"]) == pytest.approx((2.0, 0.0))
    assert row["tau_right_wheel_N_m"] == bench.axes[0].torque_demand_shaft(0.0)


def test_a_leader_link_moves_the_estimate_and_its_absence_does_not() -> None:
    hearing, deaf = Bench("r1"), Bench("r2")
    hearing.agent.receive_leader_speed(LeaderSpeed((SpeedChange(0, 1.0),)))
    for bench in (hearing, deaf):
        bench.run(bench.schedule.countdown_ticks)
        bench.run(3)
    assert hearing.agent.share(3).v_hat > 0.6
    assert deaf.agent.share(3).v_hat == pytest.approx(0.6)
