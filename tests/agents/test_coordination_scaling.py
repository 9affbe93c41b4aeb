"""Time to agree by size and shape of the graph, from zero with the leader at the first robot.

T_v: all v̂ within 5 % of v_r; T_s: spread of s below 0.05 m. A chain takes 2.1 s a robot although
all its eigenvalues are −1: L is one Jordan block.
"""

import numpy as np
import pytest
from support.coordinated_fleet import coordinated_fleet

from configs.graph import Graph, generated
from configs.sections import Coordination

V_R, H_S = 0.6, 0.05


def times(kind: str, robots: int, duration_s: float) -> tuple[float, float, float]:
    """(T_v [s], T_s [s], peak spread [m])."""
    names = [f"r{n}" for n in range(robots)]
    graph = Graph.of(names, generated(kind, names), names[:1])
    history = coordinated_fleet(graph, Coordination(), round(duration_s / H_S), h_s=H_S)
    apart = np.abs(history[:, :, 0] - V_R).max(axis=1) > 0.05 * V_R
    spread = history[:, :, 2].max(axis=1) - history[:, :, 2].min(axis=1)
    return last(apart), last(spread > 0.05), float(spread.max())


def last(condition: np.ndarray) -> float:
    return H_S * float(np.flatnonzero(condition)[-1] + 1)


@pytest.mark.parametrize(
    ("kind", "robots", "t_v_s", "t_s_s", "peak_m"),
    [
        ("chain", 4, 7.8, 13.2, 1.1),
        ("chain", 64, 78.0, 153.0, 34.0),
        ("ring", 4, 18.0, 14.0, 0.425),
        ("ring", 16, 76.0, 206.0, 2.9),
        ("tree", 4, 6.3, 10.2, 0.7),
        ("tree", 64, 12.0, 21.0, 2.6),
    ],
)
def test_a_fleet_agrees_in_the_time_of_its_shape(
    kind: str, robots: int, t_v_s: float, t_s_s: float, peak_m: float
) -> None:
    found = times(kind, robots, 1.25 * max(t_v_s, t_s_s) + 5.0)
    assert found[0] == pytest.approx(t_v_s, rel=0.06)
    assert found[1] == pytest.approx(t_s_s, rel=0.06)
    assert found[2] == pytest.approx(peak_m, rel=0.08)
