"""Where signals part and by how much, on rows made by hand."""

from math import inf, nan

import numpy as np
import pytest

from configs.errors import ScenarioError
from configs.signals import Signal
from fleetloop.results.divergence import Pair, Tolerance, by_size, divergence_table, divergences

TABLES = {"controller": (Signal("t_s", "s", ""), Signal("s", "m", ""), Signal("mu", "m/s", ""))}


def rows(*, ticks: int = 10, **signals: list[float]) -> np.ndarray:
    made = np.zeros(ticks, [("tick", "<i8"), ("t_s", "<f8"), *((name, "<f8") for name in signals)])
    made["tick"] = np.arange(ticks)
    made["t_s"] = np.arange(ticks) * 0.1
    for name, values in signals.items():
        made[name][: len(values)] = values
    return made


def pair(a: np.ndarray, b: np.ndarray, robot: str = "r1") -> Pair:
    return Pair(robot, "controller", a, b)


def test_the_first_and_the_largest_difference_are_of_any_robot() -> None:
    found = divergences(
        [
            pair(rows(s=[1, 2, 3, 4], mu=[0]), rows(s=[1, 2, 3, 4.5], mu=[0])),
            pair(rows(s=[1, 2, -8], mu=[0]), rows(s=[1, 2.25, -8], mu=[0]), "r2"),
        ],
        TABLES,
    )
    (one,) = found
    assert (one.signal.name, one.signal.unit, one.values) == ("s", "m", 2)
    assert one.first == (1, pytest.approx(0.1), "r2", 2.0, 2.25)
    assert one.largest == (3, pytest.approx(0.3), "r1", 4.0, 4.5)
    assert (one.size, one.scale, one.relative) == (0.5, 8.0, 0.0625)


def test_signals_are_ranked_as_they_part_and_by_size_of_their_own_peak() -> None:
    a = rows(s=[100, 100], mu=[0, 1e-3])
    b = rows(s=[101, 100], mu=[0, 2e-3])
    found = divergences([pair(a, b)], TABLES)
    assert [one.signal.name for one in found] == ["s", "mu"]
    assert [one.signal.name for one in by_size(found)] == ["mu", "s"]


def test_every_bit_counts_without_a_tolerance_and_none_below_it() -> None:
    a, b = rows(s=[0.0, 1.0, nan, 5.0]), rows(s=[-0.0, np.nextafter(1.0, 2.0), nan, 5.0])
    (one,) = divergences([pair(a, b)], TABLES)
    assert (one.first.tick, one.values) == (0, 2)
    assert divergences([pair(a, b)], TABLES, Tolerance(0.0))[0].first.tick == 1
    assert divergences([pair(a, b)], TABLES, Tolerance(1e-15)) == []


def test_what_is_no_number_in_one_of_both_is_infinitely_far() -> None:
    for other in (nan, inf):
        found = divergences([pair(rows(s=[1, 2]), rows(s=[1, other]))], TABLES, Tolerance(1e12))
        (one,) = found
        assert (one.size, one.relative, one.first.tick) == (inf, inf, 1)
        assert one.as_dict()["size"] is None
        table = divergence_table(found, labels=("A", "B"))
        assert "not a number" in list(table.columns[3].cells)
    assert divergences([pair(rows(s=[inf]), rows(s=[inf]))], TABLES) == []


def test_signals_that_one_run_lacks_are_left_out() -> None:
    assert divergences([pair(rows(s=[1]), rows(mu=[5]))], TABLES) == []


def test_a_table_shows_so_many_signals() -> None:
    names = [f"x{n}" for n in range(30)]
    a = rows(**{name: [0.0] for name in names})
    b = rows(**{name: [1.0] for name in names})
    found = divergences([pair(a, b)], TABLES)
    assert divergence_table(found, labels=("A", "B")).row_count == 20
    assert divergence_table(found, labels=("A", "B"), most=None).row_count == 30


def test_a_tolerance_of_a_signal_goes_before_that_of_all() -> None:
    tolerance = Tolerance.parse(["1e-3", "s=0.5"])
    assert (tolerance.of("s"), tolerance.of("mu")) == (0.5, 1e-3)
    assert Tolerance.parse(["s=0.5"]).of("mu") is None
    assert not Tolerance.parse([])


@pytest.mark.parametrize("text", ["-1", "x", "s=-1", "=1", "nan", "s=inf", "s="])
def test_a_tolerance_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ScenarioError, match=f"--tolerance {text}: must be a number from 0 on"):
        Tolerance.parse([text])


def test_a_tolerance_that_comes_twice_is_refused() -> None:
    with pytest.raises(ScenarioError, match="that of all signals came twice"):
        Tolerance.parse(["1", "2"])
    with pytest.raises(ScenarioError, match="--tolerance s=2: s came twice"):
        Tolerance.parse(["s=1", "s=2"])
