"""Coordination with values held between shares: its exact map from share to share, on graphs.

The map of one robot is measured on `Neighbours` and `Coordinator`, which are linear in what they
are given: the responses to unit states and to unit values heard, now and at the share before, are
its columns. The map of a fleet is put together from these by the graph, with what was said before
as part of its state, so its eigenvalues say what becomes of every start, also of a law that makes
something of two values heard in turn.
"""

from functools import cache

import numpy as np
import pytest

from agents.coordination import CoordinationState, Coordinator
from agents.neighbours import Neighbours
from configs.edges import InEdge
from configs.sections import Coordination

P, Q = 2.0, 1.0
LIMITS = Coordination(p=P, q=Q, mu_0=0.0, v_hat_0=0.0, age_limit_s=10.0, silence_limit_s=10.0)
H_S = 0.02
V, LAST_V, MU, S, LAST_S = range(5)
OWN = V, MU, S
PERIODS_S = (0.02, 0.1, 0.3, 0.6, 1.0, 1.5, 2.0, 3.0)
SAMPLE = 3000
"""Graphs drawn where there are too many: 2²⁰ and 2³⁰ on five and six robots."""


@cache
def one_robot(heard: int, hears_leader: bool, share_every: int) -> np.ndarray:
    """3 × 7: (v̂, μ, s) after a share period, from what it was and from what was heard.

    Columns: (v̂, μ, s), then (v̂_j, s_j) of each heard, then what each had said the share before.
    """
    mind = Coordinator(LIMITS, H_S)
    period_ns, tick_ns = round(share_every * H_S * 1e9), round(H_S * 1e9)
    columns = []
    for unit in np.eye(7):
        names = [f"r{n}" for n in range(heard)]
        ears = Neighbours([InEdge(name) for name in names], LIMITS, H_S)
        for name in names:
            ears.receive(name, 0, unit[6] / heard, unit[5] / heard)
            ears.receive(name, period_ns, unit[4] / heard, unit[3] / heard)
        state = CoordinationState(*unit[:3])
        for tick in range(share_every):
            sums = ears.sums(period_ns + tick * tick_ns, 0.0)
            state = mind.advance(state, sums, float(hears_leader), 0.0)
        columns.append(state.in_order())
    return np.array(columns).T


def fleets(adjacency: np.ndarray, leader: np.ndarray, share_every: int) -> np.ndarray:
    """(graphs, 5, N, 5, N): all robots' v̂, their last v̂, μ, s, last s, from share to share."""
    count, n, _ = adjacency.shape
    blocks = np.array([[one_robot(d, h, share_every) for h in (False, True)] for d in range(n)])
    rows = blocks[adjacency.sum(axis=2).astype(int), leader.astype(int)]  # (graphs, N, 3, 7)
    maps = np.zeros((count, 5, n, 5, n))
    own = np.arange(n)
    for to, row in zip(OWN, range(3), strict=True):
        for of, column in zip(OWN, range(3), strict=True):
            maps[:, to, own, of, own] = rows[:, :, row, column]
        for of, column in zip((V, S, LAST_V, LAST_S), range(3, 7), strict=True):
            maps[:, to, :, of] += rows[:, :, row, column, None] * adjacency
    maps[:, LAST_V, own, V, own] = maps[:, LAST_S, own, S, own] = 1.0
    return maps


def block(maps: np.ndarray, *kinds: int) -> np.ndarray:
    """The part of the maps between these kinds of state."""
    count, _, n, _, _ = maps.shape
    part = maps[:, kinds][:, :, :, kinds]
    return part.reshape(count, len(kinds) * n, len(kinds) * n)


def rooted_graphs(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Adjacencies (graphs, N, N) with a root, and links of the leader to the first root."""
    places = [(i, j) for i in range(n) for j in range(n) if i != j]
    if n <= 4:
        bits = np.arange(2 ** len(places))[:, None] >> np.arange(len(places)) & 1
    else:
        random = np.random.default_rng(n)
        bits = random.random((SAMPLE, len(places))) < random.random((SAMPLE, 1))
    adjacency = np.zeros((len(bits), n, n))
    for column, (i, j) in enumerate(places):
        adjacency[:, i, j] = bits[:, column]
    reached = np.linalg.matrix_power(np.eye(n) + adjacency, n - 1) > 0  # [i, j]: j reaches i
    roots = reached.all(axis=1)
    some = roots.any(axis=1)
    leader = np.eye(n)[roots[some].argmax(axis=1)]
    return adjacency[some], leader


def radius(maps: np.ndarray) -> np.ndarray:
    return np.abs(np.linalg.eigvals(maps)).max(axis=1)


@pytest.mark.parametrize("robots", [2, 3, 4, 5, 6])
def test_the_speed_estimates_converge_on_every_graph_at_every_share_period(robots: int) -> None:
    adjacency, leader = rooted_graphs(robots)
    assert len(adjacency) == {2: 3, 3: 51, 4: 3614}.get(robots, len(adjacency))
    for period_s in PERIODS_S:
        maps = fleets(adjacency, leader, round(period_s / H_S))
        assert radius(block(maps, V, LAST_V)).max() < 1.0 - 1e-5, period_s


@pytest.mark.parametrize("robots", [2, 3, 4, 5, 6])
def test_path_variables_agree_on_every_graph_that_is_positive(robots: int) -> None:
    # p² ≥ 4 q d_max: sampled or not, each s is drawn to an average of what is heard.
    adjacency, leader = rooted_graphs(robots)
    positive = 4 * Q * adjacency.sum(axis=2).max(axis=1) <= P**2
    for period_s in PERIODS_S:
        maps = fleets(adjacency[positive], leader[positive], round(period_s / H_S))
        sizes = np.sort(np.abs(np.linalg.eigvals(block(maps, MU, S, LAST_S))), axis=1)
        assert sizes[:, -1] == pytest.approx(1.0, abs=1e-9)  # all s together: the formation's place
        assert sizes[:, -2].max() < 1.0 - 1e-6, period_s
