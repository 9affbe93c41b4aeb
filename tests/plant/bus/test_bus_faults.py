"""Each kind of fault of frames, buses and CAN controllers: before, during and after."""

import pytest
from support.emulated_fleet import Fleet
from support.manual_port import ManualPort
from support.robot_bench import NOWHERE

from agents.guard import Phase
from bridge.can_bus.packet import Submitted
from bridge.drives.odrive.frames import AxisState, Command, identifier
from bridge.frame import RTR, Frame
from bridge.wire.node import NodeState
from configs.faults.kinds import KINDS
from configs.loading import load
from configs.resolve import plant_brief
from configs.ticks import Ticks
from plant.bus.build import timed_bus
from plant.bus.ideal import IdealBus
from plant.disturbance import BUS_EFFECTS
from plant.faults import EFFECTS, STRIKES, BusFaults
from plant.robot import emulated_robot

WIRE = ('bus.timing="wire"',)
BOTH = pytest.mark.parametrize("timing", [(), WIRE], ids=["ideal", "wire"])
ENCODER, ENCODER_LEFT = (identifier(n, Command.GET_ENCODER_ESTIMATES) for n in (0, 1))
TORQUE = identifier(0, Command.SET_INPUT_TORQUE)
HEARTBEAT = identifier(0, Command.HEARTBEAT)
CLOSED, IDLE = AxisState.CLOSED_LOOP_CONTROL, AxisState.IDLE
H = 0.005
AFTERWARDS = ["drive_error", "stopped", "rearming", "rearmed"]


def fault(kind: str, at_s: float, for_s: float | None = None, **keys: object) -> str:
    """A fault on r1 as a scenario has it."""
    parts = {"kind": f'"{kind}"', "robots": '["r1"]', "at_s": at_s, "for_s": for_s} | keys
    texts = {
        k: f'"{v}"' if isinstance(v, str) and v[0] not in '"[' else v for k, v in parts.items()
    }
    return f"{{{', '.join(f'{k}={v}' for k, v in texts.items() if v is not None)}}}"


def test_every_kind_of_the_plant_has_one_effect() -> None:
    plant = [kind for kind, cls in KINDS.items() if cls.PLACE == "plant"]
    assert sorted(plant) == sorted([*EFFECTS, *STRIKES, *BUS_EFFECTS])


# --- frames ---------------------------------------------------------------------------------------


@BOTH
def test_dropped_encoder_frames_stop_the_robot_at_their_age_and_it_arms_again(
    timing: tuple[str, ...],
) -> None:
    fleet = Fleet(fault("can_drop", 0.2, 0.2, can_id=ENCODER), overrides=timing).until(0.8)
    assert fleet.count(0.0, 0.2, ENCODER) == fleet.count(0.0, 0.2, ENCODER_LEFT) == 40
    assert fleet.count(0.2, 0.4, ENCODER) == 0
    assert fleet.count(0.2, 0.4, ENCODER_LEFT) == 40
    assert fleet.count(0.4, 0.8, ENCODER) == 80
    # Ten periods after the last frame; every tick is computed, so torque 0 comes at once.
    assert fleet.happened() == AFTERWARDS
    assert fleet.reasons() == ["right drive (node 0): no encoder frames any more"]
    stop = next(event for event in fleet.run.events if event.kind == "stopped")
    assert stop.tick == pytest.approx(0.25 / H, abs=1)
    assert fleet.phase() is Phase.DRIVING
    assert fleet.states() == [CLOSED, CLOSED]
    assert fleet.happened("r2") == []


@BOTH
def test_so_many_torque_frames_are_dropped_and_nobody_else_notices(timing: tuple[str, ...]) -> None:
    drop = fault("can_drop", 0.1, count=3, can_id=TORQUE, direction="to_drives")
    fleet, undisturbed = Fleet(drop, overrides=timing), Fleet(overrides=timing)
    for one in (fleet, undisturbed):
        one.until(0.3)
    assert [one.count(0.0, 0.3, TORQUE) for one in (fleet, undisturbed)] == [57, 60]
    assert fleet.count(0.1, 0.1 + 3 * H, TORQUE) == 0
    assert fleet.happened() == []
    assert fleet.passed("r2") == undisturbed.passed("r2")


@BOTH
def test_frames_of_the_other_direction_pass(timing: tuple[str, ...]) -> None:
    drop = fault("can_drop", 0.1, can_id=TORQUE, direction="from_drives")
    assert Fleet(drop, overrides=timing).until(0.3).count(0.0, 0.3, TORQUE) == 60


