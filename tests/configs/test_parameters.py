"""Dataclasses of parameters as pydantic validates them and as processes receive them."""

import pickle
import subprocess
import sys
from dataclasses import dataclass
from typing import Annotated, Literal

import pytest
from pydantic import TypeAdapter, ValidationError

from configs.parameters import (
    Parameters,
    Pattern,
    Positive,
    Tagged,
    as_tuples,
    changed,
    changes_of,
    parameter,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Inner(Parameters):
    """A table in a table."""

    length_m: Positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Outer(Parameters):
    """A table."""

    mass_kg: Positive = parameter(2.0, "of the body")
    count: int = 1
    inner: Inner = Inner(length_m=1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Round(Parameters):
    """One of two shapes."""

    kind: Literal["round"]
    radius_m: Positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Square(Parameters):
    """The other one."""

    kind: Literal["square"]
    corners_m: tuple[Positive, ...]


FILE = TypeAdapter(Outer)
SHAPE = TypeAdapter(Annotated[Round | Square, Tagged("kind")])
TEXT = TypeAdapter(Annotated[str, Pattern("^r[0-9]+$", max_length=3)])
OuterChanges = changes_of("OuterChanges", Outer)
CHANGES = TypeAdapter(OuterChanges)


def test_a_table_becomes_the_object_that_processes_receive() -> None:
    made = FILE.validate_python({"mass_kg": 3, "inner": {"length_m": 0.5}})
    assert made == Outer(mass_kg=3.0, inner=Inner(length_m=0.5))
    assert pickle.loads(pickle.dumps(made)) == made


@pytest.mark.parametrize(
    ("table", "where", "kind"),
    [
        ({"mass_kg": 0.0}, ("mass_kg",), "greater_than"),
        ({"mass_kg": float("inf")}, ("mass_kg",), "finite_number"),
        ({"mass_kg": "3"}, ("mass_kg",), "float_type"),
        ({"count": 1.0}, ("count",), "int_type"),
        ({"mass": 1.0}, ("mass",), "unexpected_keyword_argument"),
        ({"inner": {"length_m": -1.0}}, ("inner", "length_m"), "greater_than"),
        ({"inner": {}}, ("inner", "length_m"), "missing"),
        ({"inner": 3}, ("inner",), "dataclass_type"),
    ],
)
def test_what_a_table_may_not_hold_is_refused_where_it_is(table, where, kind) -> None:
    with pytest.raises(ValidationError) as refused:
        FILE.validate_python(table)
    (error,) = refused.value.errors()
    assert (error["loc"], error["type"]) == (where, kind)


def test_the_schema_has_bounds_default_and_description() -> None:
    mass = FILE.json_schema()["properties"]["mass_kg"]
    assert (mass["exclusiveMinimum"], mass["default"]) == (0, 2.0)
    assert mass["description"] == "of the body"


def test_a_tag_chooses_the_table_and_arrays_become_tuples() -> None:
    table = {"kind": "square", "corners_m": [1.0, 2]}
    assert SHAPE.validate_python(as_tuples(table)) == Square(kind="square", corners_m=(1.0, 2.0))
    with pytest.raises(ValidationError) as refused:
        SHAPE.validate_python({"kind": "oval"})
    assert refused.value.errors()[0]["type"] == "union_tag_invalid"


@pytest.mark.parametrize(
    ("text", "kind"), [("x1", "string_pattern_mismatch"), ("r100", "string_too_long")]
)
def test_a_text_matches_its_pattern(text: str, kind: str) -> None:
    assert TEXT.validate_python("r10") == "r10"
    with pytest.raises(ValidationError) as refused:
        TEXT.validate_python(text)
    assert refused.value.errors()[0]["type"] == kind


def test_changes_have_the_same_keys_bounds_and_words_and_no_defaults() -> None:
    assert CHANGES.validate_python({}) == OuterChanges()
    assert CHANGES.json_schema()["properties"]["mass_kg"]["description"] == "of the body"
    with pytest.raises(ValidationError):
        CHANGES.validate_python({"mass_kg": -1.0})
    heavier = CHANGES.validate_python({"mass_kg": 9.0})
    assert changed(Outer(mass_kg=1.0, count=7), heavier) == Outer(mass_kg=9.0, count=7)
    assert pickle.loads(pickle.dumps(heavier)) == heavier


def test_a_client_of_a_bus_imports_no_section_of_a_scenario() -> None:
    """Every `can.Bus` of a program pays for what it imports."""
    heavy = "{'annotated_types', 'configs.brief', 'configs.parameters', 'zenoh'}"
    code = f"import sys, bridge.can_bus.interface; assert not {heavy} & sys.modules.keys()"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=30)


@pytest.mark.parametrize(
    "modules",
    ["configs.sections, configs.host, configs.powertrain", "agents.__main__", "plant.__main__"],
)
def test_a_process_needs_neither_pydantic_nor_numpy(modules: str) -> None:
    code = f"import sys, {modules}; assert not {{'pydantic', 'numpy'}} & sys.modules.keys()"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=30)
