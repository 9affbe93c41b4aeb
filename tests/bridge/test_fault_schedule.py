"""The faults of a run on their way through the ticks."""

from hypothesis import given
from hypothesis import strategies as st

from bridge.fault_schedule import Change, FaultSchedule
from configs.edges import FOREVER
from configs.events import Event
from configs.faults.base import PlannedFault
from configs.faults.bodies import Push
from configs.faults.messages import LinkPartition
from configs.faults.powertrains import DriveEvent

PUSH = Push(kind="push", at_s=0.0)
ESTOP = DriveEvent(kind="drive_estop", at_s=0.0)


def pushes(name: str, first: int, last: int | None) -> PlannedFault:
    return PlannedFault(name, "r1", PUSH, first, last)


windows = st.tuples(st.integers(0, 50), st.none() | st.integers(1, 60))


@given(st.lists(windows, max_size=8))
def test_what_acts_at_a_tick_is_what_was_planned_for_it(planned: list[tuple[int, int | None]]):
    faults = [
        pushes(f"f{n}", first, None if length is None else first + length)
        for n, (first, length) in enumerate(planned)
    ]
    schedule = FaultSchedule(faults)
    changes: list[Change] = []
    for tick in range(120):
        changes += schedule.due(tick)
        wanted = {
            one.name
            for one in faults
            if one.from_tick <= tick and (one.to_tick is None or tick < one.to_tick)
        }
        assert {one.name for one in schedule.acting} == wanted
        assert schedule.next_tick > tick
    begun = [(one.tick, one.planned.name) for one in changes if one.acts]
    ended = [(one.tick, one.planned.name) for one in changes if not one.acts]
    assert sorted(begun) == sorted((one.from_tick, one.name) for one in faults)
    ends = [(one.to_tick, one.name) for one in faults if one.to_tick is not None]
    assert sorted(ended) == sorted(end for end in ends if end[0] < 120)


def test_an_instant_strikes_once_and_acts_no_more() -> None:
    schedule = FaultSchedule([PlannedFault("stop", "r1", ESTOP, 3, None)])
    assert schedule.due(2) == []
    (change,) = schedule.due(3)
    assert change.acts
    assert change.event == Event(3, "r1", "fault_applied", "stop (drive_estop)")
    assert schedule.acting == ()
    assert schedule.next_tick == FOREVER


def test_an_ordered_fault_acts_at_the_next_tick_and_ends_at_the_tick_at_which_it_is_cleared() -> (
    None
):
    schedule = FaultSchedule([])
    assert schedule.next_tick == FOREVER
    schedule.add(pushes("push", 5, None))
    assert [one.event for one in schedule.due(9)] == [Event(9, "r1", "fault_applied", "push")]
    assert schedule.clear("push", 12)
    assert schedule.next_tick == 12
    assert [one.event for one in schedule.due(12)] == [Event(12, "r1", "fault_cleared", "push")]
    assert not schedule.clear("push", 13)


def test_a_fault_that_is_cleared_before_it_acts_never_does() -> None:
    schedule = FaultSchedule([pushes("push", 5, 9)])
    assert schedule.clear("push", 5)
    assert schedule.due(7) == []
    assert schedule.due(9) == []


def test_a_planned_fault_that_is_cleared_after_it_begins_ends_then_and_never_later() -> None:
    schedule = FaultSchedule([pushes("push", 5, 9)])
    assert schedule.clear("push", 7)
    assert schedule.clear("push", 8)
    assert [(it.tick, it.acts) for tick in range(12) for it in schedule.due(tick)] == [
        (5, True),
        (7, False),
    ]


def test_of_a_controller_that_was_started_again_no_fault_acts_that_is_over() -> None:
    schedule = FaultSchedule([pushes("gone", 5, 9), pushes("going", 5, 90)])
    assert [one.planned.name for one in schedule.due(50)] == ["going"]
    assert schedule.next_tick == 90


def test_a_change_of_a_link_is_an_event_of_the_robot_that_hears_it() -> None:
    cut = LinkPartition(kind="link_partition", at_s=0.0)
    change = Change(7, PlannedFault("cut", "leader -> r2", cut, 0, 7), acts=False)
    said = "cut (link_partition) on leader -> r2"
    assert change.event == Event(7, "r2", "fault_cleared", said)
