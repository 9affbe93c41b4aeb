"""Coordination with values held between shares: its exact map from share to share, on graphs.

The map of one robot is measured on `Neighbours` and `Coordinator`, which are linear in what they
are given: the responses to unit states and to unit values heard are its columns. The map of a fleet
is put together from these by the graph, so its eigenvalues say what becomes of every start.
"""

from functools import cache

import numpy as np
import pytest

from agents.coordination import CoordinationState, Coordinator
from agents.neighbours import Neighbours
from configs.brief import Coordination

P, Q = 2.0, 1.0
LIMITS = Coordination(
    p=P, q=Q, s_0=0.0, mu_0=0.0, v_hat_0=0.0, age_limit_s=10.0, silence_limit_s=10.0
)
H_S = 0.02
PERIODS_S = (0.02, 0.1, 0.3, 0.6, 1.0, 1.5, 2.0, 3.0)
SAMPLE = 3000
"""Graphs drawn where there are too many: 2²⁰ and 2³⁰ on five and six robots."""


@cache
def one_robot(heard: int, hears_leader: bool, share_every: int) -> np.ndarray:
    """3 × 5: (v̂, μ, s) after a share period from (v̂, μ, s) and from (v̂_j, s_j) of each heard."""
    mind = Coordinator(LIMITS, H_S, hears_leader)
    columns = []
    for unit in np.eye(5):
        names = [f"r{n}" for n in range(heard)]
        ears = Neighbours(names, LIMITS, H_S)
        for name in names:
            ears.hear(name, 0, unit[4] / heard, unit[3] / heard)
        state = CoordinationState(*unit[:3])
        for tick in range(share_every):
            state = mind.advance(state, *ears.sums(round(tick * H_S * 1e9)), 0.0)
        columns.append(state)
    return np.array(columns).T


def fleets(adjacency: np.ndarray, leader: np.ndarray, share_every: int) -> np.ndarray:
    """(graphs, 3 N, 3 N): all robots' v̂, then μ, then s, from one share to the next."""
    count, n, _ = adjacency.shape
    blocks = np.array([[one_robot(d, h, share_every) for h in (False, True)] for d in range(n)])
    rows = blocks[adjacency.sum(axis=2).astype(int), leader.astype(int)]  # (graphs, N, 3, 5)
    maps = np.zeros((count, 3, n, 3, n))
    own = np.arange(n)
    for to in range(3):
        for of in range(3):
            maps[:, to, own, of, own] = rows[:, :, to, of]
        maps[:, to, :, 0] += rows[:, :, to, 3, None] * adjacency
        maps[:, to, :, 2] += rows[:, :, to, 4, None] * adjacency
    return maps.reshape(count, 3 * n, 3 * n)


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
        assert radius(maps[:, :robots, :robots]).max() < 1.0 - 1e-5, period_s


@pytest.mark.parametrize("robots", [2, 3, 4, 5, 6])
def test_path_variables_agree_on_every_graph_that_is_positive(robots: int) -> None:
    # p² ≥ 4 q d_max: sampled or not, each s is drawn to an average of what is heard.
    adjacency, leader = rooted_graphs(robots)
    positive = 4 * Q * adjacency.sum(axis=2).max(axis=1) <= P**2
    for period_s in PERIODS_S:
        maps = fleets(adjacency[positive], leader[positive], round(period_s / H_S))
        sizes = np.sort(np.abs(np.linalg.eigvals(maps[:, robots:, robots:])), axis=1)
        assert sizes[:, -1] == pytest.approx(1.0, abs=1e-9)  # all s together: the formation's place
        assert sizes[:, -2].max() < 1.0 - 1e-6, period_s
