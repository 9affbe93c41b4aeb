"""A bus with bit timing in lockstep: when frames end, when they act, who is asked when."""

from collections.abc import Callable

import pytest
from support.babbler import Endless
from support.frame_faults import frame_fault, inject
from support.manual_port import ManualPort, Question

from bridge.can_bus.packet import Submitted
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import AxisState, Command, RebootAction, identifier
from bridge.frame import ERR, Frame
from bridge.wire.node import NodeState
from configs.brief import PlantBrief
from configs.connections import NetworkLink
from configs.loading import load, loads
from configs.resolve import plant_brief
from configs.ticks import Ticks
from plant.bus.build import timed_bus
from plant.bus.timed import TimedBus
from plant.robot import emulated_robot

US, MS = 1000, 1_000_000


def torques(right: float, left: float) -> list[Frame]:
    return [
        Frame(identifier(node, Command.SET_INPUT_TORQUE), f.ONE_FLOAT.pack(torque))
        for node, torque in ((0, right), (1, left))
    ]


ARM = torques(0.0, 0.0) + [
    Frame(identifier(node, Command.SET_AXIS_STATE), f.ONE_U32.pack(AxisState.CLOSED_LOOP_CONTROL))
    for node in (0, 1)
]


def brief(*overrides: str) -> PlantBrief:
    scenario = load(
        "two_robots",
        ('bus.timing="wire"', "clock.control_period_s=0.001", "clock.countdown_s=0.25", *overrides),
    )
    return plant_brief(scenario, network=NetworkLink("t", "", "", ""))


class Driven:
    """A bus of one robot whose controller says what a function of the tick gives."""

    def __init__(self, answer: Callable[[int], list[Frame]], *overrides: str) -> None:
        plant = brief(*overrides)
        self.schedule = plant.schedule
        self.began: list[int] = []
        self.robot = robot = emulated_robot(plant.robots[0])
        self.port = ManualPort()
        self.bus: TimedBus = timed_bus(plant, "r1", [robot], self.port, self.began.append, None)
        self.steps = self.bus.steps()
        self._answer = answer
        self.tick_number = -plant.schedule.countdown_ticks

    def tick(self) -> list[Question]:
        """One tick: the questions of it."""
        asks: list[Question] = []
        while (ask := self.port.next_question(self.steps)) is not None:
            asks.append(ask)
            said = self._answer(self.tick_number) if len(asks) == 1 else []
            self.port.said = [Submitted("r1", frame) for frame in said]
        self.tick_number += 1
        return asks

    def ticks(self, count: int) -> list[Question]:
        return [ask for _ in range(count) for ask in self.tick()]


def test_the_controller_is_asked_when_the_last_frame_of_its_drives_has_ended() -> None:
    driven = Driven(lambda _: [])
    driven.tick()
    start_ns = Ticks(driven.schedule).bus_time_ns(driven.tick_number)
    (ask,) = driven.tick()
    assert [passed.frame.can_id for passed in ask.transmitted] == [0x009, 0x029]
    first, second = (passed.end_ns for passed in ask.transmitted)
    # Two frames of 8 bytes at 1 Mbit/s: 108 to 132 bits each, and three between them.
    assert start_ns + 105 * US < first < start_ns + 132 * US
    assert first + 105 * US < second < first + 135 * US
    assert ask.stamp_ns == second
    assert ask.asked == "r1"


def test_a_torque_acts_within_the_tick_when_its_frame_has_ended() -> None:
    driven = Driven(lambda tick: ARM if tick < 0 else torques(0.1, 0.1), "robot.r1.v_m_s=0.0")
    driven.ticks(250)
    assert driven.robot.state.v == 0.0  # held during the countdown
    driven.tick()  # tick 0: torques of this tick arrive after about 0.4 ms
    mbar, r, share = driven.robot._body.mbar_1, 0.04, 0.001 - 0.00041
    assert driven.robot.moved_ns < Ticks(driven.schedule).bus_time_ns(1)
    driven.bus.advance(Ticks(driven.schedule).bus_time_ns(1))
    expected = r / 2 * 0.2 / mbar * share
    assert driven.robot.state.v == pytest.approx(expected, rel=0.1)


def test_firmware_acts_after_its_latency_and_in_order() -> None:
    driven = Driven(
        lambda tick: ARM if tick < 0 else torques(0.1 * tick, 0.0)[:1] + torques(0.3, 0.0)[:1],
        'drive.preset="realistic"',
        "drive.command_latency_s=[0.0002, 0.0002]",
        "drive.torque_constant_N_m_A=0.05",
    )
    driven.ticks(250)
    (ask,) = driven.tick()
    right, _ = driven.robot.drives
    assert right.input_torque_shaft == pytest.approx(0.3)  # the later of two
    ended = ask.stamp_ns + 2 * 90 * US + 200 * US
    assert right.fed_ns == pytest.approx(ended, abs=15 * US)


