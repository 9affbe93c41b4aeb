"""An ideal bus in lockstep, whatever is said on it."""

from bridge.drives.odrive.frames import Command, identifier
from bridge.frame import RTR, Frame
from bridge.telemetry import no_tap
from configs.brief import NetworkLink
from configs.loading import load
from configs.resolve import plant_brief
from plant.bus.ideal import MOST_A_TICK, Ask, IdealBus
from plant.robot import unit_of

REQUEST = Frame(identifier(0, Command.GET_BUS_VOLTAGE_CURRENT) | RTR, bytes(8))


def bus() -> IdealBus:
    brief = plant_brief(load("two_robots"), network=NetworkLink("t", "", "", ""))
    unit = unit_of(brief.robots[0])
    return IdealBus([unit], brief.schedule, brief.substeps, lambda _: None, no_tap)


def test_who_never_stops_asking_cannot_stop_time_and_is_answered_with_the_next_tick() -> None:
    steps = bus().steps()
    ask = next(steps)
    asked = 0
    while ask is not None and asked < 2 * MOST_A_TICK:
        asked += 1
        ask = steps.send([REQUEST])
    assert asked == MOST_A_TICK
    following = next(steps)
    assert isinstance(following, Ask)
    answers = [frame for frame in following.frames if frame.can_id == REQUEST.can_id & ~RTR]
    assert len(answers) == 1
    assert following.frames[-1] == answers[0]  # behind what the tick itself has to say


def test_what_was_asked_is_answered_in_the_same_tick() -> None:
    steps = bus().steps()
    first = next(steps)
    second = steps.send([REQUEST, REQUEST])
    assert first is not None
    assert second is not None
    assert second.stamp_ns == first.stamp_ns
    assert [frame.can_id for frame in second.frames] == [REQUEST.can_id & ~RTR] * 2
    assert steps.send([]) is None
