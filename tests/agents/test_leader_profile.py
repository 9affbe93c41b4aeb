"""Path variables of a chain whose leader changes its speed, against closed forms.

The leader speaks to robot 1, i + 1 hears i; p = 2, q = 1, from agreement. By (38) the transfer from
v_r to v̂_i is 1/(λ + 1)^i, and by (40), (45)

    (λ + 1)² δ_i+1 = (λ + 2) (v̂_i − v̂_i+1) + δ_i,     δ_i+1 = s_i − s_i+1,  δ_1 = 0

so with P(m, t) = 1 − e^−t Σ_k<m t^k/k!, the response of 1/(λ (λ + 1)^m), a ramp of a [m/s²] gives

    δ_i+1(t) = a Σ_m=i+3..2i+2 [P(m − 1, t) + P(m, t)]  →  2 i a = i a p / q

a step of v the derivative of that with v for a, and a ramp's end another ramp of −a.
"""

from math import exp, factorial

import numpy as np
import pytest
from support.coordinated_fleet import coordinated_fleet

from configs.graph import Graph, generated
from configs.leader_speed import SpeedChange
from configs.sections import Coordination

ROBOTS = 4
NAMES = [f"r{n}" for n in range(ROBOTS)]
CHAIN = Graph.of(NAMES, generated("chain", NAMES), NAMES[:1])
H_S = 0.005


def gaps(changes: list[SpeedChange], seconds: float, v_r: float, **gains: float) -> np.ndarray:
    """(ticks + 1, 3): s_i − s_i+1 [m], from agreement at v_r."""
    coordination = Coordination(v_hat_0=v_r, **gains)
    ticks = round(seconds / H_S)
    s = coordinated_fleet(CHAIN, coordination, ticks, h_s=H_S, v_r=v_r, changes=changes)[:, :, 2]
    return s[:, :-1] - s[:, 1:]


def lag(m: int, t_s: float) -> float:
    """P(m, t), 0 before t = 0."""
    if t_s <= 0.0:
        return 0.0
    return 1.0 - exp(-t_s) * sum(t_s**k / factorial(k) for k in range(m))


def of_ramp(i: int, t_s: float) -> float:
    """δ_i+1 per unit of a."""
    return sum(lag(m - 1, t_s) + lag(m, t_s) for m in range(i + 3, 2 * i + 3))


def test_a_ramp_and_its_end_open_and_close_a_chain_by_the_closed_form() -> None:
    # v_r from 0.2 to 0.8 m/s in 12 s, from t = 1 s on.
    found = gaps([SpeedChange(1_000_000_000, 0.8, 12_000_000_000)], 40.0, 0.2)
    for tick in range(0, 8000, 100):
        t_s = tick * H_S - 1.0
        exact = [0.05 * (of_ramp(i, t_s) - of_ramp(i, t_s - 12.0)) for i in (1, 2, 3)]
        assert found[tick] == pytest.approx(exact, abs=2e-3)
    assert np.abs(found[-1]).max() < 2e-3


def test_a_stop_along_a_step_opens_a_chain_by_the_closed_form() -> None:
    found = gaps([SpeedChange(0, 0.0)], 20.0, 0.6)
    for tick in range(100, 4000, 100):
        t_s = tick * H_S
        exact = [-0.6 * (of_ramp(i, t_s + 1e-4) - of_ramp(i, t_s - 1e-4)) / 2e-4 for i in (1, 2, 3)]
        assert found[tick] == pytest.approx(exact, abs=3e-3)


@pytest.mark.parametrize(("p", "q"), [(2.0, 1.0), (3.0, 2.0), (1.0, 0.5)])
def test_along_a_long_ramp_neighbours_keep_i_a_p_over_q_between_them(p: float, q: float) -> None:
    found = gaps([SpeedChange(0, 6.0, 60_000_000_000)], 60.0, 0.0, p=p, q=q)
    assert found[-1] == pytest.approx([i * 0.1 * p / q for i in (1, 2, 3)], rel=0.01)