@BOTH
def test_so_many_frames_are_doubled(timing: tuple[str, ...]) -> None:
    double = fault("can_duplicate", 0.1, 0.2, count=5, can_id=TORQUE)
    fleet = Fleet(double, overrides=timing).until(0.3)
    assert fleet.count(0.0, 0.1, TORQUE) == 20
    torques = fleet.passed(can_id=TORQUE)
    assert len(torques) == 60 + 5
    assert [frame.data for frame in torques[20:30:2]] == [frame.data for frame in torques[21:30:2]]
    assert fleet.happened() == []


def test_doubled_encoder_frames_are_taken_for_a_second_drive() -> None:
    fleet = Fleet(fault("can_duplicate", 0.1, 2.0, can_id=ENCODER)).until(1.8)
    assert "second drive with its node id" in fleet.reasons()[0]


def test_on_an_ideal_bus_delayed_frames_come_at_the_first_tick_after_their_time_in_order() -> None:
    late = fault("can_delay", 0.1, 0.02, delay_s=0.0149, can_id=ENCODER)
    fleet, undisturbed = Fleet(late), Fleet()
    came, sent = (
        [(round(f.t_s / H), f.data) for f in one.until(0.3).passed(can_id=ENCODER)]
        for one in (fleet, undisturbed)
    )
    assert came[:20] == sent[:20]
    # Those of ticks 20 to 23 come three ticks later, before the newer ones.
    assert [tick for tick, _ in came[20:28]] == [23, 24, 24, 25, 25, 26, 26, 27]
    assert came[20][1] == sent[20][1]
    assert [tick for tick, _ in came[28:]] == [tick for tick, _ in sent[28:]]
    assert fleet.happened() == []


def test_delayed_set_points_reach_the_drive_late_and_its_watchdog_counts_from_there() -> None:
    late = fault("can_delay", 0.1, delay_s=0.02, direction="to_drives")
    fleet = Fleet(late).until(0.3)
    torques = [round(frame.t_s / H) for frame in fleet.passed(can_id=TORQUE)]
    assert torques == [*range(20), *range(24, 60)]
    assert fleet.robot().drives[0].fed_ns == Ticks(fleet.plant.schedule).bus_time_ns(59)
    assert fleet.states() == [CLOSED, CLOSED]


def test_on_a_wire_a_delayed_frame_goes_to_arbitration_later_by_exactly_that() -> None:
    late = fault("can_delay", 0.105, count=1, delay_s=0.0032, can_id=ENCODER)
    fleet, undisturbed = (
        Fleet(*faults, overrides=WIRE).until(0.12).passed(can_id=ENCODER)
        for faults in ((late,), ())
    )
    ends = [frame.t_s for frame in undisturbed]
    assert [frame.t_s for frame in fleet[:21]] == ends[:21]
    assert fleet[21].t_s == pytest.approx(ends[21] + 0.0032, abs=1e-9)
    assert fleet[21].data == undisturbed[21].data
    assert len(fleet) == len(undisturbed)


def test_corrupted_frames_are_sent_again_and_the_error_counters_move() -> None:
    fleet = Fleet(fault("can_corrupt", 0.1, 0.2, count=3, can_id=ENCODER), overrides=WIRE).until(
        0.1
    )
    right, left = (drive.node for drive in fleet.bus()._drives)
    assert right.confinement.tec == left.confinement.tec == 0
    fleet.until(0.105)
    # Three times destroyed, then sent: 3 times 8 less 1.
    assert right.confinement.tec == 24 - 1
    assert left.confinement.tec == 0
    assert fleet.bus().wire.errors == right.counters.errors == 3
    fleet.until(0.3)
    assert fleet.count(0.0, 0.3, ENCODER) == 60
    assert right.confinement.tec == 0
    assert fleet.happened() == []


def test_a_drive_all_whose_frames_are_corrupted_goes_bus_off_and_comes_back_when_it_may() -> None:
    corrupt = fault("can_corrupt", 0.1, 0.05, can_id=ENCODER)
    fleet = Fleet(corrupt, overrides=(*WIRE, "bus.drive_restart_s=0.15")).until(0.11)
    right = fleet.bus()._drives[0].node
    assert right.state is NodeState.BUS_OFF
    assert right.counters.errors == 32
    fleet.until(0.8)
    assert right.state is NodeState.ERROR_ACTIVE
    assert fleet.count(0.1, 0.25, ENCODER) == 0
    # 1408 bits after its restart; then every tick again.
    assert fleet.count(0.26, 0.8, ENCODER) == pytest.approx(0.54 / H, abs=2)
    assert fleet.happened() == AFTERWARDS


