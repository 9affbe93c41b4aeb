"""Coordination over emulated edges: biases, delay margins, losses, against their formulas.

Mean age T = delay + half the share period.
"""

from math import atan2, sqrt

import numpy as np
import pytest
from support.coordinated_fleet import coordinated_fleet

from configs.graph import Graph, generated
from configs.netem import BernoulliLoss, ConstantDelay, Effects
from configs.sections import Coordination

V_R = 0.6


def shape(kind: str, robots: int) -> Graph:
    names = [f"r{n}" for n in range(robots)]
    return Graph.of(names, generated(kind, names), names[:1])


def delayed(delay_s: float, loss: float = 0.0) -> Effects:
    return Effects(
        delay=ConstantDelay(kind="constant", delay_s=delay_s),
        loss=BernoulliLoss(kind="bernoulli", probability=loss),
    )


def spread(history: np.ndarray) -> np.ndarray:
    return history[:, :, 2].max(axis=1) - history[:, :, 2].min(axis=1)


@pytest.mark.parametrize(("delay_s", "share_s"), [(0.0, 0.1), (0.1, 0.05), (0.5, 0.05)])
def test_held_values_leave_a_chain_behind_by_the_speed_times_their_mean_age_per_hop(
    delay_s: float, share_s: float
) -> None:
    hold = Coordination(compensation="hold", age_limit_s=5.0, silence_limit_s=5.0)
    h_s = 0.005
    every = round(share_s / h_s)
    history = coordinated_fleet(
        shape("chain", 4), hold, 12_000, h_s=h_s, share_every=every, effects=delayed(delay_s)
    )
    last = spread(history)[-20 * every :].mean()  # over whole share periods
    assert last == pytest.approx(3 * V_R * (delay_s + 0.5 * share_s), rel=0.01)


@pytest.mark.parametrize("delay_s", [0.3, 0.5])
def test_held_values_slow_a_ring_down_by_its_formula(delay_s: float) -> None:
    hold = Coordination(compensation="hold", age_limit_s=5.0, silence_limit_s=5.0)
    history = coordinated_fleet(shape("ring", 4), hold, 8_000, h_s=0.01, effects=delayed(delay_s))
    v_hat, mu, _ = history[-1].T
    age_s = delay_s + 0.5 * 0.01
    slower = hold.q * V_R * age_s / (hold.p + hold.q * age_s)  # beta is uniform on a ring
    assert (v_hat + mu).mean() - V_R == pytest.approx(-slower, rel=0.01)


def margin_s(eigenvalue: complex, p: float = 2.0, q: float = 1.0) -> float:
    """T* of λ² + p λ + q ζ exp(−λ T) for one eigenvalue ζ of L."""
    size = abs(eigenvalue)
    w = sqrt(0.5 * (-p * p + sqrt(p**4 + 4.0 * (q * size) ** 2)))
    return (atan2(p, w) - abs(np.angle(eigenvalue))) / w


@pytest.mark.parametrize(("kind", "robots", "known_s"), [("ring", 4, 0.69), ("complete", 5, 0.45)])
@pytest.mark.parametrize(("share", "converges"), [(0.9, True), (1.1, False)])
def test_own_values_of_the_same_age_have_the_delay_margin_of_the_spectrum(
    kind: str, robots: int, known_s: float, share: float, converges: bool
) -> None:
    graph = shape(kind, robots)
    zetas = np.linalg.eigvals(graph.laplacian())
    limit_s = min(margin_s(zeta) for zeta in zetas if abs(zeta) > 1e-9)
    assert limit_s == pytest.approx(known_s, abs=0.005)
    both = Coordination(compensation="both", age_limit_s=5.0, silence_limit_s=5.0, v_hat_0=V_R)
    h_s = 0.01
    history = coordinated_fleet(
        graph,
        both,
        6_000,
        h_s=h_s,
        starts=[0.1 * (-1) ** n * (1 + n) for n in range(robots)],
        effects=delayed(share * limit_s - 0.5 * h_s),
    )
    growth = spread(history)[5_000:].max() / spread(history)[2_000:3_000].max()
    assert (growth < 0.7) if converges else (growth > 1.4)


@pytest.mark.parametrize(("kind", "limit_m"), [("chain", 1e-4), ("ring", 5e-3)])
def test_extrapolated_values_agree_under_10_hz_half_a_second_and_half_the_messages_lost(
    kind: str, limit_m: float
) -> None:
    history = coordinated_fleet(
        shape(kind, 4),
        Coordination(),
        6_000,
        h_s=0.01,
        share_every=10,
        effects=delayed(0.5, loss=0.5),
    )
    v_hat, mu, _ = history[-1].T
    assert spread(history)[-500:].max() < limit_m
    assert np.abs(v_hat + mu - V_R).max() < 2e-3
