"""The theory's boundaries against eigenvalues that are computed here, and closed forms."""

from pathlib import Path

import numpy as np
import pytest
from support.study_results import Came, made_results

from configs.loading import load
from fleetloop.check.body import inertias
from fleetloop.sweep.report.boundary import Boundary, boundaries, contour
from fleetloop.sweep.report.results import Results

HEAD = 'schema = 1\ntitle = "map"\nbase = "paper"\n[keep]\nquantities = []\n'
GRID, SAMPLES = 'design = "grid"\n', 'design = "random"\ncases = 12\n'
RING = 'set = ["graph={generator=\\"ring\\"}"]\n'
P = '[[factor]]\nkey = "coordination.p"\nrange = { least = 0.1, most = 4.0, steps = 5 }\n'
Q = '[[factor]]\nkey = "coordination.q"\nrange = { least = 0.2, most = 5.0, steps = 5 }\n'
K4 = '[[factor]]\nkey = "control.k4"\nrange = { least = 1.0, most = 20.0, steps = 4 }\n'
PERIOD = '[[factor]]\nkey = "clock.control_period_s"\nvalues = [0.001, 0.002, 0.005]\n'
RANDOM = "[[factor]]\ngraph = { max_in_degree = 3 }\n"


def results(folder: Path, text: str) -> Results:
    return made_results(folder, text, lambda _: Came())


def lines(found: list[Boundary], name: str) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    (one,) = [boundary for boundary in found if boundary.criterion.name.startswith(name)]
    return one.lines


def largest_growth(laplacian: np.ndarray, p: float, q: float) -> float:
    """Largest real part of (45)'s eigenvalues, without the one at 0 of all s together."""
    n = len(laplacian)
    system = np.block([[-p * np.eye(n), -q * laplacian], [np.eye(n), np.zeros((n, n))]])
    values = np.linalg.eigvals(system)
    return float(np.delete(values, np.abs(values).argmin()).real.max())


@pytest.mark.parametrize("order", ["pq", "qp"])
def test_on_the_gains_it_is_where_the_coordination_loses_its_stability(tmp_path, order) -> None:
    found = results(tmp_path, GRID + RING + HEAD + P + Q)
    p, q = found.factors
    axes = (p, q) if order == "pq" else (q, p)
    (line,) = lines(boundaries(found, *axes), "(46)")
    laplacian = load("paper", ['graph={generator="ring"}']).topology.laplacian()
    along_p, along_q = line if order == "pq" else line[::-1]
    assert len(along_p) > 20
    for at_p, at_q in zip(along_p, along_q, strict=True):
        assert largest_growth(laplacian, 1.01 * at_p, at_q) < 0.0
        assert largest_growth(laplacian, 0.99 * at_p, at_q) > 0.0


def test_over_random_graphs_the_outermost_lines_are_those_of_the_extreme_graphs(tmp_path) -> None:
    found = results(
        tmp_path, SAMPLES.replace("12", "40") + HEAD + P.replace("0.1", "0.01") + Q + RANDOM
    )
    p, q, _ = found.factors
    sides = found.derived[1].values
    assert sides.max() > sides.min() == 0.0
    of_all = [b for b in boundaries(found, q, p) if b.criterion.name == "(46)"]
    (boundary,) = of_all
    along, most = boundary.lines[-1]
    assert most == pytest.approx(np.sqrt(along * sides.max()))
    assert "lines of the extremes of the other factors" in boundary.words


def test_a_graph_for_which_all_gains_do_is_said(tmp_path) -> None:
    found = results(tmp_path, GRID + HEAD + P + Q)
    (boundary,) = [b for b in boundaries(found, *found.factors) if b.criterion.name == "(46)"]
    assert boundary.lines == ()
    assert boundary.words.endswith("holds all over the map")


@pytest.mark.parametrize("k4_first", [True, False])
def test_the_speed_loop_has_its_closed_form_without_delay(tmp_path, k4_first: bool) -> None:
    found = results(tmp_path, GRID + HEAD + K4 + PERIOD)
    k4, period = found.factors
    found_on = boundaries(found, *((k4, period) if k4_first else (period, k4)))
    (line,) = lines(found_on, "speed loop")
    at_k4, at_period = line if k4_first else line[::-1]
    scenario = load("paper")
    inertia = min(min(inertias(scenario.body_of(robot))) for robot in scenario.robot)
    assert set(period.values) <= set(at_period)
    assert at_k4 == pytest.approx(2.0 * inertia / at_period, rel=1e-5)


