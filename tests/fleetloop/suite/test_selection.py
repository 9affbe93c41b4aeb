"""What a test of paths is about."""

from pathlib import Path

import pytest

from configs.errors import ScenarioError
from fleetloop.suite.selection import matcher, selected

SCENARIO = "schema = 1\n[[robot]]\n"


def test_a_folder_gives_its_scenarios_and_nothing_that_is_something_else(tmp_path: Path) -> None:
    files = {
        "b.toml": SCENARIO,
        "a.fleetloop.toml": "[deployment]\n",
        "broken.toml": "schema = ",
        "pyproject.toml": "[project]\n",
        "place.toml": "schema = 1\n[network]\n[robot.r1]\n",
        "misspelt.toml": "schema = 1\nname = 'm'\n[[robots]]\n",
        "deeper/c.toml": SCENARIO,
        ".hidden/d.toml": SCENARIO,
        "runs/one/scenario.toml": SCENARIO,
        "runs/one/record.mcap": "",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    found = [str(Path(it).relative_to(tmp_path)) for it in selected([str(tmp_path)])]
    assert found == ["a.fleetloop.toml", "b.toml", "broken.toml", "deeper/c.toml", "misspelt.toml"]
    one = str(tmp_path / "pyproject.toml")
    assert selected([one, "two_robots", one]) == [one, "two_robots"]


def test_a_path_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="nowhere: no file, folder or shipped scenario"):
        selected(["nowhere"])
    assert selected([str(tmp_path)]) == []


@pytest.mark.parametrize(
    ("expression", "found"),
    [
        ("", "ring push slip"),
        ("push", "push"),
        ("PUSH or slip", "push slip"),
        ("not push", "ring slip"),
        ("not (push or slip)", "ring"),
        ("i and not ring", "slip"),
        ("ring or push and slip", "ring"),
    ],
)
def test_an_expression_selects_as_pytests_does(expression: str, found: str) -> None:
    matches = matcher(expression)
    assert [name for name in ("ring", "push", "slip") if matches(name)] == found.split()


@pytest.mark.parametrize("expression", ["and", "a or", "(a", "a b", "not", "a)", "()"])
def test_an_expression_that_is_none_is_refused(expression: str) -> None:
    with pytest.raises(ScenarioError, match="-k"):
        matcher(expression)
