"""An ideal bus in lockstep, whatever is sent on it, and in real time between two ticks."""

from support.manual_port import ManualPort

from bridge.drives.odrive.frames import Command, identifier
from bridge.frame import RTR, Frame
from configs.connections import NetworkLink
from configs.loading import load
from configs.resolve import plant_brief
from plant.bus.ideal import MOST_A_TICK, IdealBus
from plant.faults import BusFaults
from plant.robot import emulated_robot

REQUEST = Frame(identifier(0, Command.GET_BUS_VOLTAGE_CURRENT) | RTR, bytes(8))


MS = 1_000_000


def bus(port: ManualPort, scenario: str = "two_robots", *overrides: str) -> IdealBus:
    brief = plant_brief(load(scenario, overrides), network=NetworkLink("t", "", "", ""))
    robot = emulated_robot(brief.robots[0])
    none = BusFaults((), (), brief.schedule)
    return IdealBus([robot], brief.schedule, brief.substeps, port, lambda _: None, None, none)


def test_who_never_stops_asking_cannot_stop_time_and_is_answered_with_the_next_tick() -> None:
    port = ManualPort()
    steps = bus(port).steps()
    asked = 0
    while port.next_question(steps) is not None and asked < 2 * MOST_A_TICK:
        asked += 1
        port.frames = [REQUEST]
    assert asked == MOST_A_TICK
    following = port.next_question(steps)
    assert following is not None
    answers = [frame for frame in following.frames if frame.can_id == REQUEST.can_id & ~RTR]
    assert len(answers) == 1
    assert following.frames[-1] == answers[0]  # behind what the tick itself has to say


def test_what_was_asked_is_answered_in_the_same_tick() -> None:
    port = ManualPort()
    emulated = bus(port)
    steps = emulated.steps()
    first = port.next_question(steps)
    port.frames = [REQUEST, REQUEST]
    second = port.next_question(steps)
    assert first is not None
    assert second is not None
    assert second.stamp_ns == first.stamp_ns
    assert [frame.can_id for frame in second.frames] == [REQUEST.can_id & ~RTR] * 2
    assert port.next_question(steps) is None
    assert emulated.crossed == len(first.frames) + 2 + 2


def encoder_stamps(*overrides: str) -> list[int]:
    """When node 0 sent its encoder frames within 20 ms, ticks every 10 ms, looked at every 0.5."""
    port = ManualPort()
    emulated = bus(port, "two_robots_100hz", *overrides)
    zero_ns = emulated.robots[0].moved_ns
    for now_ns in range(zero_ns, zero_ns + 20 * MS, MS // 2):
        if now_ns % (10 * MS) == 0:
            emulated.move(now_ns)
            emulated.send_due(now_ns)
        elif emulated.acts_between_ticks and emulated.next_ns() <= now_ns:
            emulated.advance(now_ns)
    return [
        given.stamp_ns
        for given in port.questions
        for frame in given.frames
        if frame.can_id == Command.GET_ENCODER_ESTIMATES.value
    ]


def test_encoder_frames_come_with_the_ticks_unless_they_have_a_period_of_their_own() -> None:
    assert encoder_stamps() == [0, 10 * MS]
    assert encoder_stamps("drive.encoder_period_s=0.002") == [k * MS for k in range(0, 20, 2)]
