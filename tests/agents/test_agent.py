"""One controller's phases, told everything by the test."""

from dataclasses import replace

import pytest

from agents.agent import Agent, Phase
from bridge.drives.odrive.frames import Command, identifier
from bridge.drives.odrive.node import OdriveNode
from bridge.frame import Frame
from bridge.messages import LeaderSpeed, PathState, PoseFix
from bridge.telemetry import AGENT_ROW, AGENT_SIGNALS, RowBuffer
from configs.brief import NetworkLink
from configs.briefing import agent_brief, plant_brief
from configs.errors import InfrastructureError
from configs.loading import load

NOWHERE = NetworkLink("test", "", "", "")
SCENARIO = load("two_robots")
COLUMNS = [signal.name for signal in AGENT_SIGNALS]


class Bench:
    """An agent of two_robots with its two drives standing still, and its neighbour's voice."""

    def __init__(self, robot: str = "r2", **changes) -> None:
        brief = replace(agent_brief(SCENARIO, robot, network=NOWHERE, bus=()), **changes)
        model = plant_brief(SCENARIO, network=NOWHERE).robots[0].drive
        self.rows: list[tuple[float, ...]] = []
        self.agent = Agent(brief, RowBuffer(AGENT_ROW, self._keep))
        self.axes = [OdriveNode(model, 0, 1), OdriveNode(model, 1, 2)]
        self.schedule = brief.schedule
        self.agent.take_pose(PoseFix(-1, 0, 1.95, 0.05, 1.57))
        self.agent.take_path("r1", PathState(-1, -1, 0.0, 0.6)) if brief.hears else None

    def _keep(self, _first: int, _count: int, rows: bytes, _final: bool) -> None:
        self.rows += AGENT_ROW.iter_unpack(rows)

    def tick(self, tick: int) -> list[Frame]:
        now_ns = self.schedule.bus_time_ns(tick)
        for axis in self.axes:
            for frame in axis.due(now_ns):
                self.agent.hear(*frame, now_ns)
        frames = list(self.agent.step(tick))
        for frame in frames:
            for axis in self.axes:
                axis.hear(frame, now_ns)
        return frames

    def countdown(self) -> None:
        for tick in range(-self.schedule.countdown_ticks, 0):
            self.tick(tick)


def test_a_controller_arms_in_the_countdown_and_drives_from_tick_0() -> None:
    bench = Bench()
    assert bench.agent.phase is Phase.ARMING
    bench.countdown()
    assert bench.agent.phase is Phase.READY
    frames = bench.tick(0)
    assert bench.agent.phase is Phase.DRIVING
    assert [frame.can_id for frame in frames] == [0x00E, 0x02E]
    assert any(axis.torque_demand() != 0.0 for axis in bench.axes)


def test_no_torque_but_zero_is_sent_before_control_starts() -> None:
    bench = Bench()
    for tick in range(-bench.schedule.countdown_ticks, 0):
        for frame in bench.tick(tick):
            if frame.can_id in (0x00E, 0x02E):
                assert frame.data == bytes(4)


def test_drives_that_do_not_arm_in_time_are_an_error_that_says_why() -> None:
    bench = Bench()
    for tick in range(-bench.schedule.countdown_ticks, 0):
        for axis in bench.axes:
            axis.hear(Frame(identifier(axis.node_id, Command.ESTOP), b""), 0)
        bench.tick(tick)
    with pytest.raises(InfrastructureError, match=r"r2.*ESTOP_REQUESTED"):
        bench.tick(0)


def test_a_drive_that_drops_out_stops_both_wheels_and_sharing_goes_on() -> None:
    bench = Bench()
    bench.countdown()
    bench.tick(0)
    stop = Frame(identifier(1, Command.ESTOP), b"")
    bench.axes[1].hear(stop, bench.schedule.bus_time_ns(0))
    for tick in range(1, 120):
        bench.tick(tick)
    assert bench.agent.phase is Phase.STOPPED
    assert "left drive (node 1) dropped out: ESTOP_REQUESTED" in bench.agent.stopped_because
    assert [axis.torque_demand() for axis in bench.axes] == [0.0, 0.0]
    before = bench.agent.share(120).s
    for tick in range(120, 140):
        bench.tick(tick)
    assert bench.agent.share(140).s > before


def test_the_closing_tick_disarms() -> None:
    bench = Bench()
    bench.countdown()
    bench.tick(0)
    bench.tick(bench.schedule.ticks)
    assert bench.agent.phase is Phase.DONE
    assert [axis.torque_demand() for axis in bench.axes] == [0.0, 0.0]


def test_what_is_missing_is_named() -> None:
    brief = agent_brief(SCENARIO, "r1", network=NOWHERE, bus=())
    agent = Agent(brief, RowBuffer(AGENT_ROW, lambda *_: None))
    assert agent.missing_to_start() == ["the localisation system", "the leader"]
    agent.take_leader(LeaderSpeed(((0, 0.6),)))
    agent.take_pose(PoseFix(-1, 0, 0.0, 0.0, 0.0))
    assert agent.missing_to_start() == []
    bench = Bench("r2")
    assert bench.agent.missing(0) == ["path state of r1"]
    assert bench.agent.missing(1) == ["pose"]  # of tick 0, a period late
    assert bench.agent.missing(2) == []
    bench.agent.take_path("r1", PathState(0, 0, 0.0, 0.6))
    bench.agent.take_pose(PoseFix(0, 0, 0.0, 0.0, 0.0))
    assert bench.agent.missing(0) == bench.agent.missing(1) == []


def test_a_row_holds_what_was_used_and_commanded() -> None:
    bench = Bench()
    bench.countdown()
    bench.agent.take_path("r1", PathState(0, 0, 0.0, 0.6))
    bench.tick(0)
    bench.agent._rows.finish()
    (row,) = (dict(zip(COLUMNS, values, strict=True)) for values in bench.rows)
    assert row["t_s"] == 0.0
    assert (row["x_hat_m"], row["y_hat_m"]) == (1.95, 0.05)
    assert (row["s"], row["s_dot"], row["v_r_hat"], row["neighbours"]) == (0.0, 0.6, 0.6, 1.0)
    assert (row["x_d_m"], row["y_d_m"]) == pytest.approx((2.0, 0.0))
    assert row["tau_right_Nm"] == bench.axes[0].torque_demand()


def test_a_leader_link_moves_the_estimate_and_its_absence_does_not() -> None:
    hearing, deaf = Bench("r1"), Bench("r2")
    hearing.agent.take_leader(LeaderSpeed(((0, 1.0),)))
    for bench in (hearing, deaf):
        bench.countdown()
        for tick in range(3):
            bench.tick(tick)
    assert hearing.agent.share(3).v_hat > 0.6
    assert deaf.agent.share(3).v_hat == pytest.approx(0.6)
