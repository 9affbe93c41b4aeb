"""Speed estimate and path variable: exact maps, and the whole fleet against its exact solution."""

from math import exp

import numpy as np
import pytest
from support.coordinated_fleet import coordinated_fleet

from agents.coordination import MOST_MAPS, CoordinationState, Coordinator, matrix_exponential
from agents.neighbours import Sums
from configs.loading import load
from configs.scenario import Scenario
from configs.sections import Coordination

GAINS = Coordination(p=2.0, q=1.0, mu_0=0.0, v_hat_0=0.0, age_limit_s=2.0, silence_limit_s=2.0)
H = 0.001
NOBODY = Sums(0, 0.0, 0.0, 0.0)


def fleet(scenario: Scenario, share_every: int, ticks: int) -> np.ndarray:
    return coordinated_fleet(scenario.topology, GAINS, ticks, h_s=H, share_every=share_every)


def exact(scenario: Scenario, ticks: int) -> np.ndarray:
    """The same from the linear system of all robots at once, by powers of its exact map."""
    graph = scenario.topology
    n = len(graph.robots)
    laplacian = graph.laplacian()
    links = np.diag([graph.links[r].weight if r in graph.leader else 0.0 for r in graph.robots])
    zero, one = np.zeros((n, n)), np.eye(n)
    generator = np.block(
        [
            [-(laplacian + links), zero, zero, links @ np.ones((n, 1)) * 0.6],
            [zero, -2.0 * one, -laplacian, np.zeros((n, 1))],
            [one, one, zero, np.zeros((n, 1))],
            [np.zeros((1, 3 * n + 1))],
        ]
    )
    step, term = np.eye(3 * n + 1), np.eye(3 * n + 1)
    for order in range(1, 12):
        term = term @ generator * H / order
        step = step + term
    state = np.append(np.zeros(3 * n), 1.0)
    history = [state]
    for _ in range(ticks):
        state = step @ state
        history.append(state)
    return np.array(history)[:, : 3 * n].reshape(-1, 3, n).transpose(0, 2, 1)


WEIGHTS = (
    "graph.weights={'r1 -> r2'=0.5, 'r2 -> r4'=0.3, 'r1 -> r3'=1.7, 'leader -> r1'=2.0}",
    "graph.weights='normalised'",
)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        *((f"paper{kind}", ()) for kind in ("", "_ring", "_tree", "_star", "_extra")),
        *(("paper_tree", (weights,)) for weights in WEIGHTS),
    ],
)
def test_with_fresh_data_every_tick_the_fleet_follows_the_exact_solution(
    name: str, changes: tuple[str, ...]
) -> None:
    scenario = load(name, changes)
    ours, truth = fleet(scenario, 1, 15_000), exact(scenario, 15_000)
    assert np.abs(ours[:, :, 0] - truth[:, :, 0]).max() < 1e-3  # v̂
    # v̂_j held over a tick is half a tick old: 0.3 mm per hop, and once round the ring.
    assert np.abs(ours[:, :, 2] - truth[:, :, 2]).max() < 1.5e-3  # s
    s_dot = (ours[:, :, 0] + ours[:, :, 1]) - (truth[:, :, 0] + truth[:, :, 1])
    assert np.abs(s_dot).max() < 1e-3


def test_shared_at_50_hz_the_chains_spread_peaks_within_2_percent_of_the_exact_one() -> None:
    scenario = load("paper")
    spreads = [
        (history[:, :, 2].max(axis=1) - history[:, :, 2].min(axis=1)).max()
        for history in (fleet(scenario, 20, 15_000), exact(scenario, 15_000))
    ]
    assert spreads[0] == pytest.approx(1.136, abs=0.02)
    assert spreads[0] == pytest.approx(spreads[1], rel=0.02)


def test_alone_with_the_leader_the_estimate_is_a_first_order_lag() -> None:
    mind = Coordinator(GAINS, H)
    state = CoordinationState(0.0, 0.0, 0.0)
    for _ in range(2000):
        state = mind.advance(state, NOBODY, 1.0, 0.6)
    assert state.v_hat == pytest.approx(0.6 * (1 - exp(-2.0)), rel=1e-12)
    assert state.s == pytest.approx(0.6 * (2.0 - (1 - exp(-2.0))), rel=1e-11)


def test_without_anybody_to_hear_the_estimate_stays_and_mu_decays() -> None:
    mind = Coordinator(GAINS, H)
    state = mind.advance(CoordinationState(0.3, 1.0, 5.0), NOBODY, 0.0, 0.6)
    assert state.v_hat == 0.3
    assert state.mu == pytest.approx(exp(-2.0 * H))


def test_the_exponential_of_a_rotation_is_cosine_and_sine() -> None:
    assert np.array(matrix_exponential([[0.0, -2.0], [2.0, 0.0]])) == pytest.approx(
        np.array([[np.cos(2), -np.sin(2)], [np.sin(2), np.cos(2)]]), abs=1e-13
    )
    assert matrix_exponential([[-30.0]])[0][0] == pytest.approx(exp(-30.0), rel=1e-9)


def test_maps_are_kept_for_some_sums_of_weights_only() -> None:
    mind = Coordinator(GAINS, H)
    state = CoordinationState(0.3, 0.1, 5.0)
    kinds = [(0.1 * n, h) for n in range(MOST_MAPS) for h in (0.0, 1.0)]
    first = [mind.advance(state, Sums(n, d, 2.0, 0.5), h, 0.6) for n, (d, h) in enumerate(kinds)]
    assert len(mind._maps) <= MOST_MAPS
    again = [mind.advance(state, Sums(n, d, 2.0, 0.5), h, 0.6) for n, (d, h) in enumerate(kinds)]
    assert again == first
