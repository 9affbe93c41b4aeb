"""Laws, paths and offsets by name: of installed packages, of files, and names of the wrong kind."""

from pathlib import Path

import pytest
from support.own_files import replaced, write_own_files
from support.scenario_text import SMALL, changed

from configs.choices import table_of
from configs.errors import ScenarioError
from configs.loading import load, loads, to_toml
from configs.plugins import Choice
from fleetloop.check.rehearsal import rehearse

ENTRY_POINTS = """
[fleetloop.laws]
unicycle = my_package.my_law:Unicycle
[fleetloop.paths]
ellipse = my_package.my_shapes:Ellipse
[fleetloop.offsets]
breathing = my_package.my_shapes:Breathing
"""
SHORT = {
    "my_law:Unicycle": "unicycle",
    "my_shapes:Ellipse": "ellipse",
    "my_shapes:Breathing": "breathing",
}


@pytest.fixture
def own(tmp_path: Path) -> Path:
    write_own_files(tmp_path)
    return tmp_path


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scenario that names the classes of a package on sys.path by its entry points."""
    site = tmp_path / "site"
    package, about = site / "my_package", site / "my_package-1.0.dist-info"
    for folder in (package, about):
        folder.mkdir(parents=True)
    write_own_files(package)
    (package / "__init__.py").touch()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my-package\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(ENTRY_POINTS)
    scenario = tmp_path / "own.toml"
    text = (package / "own.toml").read_text()
    for long, short in SHORT.items():
        text = text.replace(long, short)
    scenario.write_text(text)
    monkeypatch.syspath_prepend(site)
    return scenario


def test_an_installed_package_offers_its_classes_by_entry_points(installed: Path) -> None:
    scenario = load(str(installed), ["duration_s=0.5", "expect=[]"])
    r1, r2, _ = scenario.robot
    law = scenario.control_of(r1)
    assert (law.name, law.parameters.k_x_1_s) == ("unicycle", 2.5)
    assert isinstance(scenario.path, Choice)
    assert table_of(scenario.path, "kind") == {"kind": "ellipse", "a_m": 3.0, "b_m": 2.5}
    assert isinstance(r2.offset, Choice)
    assert r2.offset.name == "breathing"
    assert not [f for f in rehearse(scenario) if "stops" in f.text and "no robot" not in f.text]


def test_a_record_of_classes_by_entry_points_is_read_without_their_package(
    installed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = to_toml(load(str(installed)))
    monkeypatch.undo()
    again = loads("record", text, recorded=True)
    assert to_toml(again) == text


def test_keys_of_installed_classes_are_refused_as_any_others(installed: Path) -> None:
    changes = ["control.k_x_1_s=-1.0", "path.c_m=1.0", "robot.r2.offset.left_m='x'"]
    with pytest.raises(ScenarioError) as refused:
        load(str(installed), changes)
    said = str(refused.value)
    assert "control.k_x_1_s=-1.0: must be greater than 0" in said
    assert "path.c_m=1.0: unknown key; did you mean b_m? (known here: kind, a_m, b_m)" in said
    assert "robot.r2.offset.left_m='x': must be a number" in said


def refusals(source: str, *changes: str) -> str:
    with pytest.raises(ScenarioError) as refused:
        loads(source, changed(SMALL, *changes))
    return str(refused.value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("control.law='my_law.py:X'", 'control.law = "my_law.py:X": must be "my_law:X", a module'),
        ("control.law='./laws/my_law.py:X'", 'must be "my_law:X", a module beside the scenario'),
        ("control.law='my_law.py'", 'control.law = "my_law.py": must be "my_law:Class", a mod'),
        ("path.kind='my_shapes.py:X'", 'path.kind = "my_shapes.py:X": must be "my_shapes:X"'),
        ("path.kind='structure'", 'path.kind = "structure": is a formation offset, no path shape'),
        (
            "robot.r1.offset={kind='circle', radius_m=3.0}",
            'robot.r1.offset.kind = "circle": is a path shape, no formation offset',
        ),
        ("path.kind='helix'", "path.kind = \"helix\": must be one of 'line', 'cosine', 'circle'"),
    ],
)
def test_a_name_of_the_wrong_form_or_kind_is_refused_with_the_right_one(
    change: str, said: str
) -> None:
    assert said in refusals("file.toml", change)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("path={kind='breathing'}", 'path.kind = "breathing": is a formation offset, no path'),
        ("robot.r1.offset={kind='ellipse'}", '"ellipse": is a path shape, no formation offset'),
        ("control.law='ellipse'", 'control.law = "ellipse": is a path shape, no law'),
    ],
)
def test_an_entry_point_of_another_kind_is_named(installed: Path, change: str, said: str) -> None:
    assert said in refusals(str(installed), change)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("my_shapes:Ellipse", "my_shapes:Breathing", "Breathing is no path shape: it is a form"),
        ("my_shapes:Breathing", "my_shapes:Ellipse", "Ellipse is no formation offset: it is a p"),
        ("my_shapes:Ellipse", "my_law:Unicycle", "Unicycle is no path shape: it is a law"),
        ("my_law:Unicycle", "my_shapes:Ellipse", "Ellipse is no law: it is a path shape"),
    ],
)
def test_a_class_of_another_kind_is_named(own: Path, old: str, new: str, said: str) -> None:
    replaced(own, "own.toml", old, new)
    with pytest.raises(ScenarioError) as refused:
        load(str(own / "own.toml"))
    assert said in str(refused.value)


def test_a_shape_of_plain_parameters_may_be_either(own: Path) -> None:
    for base in ("OwnPath", "OwnOffset"):
        replaced(own, "my_shapes.py", f"({base})", "(Parameters)")
    replaced(own, "my_shapes.py", "import Positive", "import Parameters, Positive")
    assert load(str(own / "own.toml")).path.kind == "my_shapes:Ellipse"
