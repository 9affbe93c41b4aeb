"""Values held to annotations without pydantic: as pydantic holds them."""

from dataclasses import fields
from typing import Annotated, get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from configs.conformity import conforms
from configs.faults.kinds import CLASSES

HINTS = {
    f"{made.__name__}.{one.name}": get_type_hints(made, include_extras=True)[one.name]
    for made in CLASSES
    for one in fields(made)
}
VALUES = st.one_of(
    st.floats(),
    st.sampled_from((0.0, -0.0, 0.5, 1.0, 60.0, 61.0, 1e6, 1e12, 2e12)),
    st.integers(-2, 1 << 30),
    st.booleans(),
    st.none(),
    st.text(max_size=40),
    st.sampled_from(("both", "push", "right", "to_drives", "r1")),
    st.tuples(st.text(max_size=3)),
    st.just(()),
    st.just(("r1", 2)),
)


@given(st.sampled_from(sorted(HINTS)), VALUES)
def test_every_parameter_of_a_fault_is_held_to_its_bounds_as_by_pydantic(name, value) -> None:
    strict = {"strict": True, "allow_inf_nan": False}
    if type(value) is int and conforms(float(value), HINTS[name]):
        return  # a whole number is a number in a file; over the network it is sent as a float
    try:
        TypeAdapter(HINTS[name], config=strict).validate_python(value)
        sound = True
    except ValidationError:
        sound = False
    assert conforms(value, HINTS[name]) is sound


def test_an_annotation_that_no_parameter_has_is_an_error() -> None:
    with pytest.raises(TypeError, match="no bound"):
        conforms(1.0, Annotated[float, "positive"])