def test_who_says_more_than_the_transmit_queue_holds_is_refused_and_told() -> None:
    flood = [Frame(0x700, bytes(8))] * 40
    driven = Driven(lambda tick: flood if tick == -250 else [])
    driven.tick()
    assert driven.bus._hosts["r1"].node.counters.refused == 30
    freed = [count for ask in driven.ticks(5) for _, count in ask.freed]
    assert sum(freed) == 40


def test_on_a_starved_bus_the_controller_is_asked_at_the_end_of_each_tick() -> None:
    driven = Driven(lambda _: [])
    driven.ticks(3)
    driven.bus.wire.attach("babbler", queue=Endless(Frame(0x000, bytes(8))))
    asks = driven.ticks(3)
    ends = [Ticks(driven.schedule).bus_time_ns(driven.tick_number - n) - 1 for n in (2, 1, 0)]
    assert [ask.stamp_ns for ask in asks] == ends


def test_drives_that_hear_nothing_through_a_babbler_trip_their_watchdog() -> None:
    driven = Driven(
        lambda tick: ARM if tick == -250 else torques(0.1, 0.1), "drive.watchdog_s=0.05"
    )
    driven.ticks(20)
    right, _ = driven.robot.drives
    assert right.torque_demand_shaft(0.0) == pytest.approx(0.1)
    driven.bus.wire.attach("babbler", queue=Endless(Frame(0x000, bytes(8))))
    driven.ticks(60)
    assert right.torque_demand_shaft(0.0) == 0.0


def test_a_client_that_departs_leaves_the_wire() -> None:
    driven = Driven(lambda _: [])
    driven.tick()
    driven.bus.submit([Submitted(7, Frame(0x700, b""))] * 3)
    driven.port.gone = [7]
    asks = driven.ticks(2)
    # The frame that was on the wire is completed, the others have gone.
    assert sum(p.frame.can_id == 0x700 for ask in asks for p in ask.transmitted) <= 1


def test_the_load_of_a_robot_at_1_khz_is_forty_percent() -> None:
    driven = Driven(
        lambda tick: ARM if tick < 0 else torques(0.05 + tick * 1e-6, 0.05), "duration_s=4"
    )
    driven.ticks(250)
    busy, now = driven.bus.wire.busy_ns, driven.bus.wire.now_ns
    driven.ticks(1000)
    load = (driven.bus.wire.busy_ns - busy) / (driven.bus.wire.now_ns - now)
    assert load == pytest.approx(0.40, abs=0.02)


def test_what_crossed_the_wire_is_counted_whoever_sent_it() -> None:
    driven = Driven(lambda _: torques(0.0, 0.0))
    asks = driven.ticks(20)
    ended = [passed for ask in asks for passed in ask.transmitted]
    assert driven.bus.crossed >= len(ended) > 20 * 4 - 4
    assert driven.bus.crossed <= 20 * 4 + 2 * 2  # encoders, torques; heartbeats


def test_encoder_frames_have_a_period_of_their_own() -> None:
    driven = Driven(
        lambda _: torques(0.0, 0.0), "clock.control_period_s=0.005", "drive.encoder_period_s=0.001"
    )
    asks = driven.ticks(4)
    ended = [passed.frame.can_id for ask in asks for passed in ask.transmitted]
    assert ended.count(identifier(0, Command.GET_ENCODER_ESTIMATES)) == 3 * 5 + 1
    assert driven.tick_number == -driven.schedule.countdown_ticks + 4


def test_error_frames_reach_the_clients_and_the_frame_is_sent_again() -> None:
    driven = Driven(lambda _: [])
    driven.tick()
    inject(driven.bus.wire, frame_fault("can_corrupt", can_id=0x009, count=1))
    (ask,) = driven.tick()
    kinds = [passed.frame.can_id for passed in ask.transmitted]
    errors = [passed for passed in ask.transmitted if passed.frame.can_id & ERR]
    assert [passed.frame.can_id & ~ERR for passed in errors] == [0x08]
    assert errors[0].as_heard_by("r1").frame.data[7] > 0  # the receive error counter of its node
    assert errors[0].as_heard_by(7).frame.data[6:] == bytes(2)  # who only listens has none
    assert [can_id for can_id in kinds if not can_id & ERR] == [0x009, 0x029]


def test_an_error_frame_from_a_client_destroys_what_starts_with_it_and_leaves_its_queue() -> None:
    driven = Driven(lambda _: torques(0.1, 0.1))
    driven.ticks(3)
    ask = driven.port.next_question(driven.steps)
    driven.port.said = [Submitted("r1", torques(0.1, 0.1)[0]), Submitted(7, Frame(ERR, b""))]
    driven.port.next_question(driven.steps)
    after = driven.ticks(1)
    passed = [p for a in (ask, *after) if a is not None for p in a.transmitted]
    assert [p.frame.can_id & ~ERR for p in passed if p.frame.can_id & ERR] == [0x08]
    assert [p.frame.can_id for p in passed].count(torques(0.1, 0.1)[0].can_id) == 2
    assert driven.bus._hosts["r1"].node.confinement.tec == 8 - 3  # three have been sent since
    assert driven.bus._hosts[7].node.confinement.rec == 0
    assert (7, 1) in [freed for a in after for freed in a.freed]


