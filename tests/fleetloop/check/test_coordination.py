"""Coordination forecast and sampled map, against known numbers and the controllers themselves."""

from math import inf, isclose

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from support.coordinated_fleet import coordinated_fleet

from agents.coordination import matrix_exponential
from configs.graph import Graph, generated, random_ring
from configs.loading import load
from configs.scenario import Scenario
from fleetloop.check.coordination import (
    _exponential,
    delay_margin_s,
    forecast,
    radii,
    sampled_growth_1_s,
)
from fleetloop.check.graph import continuous_growth_1_s


def shape(kind: str, n: int) -> Graph:
    names = [f"r{k}" for k in range(n)]
    return Graph.of(names, generated(kind, names), names[:1])


def driven(scenario: Scenario, ticks: int) -> np.ndarray:
    """(ticks, robots): the path variables of the controllers' own objects."""
    h = scenario.clock.control_period_s
    history = coordinated_fleet(
        scenario.topology,
        scenario.coordination,
        ticks,
        h_s=h,
        share_every=round(scenario.clock.share_period_s / h),
        v_r=scenario.leader.speed_m_s,
        starts=[robot.s_0 for robot in scenario.robot],
    )
    return history[:-1, :, 2]


WEIGHTS = "graph.weights={'r1 -> r2'=0.5, 'r4 -> r2'=0.2, 'leader -> r1'=3.0}"


SWITCH = (
    "graph.switch=[{random=true, probability=0.5, dwell_s=0.3}, {at_s=6.0, rotate=[['r1 -> r2',"
    " 'leader -> r3'], ['r3 -> r4', 'r2 -> r4', 'leader -> r1'], ['r2 -> r3']], dwell_s=0.7}]"
)


@pytest.mark.parametrize(
    ("share_s", "changes"),
    [
        *((0.02, ()), (0.5, ()), (3.0, ()), (0.5, (WEIGHTS,))),
        *((0.02, (SWITCH,)), (0.5, (SWITCH, WEIGHTS))),
    ],
)
def test_the_forecast_is_what_the_controllers_will_do(
    share_s: float, changes: tuple[str, ...]
) -> None:
    scenario = load(
        "paper_extra",
        (
            f"clock.share_period_s={share_s}",
            "coordination.silence_limit_s=4.0",
            "duration_s=12.0",
            "expect=[]",
            *changes,
        ),
    )
    ahead = forecast(scenario)
    rows = driven(scenario, 12_000)
    ours = np.stack([np.interp(np.arange(12_000) * 1e-3, ahead.t_s, s) for s in ahead.s.T], axis=1)
    assert np.abs(ours - rows).max() < 2e-3


@pytest.mark.parametrize(("robots", "margin_s"), [(5, 2.36), (11, 1.02), (21, 0.63)])
def test_complete_graphs_have_the_delay_margin_of_the_frequency_sweep(
    robots: int, margin_s: float
) -> None:
    assert isclose(delay_margin_s(shape("complete", robots), 2.0, 1.0), margin_s, rel_tol=0.03)


def test_normalised_weights_make_a_complete_graph_stand_any_delay() -> None:
    assert delay_margin_s(shape("complete", 11).normalised(), 2.0, 1.0) == inf


def test_a_chain_stands_any_delay() -> None:
    assert delay_margin_s(shape("chain", 6), 2.0, 1.0) == inf


def test_a_robot_alone_with_its_leader_has_the_radius_of_a_first_order_lag() -> None:
    speeds, places = radii(shape("chain", 1), 2.0, 1.0, 0.5, 2.0)
    assert isclose(speeds, np.exp(-0.5))
    assert isclose(places, np.exp(-1.0))  # μ alone: exp(−p T)


@pytest.mark.parametrize("period_s", [0.02, 0.6, 1.5, 3.0])
def test_rings_converge_however_slowly_they_share(period_s: float) -> None:
    for robots in (2, 3, 4, 6):
        assert max(radii(shape("ring", robots), 2.0, 1.0, period_s, 4.0)) < 1.0


def test_the_moving_leader_is_followed_stands_and_goes_on_in_the_forecast() -> None:
    ahead = forecast(load("moving_leader"))
    at = {t_s: n for n, t_s in enumerate(np.round(ahead.t_s, 6).tolist())}
    v_r = [float(ahead.v_r[at[t_s]]) for t_s in (4.98, 5.0, 22.0, 37.0, 50.0, 59.5, 70.0)]
    assert v_r == pytest.approx([0.4, 0.6, 0.4, 0.1, 0.0, 0.25, 0.5])
    stands = (ahead.t_s >= 54.0) & (ahead.t_s <= 58.0)
    assert ahead.spread[stands].max() < 0.02
    assert np.abs(ahead.s_dot[stands]).max() < 0.01
    assert ahead.s_dot[ahead.t_s >= 76.0] == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize("p", [0.3, 1.0])
def test_the_sampled_growth_tends_to_the_continuous_one_with_the_share_period(p: float) -> None:
    robots = [f"r{k}" for k in range(5)]
    graph = Graph.of(robots, random_ring(robots, max_in_degree=2, seed=3), ["r1"])
    limit = continuous_growth_1_s(graph, p, 1.0)
    off = [sampled_growth_1_s(graph, p, 1.0, t, 2.0) - limit for t in (0.01, 0.005, 0.0025)]
    assert abs(off[0]) < 0.01
    assert off[0] == pytest.approx(2.0 * off[1], rel=0.05)
    assert off[1] == pytest.approx(2.0 * off[2], rel=0.05)


@given(
    degree=st.floats(0.0, 5.0),
    p=st.floats(0.1, 10.0),
    q=st.floats(0.1, 50.0),
    step_s=st.floats(1e-4, 1.0),
)
def test_its_exponential_is_the_controllers(
    degree: float, p: float, q: float, step_s: float
) -> None:
    a = np.zeros((5, 5))
    a[1, :3], a[1, 4], a[2, 1] = (0.5, -p, -q * degree), q, 1.0
    mine, controllers = _exponential(a * step_s), matrix_exponential((a * step_s).tolist())
    assert_allclose(mine, np.array(controllers), rtol=1e-10, atol=1e-12)