def test_a_torque_that_comes_late_moves_it_as_the_roots_say(tmp_path) -> None:
    late = (
        'set = ["drive.preset=\\"realistic\\"", "motor.compute_delay_s=0.0",'
        ' "motor.current_loop_s=0.003", "encoder.pll_bandwidth_rad_s=1000.0"]\n'
    )
    text = GRID + late + HEAD + K4.replace("least = 1.0", "least = 0.5") + PERIOD
    found = results(tmp_path, text.replace("[0.001, 0.002, 0.005]", "[0.001, 0.005]"))
    (line,) = lines(boundaries(found, *found.factors), "speed loop")
    inertia = min(inertias(load("paper").body_of(load("paper").robot[0])))
    at_k4 = dict(zip(*line[::-1], strict=True))[0.005]
    for part, stable in ((0.99, True), (1.01, False)):  # a period late: z² − z + K = 0
        roots = np.roots([1.0, -1.0, part * at_k4 * 0.005 / inertia])
        assert (np.abs(roots).max() < 1.0) == stable


def test_the_delay_that_the_network_may_have_is_that_of_the_theory(tmp_path) -> None:
    """T* of the ring of four, p = 2, q = 1 is 0.69 s, of data that is old at both ends."""
    text = GRID + RING.replace(
        "]\n",
        ', "coordination.compensation=\\"both\\"", "coordination.p=2.0", "coordination.q=1.0",'
        ' "network.default.delay={kind=\\"constant\\", delay_s=0.1}"]\n',
    )
    delay = "[[factor]]\nkey = 'network.default.delay.delay_s'\n"
    delay += "range = { least = 0.0, most = 1.0, steps = 3 }\n"
    found = results(tmp_path, text + HEAD + P + delay)
    (line,) = lines(boundaries(found, *found.factors), "delay margin")
    at_delay = float(np.interp(2.0, *line))
    half_a_share_s = 0.5 * load("paper").clock.share_period_s
    assert at_delay + half_a_share_s == pytest.approx(0.69, abs=0.01)


def test_axes_that_a_criterion_has_nothing_to_do_with_show_none(tmp_path) -> None:
    text = '[[factor]]\nkey = "control.k1"\nvalues = [1.0, 2.0]\n'
    text += '[[factor]]\nkey = "control.k2"\nvalues = [1.0, 2.0]\n'
    found = results(tmp_path, GRID + HEAD + text)
    assert boundaries(found, *found.factors) == []


def test_on_its_own_two_sides_it_is_the_diagonal(tmp_path) -> None:
    found = results(tmp_path, SAMPLES.replace("12", "40") + HEAD + P + Q + RANDOM)
    left, right = found.derived
    (line,) = lines(boundaries(found, right, left), "(46)")
    assert (line[0] == line[1]).all()


def test_both_sides_are_those_of_each_cases_graph_and_gains(tmp_path) -> None:
    found = results(tmp_path, SAMPLES + HEAD + P + Q + RANDOM)
    left, right = found.derived
    assert found.cases is not None
    for n in range(12):
        scenario = found.cases.scenario(found.cases.case(n))
        gains = scenario.coordination
        values = np.linalg.eigvals(scenario.topology.laplacian())
        values = values[np.abs(values) > 1e-9]
        assert left.values[n] == pytest.approx(gains.p**2 / gains.q)
        assert right.values[n] == pytest.approx((values.imag**2 / values.real).max(), abs=1e-9)


def test_both_sides_follow_a_generator_that_is_varied(tmp_path) -> None:
    text = '[[factor]]\nkey = "graph.generator"\nvalues = ["chain", "ring"]\n'
    found = results(tmp_path, GRID + 'set = ["graph={generator=\\"star\\"}"]\n' + HEAD + text)
    assert found.derived[1].values == pytest.approx([0.0, 1.0])


def test_a_contour_is_where_margins_change_their_sign() -> None:
    x, y = np.linspace(0.5, 3.0, 40), np.linspace(0.5, 3.0, 50)
    margins = np.log(np.outer(y, x))
    margins[:5, :5] = np.nan  # invalid scenarios
    margins[margins > 1.5] = np.inf
    (line,) = contour(x, y, margins)
    assert line[0] * line[1] == pytest.approx(np.ones(len(line[0])), abs=0.01)