# --- the bus --------------------------------------------------------------------------------------


@BOTH
def test_a_cut_bus_stops_the_robot_and_its_drives_and_it_drives_on_afterwards(
    timing: tuple[str, ...],
) -> None:
    fleet = Fleet(fault("bus_cut", 0.2, 0.4), overrides=timing).until(0.2)
    assert fleet.states() == [CLOSED, CLOSED]
    fleet.until(0.6)
    assert fleet.phase() is Phase.STOPPED
    assert fleet.passed()[-1].t_s < 0.2
    assert fleet.states() == [IDLE, IDLE]
    assert fleet.watchdogs() == [True, True]
    fleet.until(1.3)
    assert fleet.happened() == AFTERWARDS
    assert fleet.phase() is Phase.DRIVING
    assert fleet.states() == [CLOSED, CLOSED]
    assert fleet.watchdogs() == [False, False]
    assert fleet.count(0.6, 1.3, ENCODER) == pytest.approx(0.7 / H, abs=1)
    assert (fleet.phase("r2"), fleet.happened("r2")) == (Phase.DRIVING, [])


def test_a_controller_that_is_cut_off_is_not_acknowledged_and_its_queue_fills() -> None:
    fleet = Fleet(fault("bus_cut", 0.2, 0.4), overrides=WIRE).until(0.6)
    bus = fleet.bus()
    host, right, left = bus._hosts["r1"].node, *(drive.node for drive in bus._drives)
    assert host.confinement.tec == 128  # passive, never bus-off
    assert len(host.queue.entries) == 10
    assert host.counters.refused > 0
    # The drives have each other.
    assert right.confinement.tec == left.confinement.tec == 0
    assert right.counters.sent > 0.6 / H
    stale = [entry.frame for entry in host.queue.entries]
    fleet.until(0.605)
    after = [frame for frame in fleet.passed() if frame.t_s >= 0.6 and not frame.of_drive]
    assert [Frame(frame.can_id, frame.data) for frame in after[:10]] == stale
    fleet.until(1.3)
    assert host.confinement.tec == 0


# --- CAN controllers ------------------------------------------------------------------------------


@BOTH
def test_a_silent_node_says_and_hears_nothing_and_speaks_again(timing: tuple[str, ...]) -> None:
    silent = fault("node_silent", 0.2, 0.3, wheel="left")
    fleet = Fleet(silent, overrides=timing).until(0.5)
    assert fleet.count(0.2, 0.5, ENCODER_LEFT) == 0
    assert fleet.count(0.2, 0.5, ENCODER) == 60
    # The left one is not told to stop, its watchdog does; the right one is told.
    assert fleet.states() == [IDLE, IDLE]
    assert fleet.watchdogs() == [False, True]
    assert fleet.reasons() == ["left drive (node 1): no encoder frames any more"]
    fleet.until(1.2)
    assert fleet.count(0.5, 1.2, ENCODER_LEFT) == pytest.approx(140, abs=1)
    assert fleet.happened() == AFTERWARDS


def test_a_silent_node_does_not_acknowledge_and_nothing_old_is_sent_afterwards() -> None:
    fleet = Fleet(fault("node_silent", 0.2, 0.2, wheel="both"), overrides=WIRE).until(0.4)
    host = fleet.bus()._hosts["r1"].node
    assert host.confinement.tec == 128
    right = fleet.bus()._drives[0].node
    assert (right.confinement.tec, right.queue.entries) == (0, [])
    fleet.until(0.41)
    assert fleet.count(0.4, 0.405, ENCODER) == 1


@pytest.mark.parametrize("restart", [None, 0.15])
def test_a_node_that_is_bus_off_is_away_until_it_restarts(restart: float | None) -> None:
    overrides = () if restart is None else (f"bus.drive_restart_s={restart}",)
    off = fault("node_bus_off", 0.2, wheel="right")
    fleet = Fleet(off, overrides=(*WIRE, *overrides)).until(0.34)
    right = fleet.bus()._drives[0].node
    assert right.state is NodeState.BUS_OFF
    assert fleet.count(0.0, 0.2, ENCODER) == 40
    assert fleet.count(0.2, 0.35, ENCODER) == 0
    assert fleet.phase() is Phase.STOPPED
    assert fleet.watchdogs() == [True, False]
    fleet.until(1.0)
    if restart is None:
        assert right.state is NodeState.BUS_OFF
        assert fleet.happened() == ["drive_error", "stopped"]
        return
    # Back after 128 times 11 recessive bits.
    assert fleet.passed(can_id=ENCODER)[40].t_s == pytest.approx(0.35 + 1408e-6, abs=0.003)
    assert right.state is NodeState.ERROR_ACTIVE
    assert fleet.happened() == AFTERWARDS


