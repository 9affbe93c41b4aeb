"""Values with names: what a law is told and what it brings."""

import pickle

import pytest

from agents.laws.interface import LawOutput, PathVariable, Reference, RobotMotion
from agents.laws.values import Values

MOTION = RobotMotion(1.0, 2.0, 0.5, 0.6, 0.1)


@pytest.mark.parametrize(
    ("values", "names"),
    [
        (MOTION, ("x", "y", "theta", "v", "omega")),
        (Reference(1.0, 2.0, 0.5, 1.1, 0.2), ("x", "y", "theta", "v_bar", "omega_bar")),
        (PathVariable(3.0, 0.6, 0.0), ("s", "s_dot", "s_ddot")),
        (LawOutput(0.1, 0.2, None, (0.3,)), ("tau_right", "tau_left", "state", "signals")),
    ],
)
def test_values_come_in_the_order_of_the_constructor(
    values: Values, names: tuple[str, ...]
) -> None:
    in_order = tuple(getattr(values, name) for name in names)
    assert tuple(values) == in_order
    assert type(values)(*in_order) == values


def test_only_the_same_kind_with_the_same_values_is_equal() -> None:
    assert RobotMotion(1.0, 2.0, 0.5, 0.6, 0.1) == MOTION
    assert hash(RobotMotion(1.0, 2.0, 0.5, 0.6, 0.1)) == hash(MOTION)
    assert RobotMotion(1.0, 2.0, 0.5, 0.6, 0.2) != MOTION
    assert Reference(*MOTION) != MOTION
    assert MOTION != (1.0, 2.0, 0.5, 0.6, 0.1)


def test_they_are_pickled_by_their_values() -> None:
    assert pickle.loads(pickle.dumps(MOTION)) == MOTION


def test_they_show_what_makes_them() -> None:
    assert repr(PathVariable(3.0, 0.6, 0.0)) == "PathVariable(3.0, 0.6, 0.0)"
