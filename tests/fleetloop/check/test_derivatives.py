"""Derivatives of own shapes against their values."""

from math import cos, sin
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.own_files import replaced, write_own_files

from agents.paths import Jet, PlanarJet, own_curve
from configs.errors import ScenarioError
from configs.loading import load
from fleetloop.check.coordination import forecast
from fleetloop.check.derivatives import derivative_findings, wrong_derivative
from fleetloop.check.examine import examine
from fleetloop.check.finding import Finding


def findings(folder: Path) -> list[Finding]:
    scenario = load(str(folder / "own.toml"))
    return list(derivative_findings(scenario, forecast(scenario)))


def test_the_shapes_of_the_page_fit(tmp_path: Path) -> None:
    write_own_files(tmp_path)
    found = findings(tmp_path)
    assert [f.level for f in found] == ["ok", "ok"]
    assert [f.title for f in found] == [
        "derivatives of path shape my_shapes:Ellipse",
        "derivatives of formation offset my_shapes:Breathing",
    ]


@pytest.mark.parametrize(
    ("old", "new", "title", "said"),
    [
        ("-a * k * n", "a * k * n", "path shape my_shapes:Ellipse", "x' at s = "),
        ("b * k * c", "0.9 * b * k * c", "path shape my_shapes:Ellipse", "y' at s = "),
        ("-a * k**2 * c", "-a * k * c", "path shape my_shapes:Ellipse", "x'' at s = "),
        ("-b * k**3 * c", "b * k**3 * c", "path shape my_shapes:Ellipse", "y''' at s = "),
        ("l * c, -l * n", "l, -l * n", "formation offset my_shapes:Breathing", "left' at s = "),
    ],
)
def test_a_wrong_derivative_is_named_with_its_place_and_what_is_expected(
    tmp_path: Path, old: str, new: str, title: str, said: str
) -> None:
    write_own_files(tmp_path)
    replaced(tmp_path, "my_shapes.py", old, new)
    (wrong,) = (f for f in findings(tmp_path) if f.level == "error")
    assert wrong.title == f"derivatives of {title}"
    assert wrong.text.startswith(said)
    assert wrong.key == ("path.kind" if "path" in title else "robot.r2.offset.kind")
    place, _, rest = wrong.text.removeprefix(said).partition(" m: jet returns ")
    claimed, expected = rest.split(", but differences of its ")
    s, claimed_d, expected_d = float(place), float(claimed), float(expected.split(" give ")[1])
    if old == "-a * k * n":  # x' = −sin(s/3), claimed with the other sign
        assert expected_d == pytest.approx(-sin(s / 3.0), rel=1e-3)
        assert claimed_d == pytest.approx(-expected_d, rel=1e-3)


def test_a_path_that_stands_still_by_wrong_derivatives_is_blamed_on_them(tmp_path: Path) -> None:
    write_own_files(tmp_path)
    for old, new in (("-a * k * n,", "0.0,"), ("b * k * c,", "0.0,")):
        replaced(tmp_path, "my_shapes.py", old, new)
    path = str(tmp_path / "own.toml")
    found = examine(path, load(path))
    assert {f.title.partition(" of ")[0] for f in found} == {"derivatives"}
    assert "error" in {f.level for f in found}
    for old, new in (("a * c, 0.0", "a, 0.0"), ("b * n, 0.0", "b, 0.0")):
        replaced(tmp_path, "my_shapes.py", old, new)
    for old in ("-a * k**2 * c, a * k**3 * n", "-b * k**2 * n, -b * k**3 * c"):
        replaced(tmp_path, "my_shapes.py", old, "0.0, 0.0")
    with pytest.raises(ScenarioError, match="the path stands still"):  # and it does
        examine(path, load(path))


@given(st.floats(-1e6, 1e6), st.floats(0.01, 10.0), st.floats(-30.0, 30.0))
def test_right_derivatives_fit_far_from_the_origin_and_at_any_scale(
    far: float, k: float, first: float
) -> None:
    def curve(s: float) -> PlanarJet:
        c, n = cos(k * s), sin(k * s)
        return PlanarJet(Jet(far + n / k, c, -k * n, -k * k * c), Jet(far, 0.0, 0.0, 0.0))

    assert wrong_derivative(curve, first, first + 5.0, 3) is None


def test_a_kink_of_a_path_is_no_wrong_derivative() -> None:
    def curve(s: float) -> PlanarJet:
        slope = 1.0 if s < 2.50004 else -0.5
        return PlanarJet(Jet(s, 1.0, 0.0, 0.0), Jet(slope * (s - 2.50004), slope, 0.0, 0.0))

    assert wrong_derivative(curve, 0.0, 5.0, 3) is None


def test_a_robot_that_does_not_move_has_no_way_to_hold_against(tmp_path: Path) -> None:
    write_own_files(tmp_path)
    shape = load(str(tmp_path / "own.toml")).path
    assert wrong_derivative(own_curve(shape), 1.0, 1.0, 3) is None
