"""Bookkeeping of in-neighbours: carrying values on, silence, order."""

import pytest

from agents.neighbours import Neighbours, Sums
from configs.edges import InEdge
from configs.sections import Coordination

LIMITS = Coordination(p=2.0, q=1.0, mu_0=0.0, v_hat_0=0.0, age_limit_s=0.5, silence_limit_s=1.0)
MS = 1_000_000
HALF = 0.0005


def ears(*names: str) -> Neighbours:
    return Neighbours([InEdge(name) for name in names], LIMITS, 0.001)


def numbers(sums: Sums) -> tuple[int, float, float, float]:
    return sums.neighbours, sums.degree, sums.s, sums.v


def test_a_value_is_carried_on_by_its_age_to_the_middle_of_the_period() -> None:
    heard = ears("r2")
    heard.receive("r2", 0, 1.0, 0.6)
    assert heard.sums(0, 0.0).s == pytest.approx(1.0 + 0.6 * HALF)
    assert heard.sums(15 * MS, 0.0).s == pytest.approx(1.0 + 0.6 * (0.015 + HALF))


def test_a_value_is_carried_on_no_further_than_the_age_limit() -> None:
    heard = ears("r2")
    heard.receive("r2", 0, 1.0, 0.6)
    assert heard.sums(800 * MS, 0.0).s == pytest.approx(1.0 + 0.6 * (0.5 + HALF))


def test_a_silent_neighbour_leaves_the_sums_and_comes_back_when_it_speaks() -> None:
    heard = ears("r2", "r3")
    heard.receive("r2", 0, 1.0, 0.5)
    heard.receive("r3", 0, 2.0, 0.5)
    assert heard.sums(1000 * MS, 0.0).neighbours == 2
    heard.receive("r3", 1000 * MS, 3.0, 0.5)
    assert heard.sums(1001 * MS, 0.0).neighbours == 1
    heard.receive("r2", 1002 * MS, 4.0, 0.5)
    assert heard.sums(1002 * MS, 0.0).neighbours == 2


def test_who_has_not_spoken_yet_does_not_count() -> None:
    assert numbers(ears("r2", "r3").sums(0, 0.0)) == (0, 0.0, 0.0, 0.0)


def test_old_and_repeated_messages_change_nothing() -> None:
    heard = ears("r2")
    heard.receive("r2", 20 * MS, 1.0, 0.6)
    before = numbers(heard.sums(30 * MS, 0.0))
    heard.receive("r2", 10 * MS, 9.0, 9.0)
    heard.receive("r2", 20 * MS, 9.0, 9.0)
    assert numbers(heard.sums(30 * MS, 0.0)) == before


def test_sums_do_not_depend_on_the_order_of_arrival() -> None:
    one, other = ears("r2", "r3", "r4"), ears("r2", "r3", "r4")
    said = [("r2", 0.1, 0.6), ("r3", 0.7, 0.5), ("r4", 1e-9, 0.3)]
    for name, s, v in said:
        one.receive(name, 0, s, v)
    for name, s, v in reversed(said):
        other.receive(name, 0, s, v)
    assert numbers(one.sums(7 * MS, 0.0)) == numbers(other.sums(7 * MS, 0.0))


def test_the_speed_estimate_is_held_as_received() -> None:
    heard = ears("r2")
    heard.receive("r2", 0, 0.0, 0.50)
    heard.receive("r2", 20 * MS, 0.0, 0.52)
    assert heard.sums(30 * MS, 0.0).v == 0.52
    assert heard.sums(300 * MS, 0.0).v == 0.52


def test_each_neighbour_counts_with_its_weight() -> None:
    heard = Neighbours([InEdge("r2", 0.5), InEdge("r3", 2.0)], LIMITS, 0.001)
    heard.receive("r2", 0, 1.0, 0.6)
    assert numbers(heard.sums(0, 0.0)) == (1, 0.5, 0.5 * (1.0 + 0.6 * HALF), 0.5 * 0.6)
    heard.receive("r3", 0, 4.0, 0.25)
    both = heard.sums(0, 0.0)
    assert numbers(both)[:2] == (2, 2.5)
    assert both.s == pytest.approx(0.5 * (1.0 + 0.6 * HALF) + 2.0 * (4.0 + 0.25 * HALF))
    assert both.v == pytest.approx(0.5 * 0.6 + 2.0 * 0.25)


def test_a_weight_of_one_changes_no_bit_of_the_sums() -> None:
    said = [("r2", 0.1, 0.6), ("r3", 0.7, 0.5), ("r4", 1e-9, 0.3)]
    heard = ears(*(name for name, _, _ in said))
    for name, s, v in said:
        heard.receive(name, 0, s, v)
    age = 7 * MS * 1e-9
    sum_s = sum_v = 0.0
    for _, s, v in said:
        sum_s += s + v * (age + HALF)
        sum_v += v
    assert numbers(heard.sums(7 * MS, 0.0)) == (3, 3.0, sum_s, sum_v)