def test_who_only_listens_is_no_node_on_the_wire() -> None:
    driven = Driven(lambda _: [])
    nodes = len(driven.bus.wire._main.nodes)
    driven.port.gone = [7]  # which has sent nothing
    driven.ticks(3)
    assert len(driven.bus.wire._main.nodes) == nodes
    driven.bus.submit([Submitted(7, Frame(0x700, b""))])
    assert len(driven.bus.wire._main.nodes) == nodes + 1


def test_a_drive_that_goes_bus_off_falls_silent_and_the_controller_hears_the_other() -> None:

    driven = Driven(lambda _: [])
    driven.tick()
    inject(driven.bus.wire, frame_fault("can_corrupt", can_id=0x009, count=32))
    driven.ticks(20)
    (ask, *_) = driven.tick()
    assert [passed.frame.can_id for passed in ask.transmitted] == [0x029]
    assert driven.bus._drives[0].node.state is NodeState.BUS_OFF


def test_a_host_that_nobody_acknowledges_hears_of_it_and_finds_its_queue_full() -> None:
    driven = Driven(lambda tick: [Frame(0x700, b"")] if tick < 0 else [])
    host = driven.bus._hosts["r1"].node
    driven.bus.wire.disconnect(host)
    heard = [passed.frame for ask in driven.ticks(40) for passed in ask.transmitted]
    kinds = {frame.can_id & ~ERR for frame in heard if frame.can_id & ERR}
    assert {0x04, 0x20} <= kinds
    assert len(host.queue.entries) == 10
    assert host.counters.refused > 0


def test_frames_of_seven_robots_on_one_bus_come_to_each_in_its_turn() -> None:
    robots = "".join(
        f'[[robot]]\nname = "r{n}"\nbus = "fleet"\npose = {{ x_m = 0.0, y_m = {n}.0 }}\n'
        for n in range(1, 8)
    )
    text = (
        'schema = 1\nname = "seven"\nduration_s = 1.0\n[clock]\ncontrol_period_s = 0.005\n'
        'countdown_s = 0.5\nshare_period_s = 0.02\n[bus]\ntiming = "wire"\n' + robots
    )
    plant = plant_brief(loads("seven", text), network=NetworkLink("t", "", "", ""))
    port = ManualPort()
    emulated = [emulated_robot(robot) for robot in plant.robots]
    steps = timed_bus(plant, "fleet", emulated, port, lambda _: None, None).steps()
    for _ in range(3):
        asked, stamps = [], []
        while (ask := port.next_question(steps)) is not None:
            asked.append(ask.asked)
            stamps.append(ask.stamp_ns)
        assert sorted(asked) == [f"r{n}" for n in range(1, 8)]
        assert stamps == sorted(stamps)
    nodes = [node for robot in plant.robots for node in (robot.right_node, robot.left_node)]
    assert nodes == list(range(14))


def test_a_drive_that_was_gone_for_good_is_back_after_a_reboot() -> None:
    fault = 'fault=[{kind="drive_reboot", at_s=0.01, robots=["r1"], wheel="right"}]'
    driven = Driven(lambda _: [], fault, "drive.boot_s=0.02")
    driven.ticks(1)
    right, _ = driven.robot.drives
    right.restart(RebootAction.ENTER_DFU_MODE, 1 * MS)
    driven.ticks(driven.schedule.countdown_ticks + 10 - 1)
    for heard in (set(), {0x001, 0x009}):
        said = {passed.frame.can_id for ask in driven.ticks(20) for passed in ask.transmitted}
        assert said & {0x001, 0x009} == heard


@pytest.mark.parametrize("kind", ["can_drop", "can_duplicate", "can_delay", "can_corrupt"])
def test_a_client_has_all_its_credit_again_whatever_became_of_its_frames(kind: str) -> None:
    sent = {tick: torques(0.1, 0.1) for tick in range(-240, -200)}
    driven = Driven(lambda tick: sent.get(tick, []), "bus.restart_s=0.01")
    driven.tick()
    inject(driven.bus.wire, frame_fault(kind, direction="to_drives", count=33))
    freed = [count for ask in driven.ticks(100) for _, count in ask.freed]
    host = driven.bus._hosts["r1"].node
    assert sum(freed) == 80
    assert host.queue.entries == []
    # Destroyed 32 times in a row it went bus-off, with what it had queued.
    assert (host.counters.refused > 0) is (kind == "can_corrupt")
