"""The bus as a controller's clock: each tick once, in order, with its frames or without."""

from hypothesis import given
from hypothesis import strategies as st

from agents.bus_clock import BusClock
from bridge.drives.odrive.client import OdriveClient
from bridge.drives.odrive.frames import Command, floats_data, identifier
from configs.brief import DriveLink
from configs.loading import load
from configs.resolve import schedule
from configs.sections import PROTOCOL, Mounting

SCHEDULE = schedule(load("two_robots"))
RIGHT, LEFT = 0, 1


def drives() -> OdriveClient:
    link = DriveLink(PROTOCOL.choose({}, ""), True, RIGHT, LEFT, SCHEDULE.period_ns, Mounting())
    return OdriveClient(link)


def hear(client: OdriveClient, node: int, now_ns: int) -> None:
    """An encoder frame of a drive."""
    can_id = identifier(node, Command.GET_ENCODER_ESTIMATES)
    client.on_frame(can_id, floats_data(0.0, 0.0), now_ns)


def test_a_tick_is_due_with_both_encoder_frames_and_not_before() -> None:
    client = drives()
    clock = BusClock(SCHEDULE, client)
    first = -SCHEDULE.countdown_ticks
    hear(client, RIGHT, 0)
    assert clock.due(0) is None
    hear(client, LEFT, 0)
    assert clock.due(0) == first
    assert clock.due(100) is None  # the next tick's time has not come
    second_ns = SCHEDULE.period_ns
    hear(client, LEFT, second_ns)
    assert clock.due(second_ns) is None
    hear(client, RIGHT, second_ns)
    assert clock.due(second_ns) == first + 1


@given(st.lists(st.sampled_from(["both", "one", "none"]), max_size=50))
def test_each_tick_is_due_once_whatever_frames_its_question_has(came: list[str]) -> None:
    client = drives()
    clock = BusClock(SCHEDULE, client)
    ticks = []
    for k, frames in enumerate(came):
        now_ns = k * SCHEDULE.period_ns
        found = []
        for node in {"both": (RIGHT, LEFT), "one": (LEFT,), "none": ()}[frames]:
            hear(client, node, now_ns)
            found.append(clock.due(now_ns))
        assert [it is not None for it in found] == [False, True][: len(found)]
        found += [clock.due_at_end(now_ns), clock.due_at_end(now_ns)]
        ticks += [tick for tick in found if tick is not None]
    first = -SCHEDULE.countdown_ticks
    assert ticks == list(range(first, first + len(came)))
