"""What was refused is counted by sender and kind, in bounded memory."""

from bridge.network.refused_messages import FLOOD, MOST_KINDS, Refusals


def test_refusals_are_counted_and_named() -> None:
    refusals = Refusals()
    for seconds in (3600, 7200, 1):
        refusals.note("path state", "r1", "ahead", f"dated {seconds} s ahead")
    refusals.note("pose", "the localisation system", "not well formed")
    refusals.note("message", "r3", "no room", count=0)
    assert refusals.lines() == [
        "refused 3 path states of r1: dated 3600 s ahead",
        "refused 1 pose of the localisation system: not well formed",
    ]


def test_however_many_kinds_there_are_memory_is_bounded_and_nothing_goes_uncounted() -> None:
    refusals = Refusals()
    for n in range(10_000):
        refusals.note("message", f"r{n}", "lie")
    assert len(refusals.lines()) == MOST_KINDS + 1
    assert refusals.lines()[-1].startswith(f"refused {10_000 - MOST_KINDS} messages of others")


def test_who_says_more_than_anybody_by_mistake_is_told_with_all_that_was_refused_of_it() -> None:
    refusals = Refusals()
    refusals.note("path state", "r1", "back", count=FLOOD - 1)
    refusals.note("path state", "r2", "back", count=FLOOD - 1)
    assert refusals.floods() == []
    refusals.note("path state", "r1", "twice")
    assert refusals.floods() == [f"r1 ({FLOOD} messages)"]
