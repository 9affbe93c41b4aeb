"""Variants of a scenario: whatever keys differ, and however wrong, they are as loaded whole."""

import tomllib
from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from configs.errors import ScenarioError
from configs.expect_checks import expect_problems
from configs.loading import folder_of, load, loads, of_data, read, shipped
from configs.overrides import Override
from configs.scenario import Scenario
from configs.variants import Variants

STRANGE = (
    *("nonsense", "clock.nonsense", "robot.nobody.s_0", "robot.9.s_0", "name.x", "robot", "graph"),
    *("robot.r1", "robot.r1.nonsense", "robot.0.pose", "fault", "expect", "expect.0", "path.kind"),
    *("graph.file", "graph.edges", "control.law", "drive.protocol", "robot_types.etsro", "schema"),
)
VALUES: tuple[object, ...] = (
    *(None, True, False, 0, 1, 2, 7, -1, 0.0, 0.001, 0.25, 0.5, 1.0, 3.0, -2.5, 1e9, 1e13),
    *("", "r1", "r2", "etsro", "hold", "adaptive_dsc_robust", "fixed_dsc", "no_such:Law", "circle"),
    *([], [0.1], ["r1"], ["r1 -> r2"], ["r2 -> r1", "r1 -> r2"], {}, {"kind": "line"}),
    *({"x_m": 0.0, "y_m": 1.0}, {"generator": "ring"}, {"generator": "ring", "weights": "unit"}),
    [{"name": "r1", "pose": {"x_m": 0.0, "y_m": 0.0}}],
    [{"signal": "x_e_m", "max_abs": 1.0}, {"event": "stopped", "at_most": 0}],
    [{"kind": "drive_error", "target": "r1.left", "at_s": 0.05}],
)


def leaves(value: Any, place: str) -> Iterator[tuple[str, Any]]:
    """The keys in a parsed file with their values; members of lists by number."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(inner, f"{place}.{key}" if place else key)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for n, inner in enumerate(value):
            yield from leaves(inner, f"{place}.{n}")
    else:
        yield place, value


@cache
def keys_of(name: str) -> dict[str, Any]:
    """All keys of a shipped scenario, those with defaults too."""
    written = dict(leaves(tomllib.loads(load(name).to_toml()), ""))
    return {**written, **dict(leaves(tomllib.loads(read(name)[1]), ""))}


def overrides_of(name: str) -> st.SearchStrategy[Override]:
    """One key of a scenario, or a strange one, with a value near its own, or any."""
    known = keys_of(name)

    def near(key: str) -> st.SearchStrategy[object]:
        value = known[key]
        if isinstance(value, bool) or not isinstance(value, int | float):
            return st.sampled_from((value, *VALUES))
        return st.sampled_from((value, type(value)(2 * value), type(value)(value + 1), *VALUES))

    def made(key: str) -> st.SearchStrategy[Override]:
        values = near(key) if key in known else st.sampled_from(VALUES)
        return values.map(lambda value: Override(f"case 1: {key} = {value!r}", key, value))

    return st.sampled_from((*known, *known, *STRANGE)).flatmap(made)


@cache
def variants_of(name: str) -> Variants:
    """Of a shipped scenario, cut short by an override."""
    file, text = read(name)
    first = Override("--duration 0.1", "until_s", 0.1)
    base = loads(file, text, (first,))
    return Variants(base, tomllib.loads(text), (first,), folder_of(name))


def whole(name: str, overrides: list[Override]) -> Scenario:
    """The same by loading all of it."""
    first = Override("--duration 0.1", "until_s", 0.1)
    return of_data("case 1", tomllib.loads(read(name)[1]), [first, *overrides], folder_of(name))


def told(make: Any) -> tuple[object, ...]:
    """All that can be seen of a scenario, or of its refusal."""
    try:
        scenario: Scenario = make()
    except ScenarioError as error:
        return str(error), error.complaints
    computed = scenario.topology, scenario.reach, scenario.members, scenario.ages_vary
    return scenario, scenario.origin, scenario.model_fields_set, scenario.to_toml(), computed


@settings(max_examples=400, deadline=None)
@given(st.data())
def test_a_variant_is_what_loading_all_of_it_makes_of_it_errors_too(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(shipped()))
    overrides = data.draw(st.lists(overrides_of(name), min_size=1, max_size=3))
    variant = told(lambda: variants_of(name).scenario("case 1", overrides))
    assert variant == told(lambda: whole(name, overrides))


@pytest.mark.parametrize("name", shipped())
def test_without_a_difference_a_variant_is_its_base(name: str) -> None:
    assert told(lambda: variants_of(name).scenario("case 1", [])) == told(lambda: whole(name, []))


def test_what_does_not_differ_is_not_made_again() -> None:
    variants = variants_of("paper")
    one = variants.scenario("case 1", [Override("k4", "control.k4", 2.0)])
    other = variants.scenario("case 2", [Override("x", "robot.r1.pose.x_m", -7.0)])
    assert one.robot[0] is not other.robot[0]
    assert one.robot[1:] == other.robot[1:]
    assert all(a is b for a, b in zip(one.robot[1:], other.robot[1:], strict=True))
    assert one.path is other.path
    assert one.topology is other.topology


def test_a_variant_leaves_no_trace_in_the_next_one() -> None:
    before = told(lambda: variants_of("paper").scenario("case 1", []))
    variants_of("paper").scenario("case 1", [Override("x", "robot.r1.pose.x_m", -7.0)])
    assert told(lambda: variants_of("paper").scenario("case 1", [])) == before


def test_expectations_are_checked_again_with_another_law_but_not_with_other_gains() -> None:
    file, text = read("paper")
    first = Override("--set expect", "expect", [{"signal": "theta_hat_1", "max_abs": 9.0}])
    variants = Variants(loads(file, text, (first,)), tomllib.loads(text), (first,), "")
    variants.scenario("case 1", [Override("k4", "control.k4", 2.0)])
    with pytest.raises(ScenarioError, match=r"theta_hat_1.*no such signal"):
        variants.scenario("case 2", [Override("law", "control", {"law": "backstepping_analytic"})])
    assert {"control.plugin", "expect"} <= variants._reads[expect_problems]
    assert "control" not in variants._reads[expect_problems]
