"""What a CAN interface does to a controller in real time: errors, echoes, what it gathered."""

import errno
from collections import deque
from dataclasses import replace
from types import SimpleNamespace

import can
import pytest
from support.clocks import ManualClock
from support.robot_bench import ZERO, Bench, set_points

from agents.bus_health import TOLERATED_NS, BusHealth
from agents.guard import Phase
from agents.realtime import RealtimeLoop
from agents.subscriptions import Subscriptions
from bridge.can_bus.frame_bus import in_frames
from bridge.can_bus.pythoncan import to_frame, to_message
from bridge.frame import ERR, Frame
from bridge.network import keys
from bridge.network.barrier import Hellos
from bridge.network.messages import PoseFix
from bridge.process.lifecycle import Stop
from configs.edges import InEdge
from configs.errors import InfrastructureError, PeerLostError
from configs.events import KINDS
from configs.ticks import Ticks

S = 1_000_000_000
DOWN = can.CanOperationError("Failed to transmit: [Errno 100] Network is down", errno.ENETDOWN)
FULL = can.CanOperationError("Failed to transmit: [Errno 105] No buffer space", errno.ENOBUFS)
REARM = ("host.rearm=true", "clock.mode='realtime'", "clock.countdown_s=0.3")


def test_our_own_bus_is_gone_with_its_first_error_but_a_full_queue() -> None:
    health = BusHealth("r1", 0)
    health.failed(FULL, 0)
    with pytest.raises(PeerLostError, match="r1: lost its bus"):
        health.failed(DOWN, 1)


