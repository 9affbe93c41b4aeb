"""Edges that exist in windows of ticks, against a plain list of the ticks."""

from hypothesis import given
from hypothesis import strategies as st

from configs.edges import FOREVER, InEdge, hearer, next_change, presence

END = 40


def windows_of(there: list[bool]) -> tuple[tuple[int, int], ...]:
    """Windows of the ticks that are marked; the last one goes on."""
    starts = [n for n, one in enumerate(there) if one and (n == 0 or not there[n - 1])]
    ends = [n for n, one in enumerate(there) if not one and n > 0 and there[n - 1]]
    return tuple(zip(starts, [*ends, FOREVER][: len(starts)], strict=True))


marks = st.lists(st.booleans(), min_size=END, max_size=END).filter(any)


@given(marks)
def test_an_edge_exists_in_its_windows_first_tick_included_last_not(there: list[bool]) -> None:
    edge = InEdge("r1", 1.0, windows_of(there))
    assert [edge.exists(tick) for tick in range(END)] == there
    assert edge.exists(-5) is there[0]
    assert edge.exists(10 * END) is there[-1]
    for tick in range(END):
        assert edge.is_over(tick) == (not any(there[tick:]))


@given(marks, marks)
def test_changes_are_the_ticks_at_which_one_of_the_edges_comes_or_goes(
    one: list[bool], other: list[bool]
) -> None:
    edges = [InEdge("r1", 1.0, windows_of(one)), InEdge("r2", 1.0, windows_of(other))]
    found, tick = [], 0
    while (tick := next_change(edges, tick)) < FOREVER:
        found.append(tick)
    together = list(zip(one, other, strict=True))
    assert found == [n for n in range(1, END) if together[n] != together[n - 1]]


@given(marks)
def test_presence_is_the_part_of_a_run_and_the_longest_absence(there: list[bool]) -> None:
    text = "".join("x" if one else "." for one in there)
    assert presence(windows_of(there), END) == (
        text.count("x") / END,
        max(map(len, text.split("x"))),
    )


def test_an_edge_without_windows_always_exists() -> None:
    edge = InEdge("r1")
    assert edge.exists(0)
    assert not edge.is_over(FOREVER)
    assert edge.next_change(0) == FOREVER
    assert presence(None, 100) == (1.0, 0)


def test_an_edge_concerns_the_robot_that_hears_and_a_robot_itself() -> None:
    assert [hearer(it) for it in ("r1 -> r2", "leader -> r3", "r4")] == ["r2", "r3", "r4"]
