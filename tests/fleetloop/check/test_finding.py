"""How findings are said: alike robots in one line, named in few words."""

import pytest

from fleetloop.check.finding import Finding, alike, named

FLEET = ("r1", "r2", "r3", "r4", "r5")


@pytest.mark.parametrize(
    ("robots", "words"),
    [
        (FLEET, "all"),
        (("r2",), "r2"),
        (("r1", "r2"), "r1, r2"),
        (("r1", "r2", "r3", "r5"), "r1 to r3, r5"),
        ((), ""),
    ],
)
def test_robots_are_named_in_few_words(robots: tuple[str, ...], words: str) -> None:
    assert named(robots, FLEET) == words


def test_one_robot_is_named_even_if_it_is_all() -> None:
    assert named(("r1",), ("r1",)) == "r1"


def test_findings_that_differ_in_the_robot_only_become_one() -> None:
    same = [Finding("ok", "a", "fine", (robot,)) for robot in FLEET]
    other = Finding("warning", "a", "near", ("r1",))
    assert alike([*same, other]) == [Finding("ok", "a", "fine", FLEET), other]