def test_a_babbling_node_adds_a_frame_a_period_and_the_robot_drives_on() -> None:
    babble = fault("node_babbling", 0.2, 0.1, wheel="left", can_id=0x010, period_s=0.0005)
    fleet = Fleet(babble, overrides=WIRE).until(0.4)
    assert fleet.count(0.2, 0.3, 0x010) == pytest.approx(200, abs=1)
    assert fleet.count(0.0, 0.2, 0x010) == fleet.count(0.302, 0.4, 0x010) == 0
    assert fleet.count(0.0, 0.4, ENCODER) == fleet.count(0.0, 0.4, ENCODER_LEFT) == 80
    assert fleet.happened() == []


def test_a_babbling_idiot_starves_all_others_until_it_stops() -> None:
    babble = fault("node_babbling", 0.2, 0.3, wheel="left", period_s=0.00005)
    fleet = Fleet(babble, overrides=WIRE).until(0.5)
    assert fleet.count(0.201, 0.5, 0x000) > 2000
    assert fleet.count(0.205, 0.5, ENCODER) == fleet.count(0.205, 0.5, TORQUE) == 0
    assert fleet.phase() is Phase.STOPPED
    assert fleet.watchdogs() == [True, True]
    fleet.until(1.2)
    assert fleet.happened() == AFTERWARDS
    assert fleet.phase("r2") is Phase.DRIVING


# --- several robots, several faults ---------------------------------------------------------------


SHARED = ('robot.r1.bus="fleet"', 'robot.r2.bus="fleet"')


@BOTH
@pytest.mark.parametrize("kind", ["bus_cut", "can_drop", "node_silent"])
def test_on_a_shared_bus_the_other_robot_is_left_alone(kind: str, timing: tuple[str, ...]) -> None:
    fleet = Fleet(fault(kind, 0.2, 0.2), overrides=(*SHARED, *timing)).until(0.4)
    of_r2 = identifier(2, Command.GET_ENCODER_ESTIMATES)
    assert fleet.count(0.2, 0.4, ENCODER, "fleet") == 0
    assert fleet.count(0.2, 0.4, of_r2, "fleet") == 40
    assert fleet.watchdogs() == [True, True]
    assert fleet.phase() is Phase.STOPPED
    fleet.until(1.2)
    assert fleet.happened() == AFTERWARDS
    assert fleet.happened("r2") == []
    assert fleet.states("r2") == [CLOSED, CLOSED]


@BOTH
def test_when_all_faults_of_a_bus_have_ended_nothing_is_left_of_them(
    timing: tuple[str, ...],
) -> None:
    kinds = ("can_drop", "can_duplicate", "can_delay", "bus_cut", "node_silent", "node_silent")
    faults = [fault(kind, 0.1 + 0.02 * n, 0.07) for n, kind in enumerate(kinds)]
    fleet = Fleet(*faults, overrides=timing).until(1.2)
    assert fleet.run._buses["r1"].faults.schedule.acting == ()
    assert fleet.happened() == AFTERWARDS
    assert fleet.states() == [CLOSED, CLOSED]
    counts = [fleet.count(1.0, 1.2, can_id) for can_id in (ENCODER, ENCODER_LEFT, TORQUE)]
    assert counts == [40, 40, 40]
    if timing:
        assert not fleet.bus().wire._apart
        assert not fleet.bus().wire.faults.acting
    else:
        assert not fleet.run._buses["r1"]._interference.acts


def test_a_silent_drive_in_a_cut_bus_joins_the_other_one_when_it_speaks_again() -> None:
    cut, silent = fault("bus_cut", 0.1, 0.3), fault("node_silent", 0.15, 0.1, wheel="left")
    fleet = Fleet(cut, silent, overrides=WIRE).until(0.2)
    right, left = (drive.node for drive in fleet.bus()._drives)
    assert right.confinement.tec == 128  # alone
    sent = left.counters.sent
    fleet.until(0.4)
    assert left.counters.sent > sent
    assert right.confinement.tec < 128
    assert fleet.count(0.1, 0.4, ENCODER) == 0
    fleet.until(1.2)
    assert fleet.happened() == AFTERWARDS


# --- real time ------------------------------------------------------------------------------------


