"""Dataclasses of parameters as pydantic validates them and as processes receive them."""

import pickle
import subprocess
import sys
from dataclasses import dataclass

import pytest
from pydantic import TypeAdapter, ValidationError

from configs.parameters import Parameters, Positive, parameter


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


FILE = TypeAdapter(Outer)


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


def test_a_process_needs_no_pydantic() -> None:
    code = "import sys, configs.parameters; assert 'pydantic' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=30)