def test_errors_of_another_interface_are_borne_up_to_the_limit() -> None:
    health = BusHealth("r1", 5 * S)
    for now_ns in range(0, 5 * S + 1, S // 10):
        health.failed(DOWN, now_ns)
    with pytest.raises(InfrastructureError, match=r"r1: gave up its bus after 5\.1 s of errors"):
        health.failed(OSError(errno.ENODEV, "No such device"), 5 * S + S // 10)


def test_one_success_begins_the_count_anew() -> None:
    health = BusHealth("r1", 5 * S)
    health.failed(DOWN, 0)
    health.sent()
    assert health.fault(10 * S) is None
    health.failed(DOWN, 10 * S)
    assert health.fault(10 * S) is None
    assert health.fault(10 * S + TOLERATED_NS) == f"bus error: {DOWN}"


def test_a_full_queue_is_a_fault_when_it_lasts_and_never_the_end() -> None:
    health = BusHealth("r1", 5 * S)
    for now_ns in range(0, 60 * S, S):
        health.failed(FULL, now_ns)
    assert health.unsent == 60
    assert health.errors == 0
    assert "No buffer space" in health.fault(60 * S)


class Wire(can.BusABC):
    """A hardware interface with the two drives of a bench on it, that can be taken down."""

    def __init__(self, bench: Bench, clock: ManualClock, power_up_ns: int) -> None:
        super().__init__(channel="can0")
        self.bench, self.clock, self.power_up_ns = bench, clock, power_up_ns
        self.error: Exception | None = None
        self.told = False  # SocketCAN says once on reception that its interface went down
        self.inbox: deque[Frame] = deque()
        self.log: list[tuple[int, Frame]] = []
        self.plan: dict[int, Exception | None] = {}  # by bus time
        self.others: dict[int, list[Frame]] = {}  # what somebody else sends, by bus time
        self.echoes = False

    @property
    def bus_ns(self) -> int:
        return self.clock.now_ns - self.power_up_ns

    def _live(self) -> None:
        for at_ns in [at_ns for at_ns in self.plan if at_ns <= self.bus_ns]:
            self.error, self.told = self.plan.pop(at_ns), False
        for at_ns in [at_ns for at_ns in self.others if at_ns <= self.bus_ns]:
            self.inbox.extend(self.others.pop(at_ns))
        for axis in self.bench.axes:
            frames = axis.due(self.bus_ns)
            if self.error is None:
                self.inbox.extend(frames)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        self._live()
        if self.error is not None:
            raise self.error
        frame = to_frame(msg)
        self.log.append((self.bus_ns, frame))
        if self.echoes:
            self.inbox.append(frame)
        for axis in self.bench.axes:
            axis.on_frame(frame, self.bus_ns)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        self._live()
        if not self.inbox and timeout:
            self.clock.now_ns += min(round(timeout * 1e9), 200_000)
            self._live()
        if self.error is not None and not self.told and self.error is not FULL:
            self.told = True
            raise self.error
        if not self.inbox:
            return None
        frame = self.inbox.popleft()
        return to_message(frame.can_id, frame.data)


class PoseLink:
    """A network on which the localisation system speaks every 10 ms, and nobody else."""

    def __init__(self, bench: Bench, clock: ManualClock, epoch_ns: int) -> None:
        self.bench, self.clock, self.epoch_ns = bench, clock, epoch_ns
        self.declared: list[tuple[int, str, str]] = []  # tick, what was done, key

    @property
    def tick(self) -> int:
        return (self.clock.now_ns - self.epoch_ns) // self.bench.schedule.period_ns

    def subscribe(self, key: str, _tag: str) -> None:
        self.declared.append((self.tick, "declare", key))

    def unsubscribe(self, key: str) -> None:
        self.declared.append((self.tick, "undeclare", key))

    def receive(self, _timeout_s: float) -> None:
        period_ns, tick = self.bench.schedule.period_ns, self.tick
        if Ticks(self.bench.schedule).localises(tick) and self.bench.pose is not None:
            self.bench.agent.receive_pose(PoseFix(tick, tick * period_ns, *self.bench.pose))


class Rig:
    """A controller's loop in real time on a wire, by a clock of its own."""

    def __init__(self, *overrides: str, duration_s: float = 3.0, ours=False, **changes) -> None:
        self.clock = ManualClock(10 * S, reading_ns=1000)
        self.bench = Bench("r1", *overrides, f"until_s={duration_s}")
        if not ours:
            host = self.bench.agent.brief.host
            host = replace(host, bus_error_limit_ns=2 * S)
            changes = {"host": host, **changes}
            self.bench = Bench("r1", *overrides, f"until_s={duration_s}", **changes)
        schedule = self.bench.schedule
        epoch_ns = self.clock.now_ns + schedule.countdown_ticks * schedule.period_ns
        self.wire = Wire(self.bench, self.clock, epoch_ns - Ticks(schedule).bus_time_ns(0))
        self.link = PoseLink(self.bench, self.clock, epoch_ns)
        nowhere = SimpleNamespace(put=lambda _: None)
        self.loop = RealtimeLoop(
            self.bench.agent,
            in_frames(self.wire),
            self.link,
            Subscriptions(self.link, self.bench.agent.brief),
            nowhere,
            Hellos(0.02, clock=self.clock),
            nowhere,
            clock=self.clock,
        )
        self.epoch_ns = epoch_ns

    def run(self) -> None:
        try:
            self.loop.run(self.epoch_ns, Stop())
        finally:
            self.wire.shutdown()

    @property
    def events(self) -> list[str]:
        """Kinds of events that are notices."""
        kinds = [event.kind for event in self.bench.agent.guard.events]
        assert kinds[0] == "armed"
        return [kind for kind in kinds if KINDS[kind].told]


def test_an_interface_taken_down_and_up_is_survived_and_driven_on_after_arming() -> None:
    rig = Rig(*REARM)
    down_ns, up_ns = 13 * S // 10, 19 * S // 10
    rig.wire.plan = {down_ns: DOWN, up_ns: None}
    rig.run()
    assert rig.events == ["stopped", "rearming", "rearmed"]
    assert rig.loop._health.errors > 100
    assert rig.bench.agent.guard.stop_reason == ""
    after = [frame for at_ns, frame in rig.wire.log if at_ns >= up_ns]
    driven = [n for n, frame in enumerate(after) if set_points([frame]) not in ([], [ZERO])]
    clearing = [n for n, frame in enumerate(after) if frame.can_id == 0x018]
    assert clearing
    assert driven
    assert clearing[0] < driven[0]
    assert set_points(after[:2]) == [ZERO, ZERO]


def test_a_bus_that_stays_down_ends_the_controller_with_the_reason() -> None:
    rig = Rig(*REARM, duration_s=6.0)
    rig.wire.plan = {S: DOWN}
    with pytest.raises(InfrastructureError, match=r"r1: gave up its bus after 2\.0 s.*is down"):
        rig.run()
    assert rig.bench.phase is Phase.STOPPED


def test_our_own_bus_that_fails_ends_the_controller_at_once() -> None:
    rig = Rig(*REARM, ours=True)
    rig.wire.plan = {S: DOWN}
    with pytest.raises(PeerLostError):
        rig.run()
    assert rig.wire.bus_ns < S + S // 50


def test_a_full_transmit_queue_stops_the_robot_and_it_comes_back() -> None:
    rig = Rig(*REARM)
    rig.wire.plan = {S: FULL, 15 * S // 10: None}
    rig.run()
    assert rig.events == ["stopped", "rearming", "rearmed"]
    assert rig.loop.counters.unsent > 10


def test_an_error_for_one_moment_stops_nothing() -> None:
    rig = Rig(*REARM)
    rig.wire.plan = {S: FULL, S + 5_000_000: None}
    rig.run()
    assert rig.events == []
    assert 1 <= rig.loop.counters.unsent <= 4


def test_an_interface_that_comes_up_during_the_countdown_is_armed() -> None:
    rig = Rig("clock.mode='realtime'", "clock.countdown_s=1.0", duration_s=0.5)
    rig.wire.plan = {0: DOWN, S // 2: None}
    rig.run()
    assert rig.events == []


def test_drives_that_never_speak_end_it_at_tick_0() -> None:
    rig = Rig("clock.mode='realtime'", "clock.countdown_s=0.5")
    rig.bench.axes.clear()
    with pytest.raises(InfrastructureError, match="no heartbeat heard yet"):
        rig.run()
    assert rig.wire.bus_ns < S


def test_error_frames_are_counted_and_are_no_drives() -> None:
    rig = Rig(*REARM, duration_s=0.2)
    rig.wire.others = {S // 10: [Frame(ERR | 0x004, bytes(8)), Frame(ERR | 0x002, bytes(8))]}
    rig.run()
    assert rig.loop.counters.error_frames == 2
    assert rig.events == []


def test_what_the_bus_gathered_while_the_controller_waited_is_no_second_drive() -> None:
    rig = Rig(*REARM, duration_s=1.5)
    both = [Frame(0x001, bytes(8)), Frame(0x021, bytes(8))]
    for _ in range(10):
        rig.wire.inbox += both  # heartbeats, encoder frames
        rig.wire.inbox += [Frame(0x009, bytes(8)), Frame(0x029, bytes(8))] * 100
    rig.run()
    assert rig.events == []


@pytest.mark.parametrize(
    "bus",
    [
        (("channel", "239.74.163.6"), ("interface", "udp_multicast")),
        (("channel", "can0"), ("interface", "socketcan"), ("receive_own_messages", True)),
    ],
)
def test_own_commands_that_an_interface_hands_back_are_not_somebody_elses(monkeypatch, bus) -> None:
    rig = Rig(*REARM, duration_s=0.3, bus=bus)
    rig.wire.echoes = True
    rig.run()
    assert rig.bench.agent.guard.remarks() == []
    rig = Rig(*REARM, duration_s=0.3, bus=bus)
    rig.wire.echoes = True
    rig.wire.others = {S // 10: [Frame(0x00E, bytes(4))] * 3}
    rig.run()
    assert rig.bench.agent.guard.remarks() == ["right drive (node 0): 3 commands of another host"]


def test_drives_that_say_more_often_where_they_are_are_no_second_drive() -> None:
    rig = Rig(*REARM, "drive.encoder_period_s=0.001", duration_s=1.5)
    rig.run()
    assert rig.events == []
    assert rig.bench.agent.brief.drives.encoder_period_ns == 1_000_000


def test_in_real_time_a_subscription_is_undeclared_when_its_edge_goes_and_declared_again() -> None:
    gaps = ((0, 100), (200, 300))
    rig = Rig("clock.mode='realtime'", duration_s=1.0, hears=(InEdge("r2", 1.0, gaps),))
    rig.run()
    before, *later = rig.link.declared
    key = keys.path("test", "r2")
    assert before[0] < 0
    assert before[1:] == ("declare", key)
    assert later == [(100, "undeclare", key), (200, "declare", key), (300, "undeclare", key)]


class Watch:
    """A launcher that is away between two instants of bus time."""

    def __init__(self, rig: Rig, from_ns: int, to_ns: int) -> None:
        self.rig, self.from_ns, self.to_ns = rig, from_ns, to_ns

    @property
    def away(self) -> bool:
        return self.from_ns <= self.rig.wire.bus_ns < self.to_ns


def test_a_robot_that_is_cut_off_from_the_launcher_stops_and_comes_back_with_it() -> None:
    rig = Rig(*REARM)
    away_ns, back_ns = 13 * S // 10, 19 * S // 10
    rig.loop._watch = Watch(rig, away_ns, back_ns)
    rig.run()
    assert rig.events == ["cut_off", "stopped", "back", "rearming", "rearmed"]
    _, cut_off, stopped, *_ = rig.bench.agent.guard.events
    assert stopped.text == "cut off from the launcher"
    assert stopped.tick == cut_off.tick
    away = [frame for at_ns, frame in rig.wire.log if away_ns + S // 100 < at_ns < back_ns]
    assert set(set_points(away)) <= {ZERO}


def test_after_a_stall_what_the_bus_gathered_is_no_second_drive_either() -> None:
    rig = Rig(*REARM, duration_s=4.0)
    receive, stalled = rig.link.receive, []

    def stall(timeout_s: float) -> None:
        if rig.link.tick >= 250 and not stalled:
            stalled.append(rig.link.tick)
            rig.clock.now_ns += 16 * S // 10
        receive(timeout_s)

    rig.link.receive = stall
    rig.run()
    assert rig.events == ["stalled", "stopped", "rearming", "rearmed"]