class Wall:
    """An ideal bus in real time, whose clients are the test."""

    def __init__(self, *faults: str) -> None:
        scenario = load(
            "two_robots_100hz", (f"fault=[{', '.join(faults)}]", 'clock.mode="realtime"')
        )
        plant = plant_brief(scenario, network=NOWHERE)
        self.port = ManualPort()
        robot = emulated_robot(plant.robots[0])
        acting = BusFaults(plant.faults, [robot], plant.schedule)
        self.bus = IdealBus([robot], plant.schedule, 1, self.port, lambda _: None, None, acting)
        self.schedule = plant.schedule
        self.tick_number = 0

    def tick(self) -> list[int]:
        """A tick: identifiers that clients hear."""
        bus_ns = Ticks(self.schedule).bus_time_ns(self.tick_number)
        self.port.questions.clear()
        self.bus.move(bus_ns)
        self.bus.faults.begin(self.tick_number)
        self.bus.send_due(bus_ns)
        self.tick_number += 1
        return self._heard()

    def say(self, *frames: Frame, after_ns: int) -> list[int]:
        """Clients send frames so long after the tick: identifiers that they hear at once."""
        self.port.questions.clear()
        self.port.frames = list(frames)
        self.bus.react(Ticks(self.schedule).bus_time_ns(self.tick_number - 1) + after_ns)
        return self._heard()

    def _heard(self) -> list[int]:
        return [frame.can_id for given in self.port.questions for frame in given.frames]


REQUEST = Frame(identifier(0, Command.GET_BUS_VOLTAGE_CURRENT) | RTR, bytes(8))
ANSWER = REQUEST.can_id & ~RTR
MS = 1_000_000


def test_in_real_time_a_dropped_frame_is_lost_at_the_drives_end() -> None:
    wall = Wall(fault("can_drop", 0.01, 0.01, can_id=ANSWER, direction="to_drives"))
    heard = []
    for _ in range(3):
        wall.tick()
        heard.append(wall.say(REQUEST, after_ns=MS))
    assert heard == [[ANSWER], [], [ANSWER]]


def test_in_real_time_a_delayed_frame_comes_with_the_next_frame_or_tick_after_its_time() -> None:
    wall = Wall(fault("can_delay", 0.01, 0.01, delay_s=0.003, can_id=ANSWER, direction="to_drives"))
    wall.tick()
    assert wall.say(REQUEST, after_ns=MS) == [ANSWER]
    wall.tick()
    assert wall.say(REQUEST, after_ns=MS) == []
    assert wall.say(after_ns=5 * MS) == [ANSWER]
    assert wall.say(REQUEST, REQUEST, after_ns=8 * MS) == []
    assert wall.tick().count(ANSWER) == 0
    assert wall.tick().count(ANSWER) == 2
    assert not wall.bus._interference.acts


def test_in_real_time_a_cut_bus_passes_nothing_either_way() -> None:
    wall = Wall(fault("bus_cut", 0.01, 0.02))
    heard = [(wall.tick() != [], wall.say(REQUEST, after_ns=MS)) for _ in range(4)]
    assert heard == [(True, [ANSWER]), (False, []), (False, []), (True, [ANSWER])]


def test_in_real_time_a_client_on_a_cut_wire_is_not_acknowledged_and_its_queue_fills() -> None:
    changes = (f"fault=[{fault('bus_cut', 0.01, 0.01)}]", 'clock.mode="realtime"', *WIRE)
    plant = plant_brief(load("two_robots_100hz", changes), network=NOWHERE)
    robot, port = emulated_robot(plant.robots[0]), ManualPort()
    bus = timed_bus(plant, "r1", [robot], port, lambda _: None, None)
    freed = []
    for tick in range(3):
        bus.advance(Ticks(plant.schedule).bus_time_ns(tick))
        bus.faults.begin(tick)
        bus.submit([Submitted(1, REQUEST)] * 12)
        bus.advance(Ticks(plant.schedule).bus_time_ns(tick) + 8 * MS)
        told = [*port._freed, *(one for given in port.questions for one in given.freed)]
        freed.append(sum(count for _, count in told) - sum(freed))
        counts = bus.node_counts()["1"]
        assert (counts["errors"] > 0) is (tick > 0)
    # Twelve are submitted, ten have room and are sent; on the cut wire ten stay; then those are.
    assert freed == [12, 2, 22]


def test_a_fault_that_is_told_its_end_while_it_acts_goes_on_counting() -> None:
    drop = fault("can_drop", 0.1, count=30, can_id=TORQUE, direction="to_drives")
    fleet = Fleet(drop, fault("can_delay", 0.15, 0.02, can_id=0x7FF)).until(0.12)
    assert fleet.run._buses["r1"].faults.schedule.clear("can_drop", 60)
    assert fleet.until(0.4).count(0.1, 0.4, TORQUE) == 60 - 30
