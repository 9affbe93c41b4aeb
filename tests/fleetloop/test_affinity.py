"""Cores for the processes of a lockstep run."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleetloop.affinity import PLANT_SHARE, cores_of


def test_four_robots_on_two_cores_put_one_controller_beside_the_plant() -> None:
    assert cores_of(4, [0, 1]) == (0, [0, 1, 1, 1])


@pytest.mark.parametrize("cores", [[0], [0, 1, 2, 3, 4]])
def test_one_core_or_cores_for_everybody_leave_it_to_the_scheduler(cores: list[int]) -> None:
    assert cores_of(4, cores) == (None, [None] * 4)


@given(st.integers(2, 64), st.integers(2, 8))
def test_no_core_has_much_more_to_do_than_another(controllers: int, count: int) -> None:
    cores = list(range(10, 10 + count))
    plant, placed = cores_of(controllers, cores)
    if count > controllers:
        assert plant is None
        return
    assert len(placed) == controllers
    work = Counter(placed)
    load = [work[core] + (PLANT_SHARE * controllers if core == plant else 0.0) for core in cores]
    assert max(load) <= max((1.0 + PLANT_SHARE) * controllers / count, load[0]) + 1.0
