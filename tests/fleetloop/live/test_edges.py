"""Edges as they are: ages of what came, losses from arrivals, edges that are dead or not there."""

import numpy as np
import pytest

from configs.edges import InEdge
from configs.signals import age_signals
from fleetloop.live.edges import ABSENT, DEAD, OK, LiveEdge, cut_edges

PERIOD_S, SHARE_S = 0.01, 0.05
TABLE = age_signals(["r1"])


def edge(**options: object) -> LiveEdge:
    one = InEdge("r1", **options)
    return LiveEdge(one, "r2", TABLE, share_period_s=SHARE_S, period_s=PERIOD_S)


def ages(ticks: int, arrives: object) -> np.ndarray:
    """Ages of an edge whose message arrives at ticks k share with `arrives(k)`."""
    made, age_s, every = [], 0.0, round(SHARE_S / PERIOD_S)
    for tick in range(ticks):
        fresh = tick % every == 0 and arrives(tick // every)
        age_s = 0.0 if fresh else age_s + PERIOD_S
        made.append([age_s])
    return np.array(made)


def fed(one: LiveEdge, rows: np.ndarray) -> LiveEdge:
    for first in range(0, len(rows), 32):
        block = rows[first : first + 32]
        one.add(first + len(block) - 1, block)
    return one


@pytest.mark.parametrize(("every", "lost"), [(1, 0.0), (2, 0.5), (4, 0.75)])
def test_losses_are_the_share_of_messages_that_do_not_come(every: int, lost: float) -> None:
    one = fed(edge(), ages(2000, lambda k: k % every == 0))
    assert one.lost == pytest.approx(lost, abs=0.05)
    assert one.state(()) == OK


def test_an_edge_from_which_nothing_comes_any_more_is_dead_and_alive_again_afterwards() -> None:
    one = fed(edge(), ages(400, lambda k: k < 20))
    assert one.state(()) == DEAD
    assert one.age_s == pytest.approx(3.04, abs=0.02)
    one.add(400, np.array([[0.0]]))
    assert one.state(()) == OK


def test_an_edge_of_a_graph_that_switches_is_there_in_its_windows() -> None:
    one = edge(windows=((0, 10), (20, 30)))
    states = []
    for tick in (5, 15, 25):
        one.add(tick, np.zeros((1, 1)))
        states.append(one.state(()))
    assert states == [OK, ABSENT, OK]


def test_an_edge_without_recorded_ages_has_those_that_its_hearer_says() -> None:
    one = LiveEdge(InEdge("r1"), "r2", (), share_period_s=SHARE_S, period_s=PERIOD_S)
    one.add(10, np.empty((1, 0)))
    one.note_age(0.02)
    assert one.state(()) == OK
    one.note_age(2.0)
    assert one.state(()) == DEAD


def test_a_partition_that_acts_cuts_the_edges_that_it_names() -> None:
    faults = [
        {"kind": "link_partition", "state": "acting", "targets": ["r1 -> r2"]},
        {"kind": "link_partition", "state": "over", "targets": ["r2 -> r3"]},
        {"kind": "link_loss", "state": "acting", "targets": ["r3 -> r4"]},
        {"kind": "link_partition", "state": "acting"},
    ]
    edges = [("r1", "r2"), ("r2", "r3"), ("r3", "r4")]
    assert cut_edges(faults, edges) == {("r1", "r2")}
    assert edge().state({("r1", "r2")}) == DEAD
