"""Designs: a case's values follow from its number, the study and the seed alone."""

import itertools

import numpy as np
import pytest

from fleetloop.sweep.design import Design
from fleetloop.sweep.draws import Integers, Levels, Uniform
from fleetloop.sweep.study import Study, loads

DRAWS = [Uniform(0.0, 1.0), Integers(1, 5), Uniform(-1.0, 1.0)]
SAMPLED = ["random", "latin_hypercube", "sobol"]
FACTOR = '\n[[factor]]\nname = "{}"\nkey = "coordination.p"\nvalues = [1.0]'


def study(design: str, cases: int = 64, seed: int = 1) -> Study:
    factors = "".join(FACTOR.format(name) for name in "abc")
    head = f'schema = 1\nbase = "two_robots"\ndesign = "{design}"\nseed = {seed}\n'
    return loads("study.toml", f"{head}cases = {cases}\n{factors}")


@pytest.mark.parametrize("design", SAMPLED)
def test_a_case_is_the_same_whichever_were_asked_for_before(design: str) -> None:
    forward = Design(study(design), DRAWS)
    there = [forward.values(n) for n in range(64)]
    back = Design(study(design), DRAWS)
    assert [back.values(n) for n in reversed(range(64))] == there[::-1]
    assert len({values[0] for values in there}) == 64


@pytest.mark.parametrize("design", SAMPLED)
def test_another_seed_gives_other_cases(design: str) -> None:
    one, other = (Design(study(design, seed=seed), DRAWS).values(3) for seed in (1, 2))
    assert one != other


def test_a_latin_hypercube_has_one_case_in_each_share_of_every_factor() -> None:
    design = Design(study("latin_hypercube"), DRAWS)
    rows = np.array([design.values(n) for n in range(64)])
    assert sorted(np.floor(rows[:, 0] * 64)) == list(range(64))
    assert sorted(np.floor((rows[:, 2] + 1.0) * 32)) == list(range(64))


def test_a_sobol_sequence_has_one_case_in_every_box_of_two_factors() -> None:
    design = Design(study("sobol"), DRAWS)
    rows = np.array([design.values(n) for n in range(64)])
    boxes = {(int(a * 8), int((c + 1.0) * 4)) for a, _, c in rows}
    assert len(boxes) == 64  # a (0, 6, 2)-net in base 2


@pytest.mark.parametrize("cases", [1, 3, 50])
def test_a_sobol_design_may_have_any_number_of_cases(cases: int) -> None:
    design = Design(study("sobol", cases), DRAWS)
    assert len({design.values(n) for n in range(cases)}) == cases


def test_a_random_case_does_not_depend_on_the_number_of_cases() -> None:
    few, many = (Design(study("random", cases), DRAWS) for cases in (10, 1000))
    assert few.values(7) == many.values(7)


def test_a_grid_has_every_combination_once_and_its_last_factor_changes_fastest() -> None:
    levels = [Levels((1.0, 2.0)), Integers(1, 3), Levels(("a", "b"))]
    design = Design(study("grid"), levels)
    cases = [design.values(n) for n in range(12)]
    assert cases == list(itertools.product((1.0, 2.0), (1, 2, 3), ("a", "b")))
