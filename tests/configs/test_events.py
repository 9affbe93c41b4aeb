"""The vocabulary and the order of events."""

from hypothesis import given
from hypothesis import strategies as st

from configs.events import KINDS, Event, in_order, told

ROBOTS = ("r2", "r1")
sources = st.sampled_from(["r1", "r2", "plant", "bus/r1"])


@given(st.lists(st.builds(Event, st.integers(-3, 3), sources, st.sampled_from(sorted(KINDS)))))
def test_events_stand_by_tick_then_by_source_and_those_of_a_source_as_they_came(events) -> None:
    placed = [event._replace(text=str(n)) for n, event in enumerate(events)]
    ordered = in_order(placed, ROBOTS)
    assert sorted(ordered) == sorted(placed)
    ranks = ["r2", "r1", "bus/r1", "plant"]
    keys = [(it.tick, ranks.index(it.source), int(it.text)) for it in ordered]
    assert keys == sorted(keys)


def test_an_event_in_words_has_its_tick_time_kind_and_text() -> None:
    stopped = Event(1500, "r1", "stopped", "left drive dropped out")
    assert told(stopped, 2_000_000) == ("tick 1500 (t = 3.000 s): stopped: left drive dropped out")
    assert told(Event(1, "r1", "rearmed"), 1_000_000) == "tick 1 (t = 0.001 s): rearmed"
