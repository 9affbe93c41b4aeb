"""Events are kept and announced once."""

from configs.events import MAX_EVENTS, Event
from plant.herald import Herald


def test_each_event_that_is_looked_for_is_announced_once_and_later_ones_too() -> None:
    happened: dict[str, Event] = {}
    said: list[Event] = []
    herald = Herald(lambda _: happened, said.append)
    herald.look(0)
    far = happened["r1"] = Event(3, "r1", "diverged")
    herald.look(5)
    down = happened["r2"] = Event(7, "bus/r2", "bus_trouble")
    herald.look(7)
    happened["r2"] = down._replace(tick=8)
    herald.look(8)
    assert said == herald.events == [far, down]


def test_what_happens_again_and_again_is_kept_up_to_a_bound() -> None:
    said: list[Event] = []
    herald = Herald(lambda _: {}, said.append)
    for tick in range(MAX_EVENTS + 5):
        herald.note(Event(tick, "r1", "stopped"))
    assert said == herald.events
    assert [event.tick for event in said] == list(range(MAX_EVENTS))
    assert herald.remarks() == [f"5 events after the first {MAX_EVENTS} are not listed"]


def test_what_the_launcher_acts_on_is_announced_beyond_the_bound() -> None:
    said: list[Event] = []
    herald = Herald(lambda _: {}, said.append)
    for tick in range(MAX_EVENTS):
        herald.note(Event(tick, "r1", "fault_applied"))
    awaited = Event(MAX_EVENTS, "r1", "awaited")
    herald.note(awaited)
    assert said[-1] == awaited
    assert awaited not in herald.events
