"""What a law tells of itself, what it may leave out, and what check says of that."""

from math import inf
from pathlib import Path
from types import SimpleNamespace

import pytest
from support.own_files import replaced, write_own_files

from agents.laws.adaptive_dsc import AdaptiveDsc
from agents.laws.interface import Law
from configs.loading import load, shipped
from fleetloop.check.examine import examine
from fleetloop.check.finding import Finding
from fleetloop.check.law import ANALYSES, law_findings
from fleetloop.law_facts import (
    adaptation_limit,
    approach_rate_1_s,
    lateral_gain_1_m,
    offers,
    saturation,
    speed_gain,
    speed_gain_key,
    torque_limit_wheel_N_m,
)


def choice_of(law: type) -> SimpleNamespace:
    return SimpleNamespace(load=lambda: law, parameters=None, name="law")


class Silent:
    """Tells nothing."""


class Unknowing:
    """Tells that nothing is known."""

    @classmethod
    def torque_limit_wheel_N_m(cls, _gains) -> None:
        return None

    approach_rate_1_s = speed_gain_N_m_s = lateral_gain_1_m = torque_limit_wheel_N_m


class Derived(Law):
    """Tells nothing, and has the defaults."""


class Wrong:
    """Raises, or gives no number."""

    @classmethod
    def torque_limit_wheel_N_m(cls, gains) -> float:
        return gains.no_such_gain

    @classmethod
    def speed_gain_N_m_s(cls, _gains) -> str:
        return "3"

    @classmethod
    def adaptation_limit(cls, _gains, _period_s) -> None:
        raise RuntimeError("not today")


@pytest.mark.parametrize("law", [Silent, Unknowing, Derived, Wrong])
def test_laws_that_tell_nothing_or_none_or_fail_are_alike(law: type) -> None:
    control = choice_of(law)
    assert torque_limit_wheel_N_m(control) == inf
    assert approach_rate_1_s(control) is None
    assert lateral_gain_1_m(control) is None
    assert speed_gain(control) is None
    assert speed_gain_key(control) == saturation(control) == ""
    assert adaptation_limit(control, 0.001) is None


def test_defaults_are_no_offer_and_what_a_base_tells_is_one() -> None:
    class Heir(AdaptiveDsc):
        """Has all from the paper's law."""

    for name in ANALYSES:
        assert not offers(choice_of(Silent), name)
        assert not offers(choice_of(Derived), name)
        assert offers(choice_of(Heir), name)


@pytest.mark.parametrize("name", shipped())
def test_shipped_laws_leave_nothing_out(name: str) -> None:
    assert list(law_findings(load(name))) == []


def found(folder: Path) -> list[Finding]:
    path = str(folder / "own.toml")
    return examine(path, load(path))


def test_check_names_what_a_law_does_not_tell_and_analyses_what_it_does(tmp_path: Path) -> None:
    write_own_files(tmp_path)
    before = found(tmp_path)
    (untold,) = (f for f in before if f.title == "not analysed")
    assert (untold.level, untold.robots) == ("ok", ("r1", "r2"))
    assert untold.text.startswith("law my_law:Unicycle doesn't tell: its own torque limit (torque_")
    assert all(name in untold.text for name in ANALYSES)
    replaced(tmp_path, "own.toml", "my_law:Unicycle", "my_analysed_law:AnalysedUnicycle")
    after = found(tmp_path)
    (untold,) = (f for f in after if f.title == "not analysed")
    assert "loop_elements" not in untold.text
    channels = [f.text for f in after if "θ_e, the integral and speeds" in f.title]
    assert channels
    assert all("per period" in text for text in channels)


@pytest.mark.parametrize(
    ("new", "said"),
    [
        ("raise KeyError('k')", "my_analysed_law.py, line 15: KeyError: 'k'"),
        ("return right, left", "ValueError"),
        ("return float('nan'), left, tuple(state)", "LinAlgError"),
    ],
)
def test_an_analysis_of_a_law_that_fails_is_named_and_ends_no_check(
    tmp_path: Path, new: str, said: str
) -> None:
    write_own_files(tmp_path)
    replaced(tmp_path, "own.toml", "my_law:Unicycle", "my_analysed_law:AnalysedUnicycle")
    replaced(tmp_path, "my_analysed_law.py", "return right, left, tuple(state)", new)
    (failed,) = (f for f in found(tmp_path) if (f.title, f.level) == ("not analysed", "warning"))
    assert "law my_analysed_law:AnalysedUnicycle, loop_elements: " in failed.text
    assert said in failed.text


def test_a_number_that_a_law_fails_to_tell_is_named(tmp_path: Path) -> None:
    write_own_files(tmp_path)
    told = """
    @classmethod
    def speed_gain_N_m_s(cls, gains):
        return gains.k_w
"""
    with (tmp_path / "my_law.py").open("a") as file:
        file.write(told)
    (failed,) = (f for f in found(tmp_path) if (f.title, f.level) == ("not analysed", "warning"))
    assert failed.robots == ("r1", "r2")
    assert "the sampled speed loop: law my_law:Unicycle, speed_gain_N_m_s: " in failed.text
    assert "AttributeError: 'Gains' object has no attribute 'k_w'" in failed.text
