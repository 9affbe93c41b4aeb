"""Parts of figures."""

import numpy as np
import pytest

from configs.graph import Graph, generated
from configs.loading import load
from fleetloop.results.drawing import axes_of, legend_above, torque_scale, widen
from fleetloop.results.figures import is_papers
from fleetloop.results.graph_drawing import CLEAR, drawn, laid_out
from fleetloop.results.panel import FLOORS, span


@pytest.mark.filterwarnings("error")
def test_a_panel_without_lines_has_no_legend_and_draws_no_complaint() -> None:
    figure, axes = axes_of()
    legend_above(figure, axes, 0)
    assert figure.legends == []
    axes.plot([0.0, 1.0], label="r1")
    legend_above(figure, axes, 1)
    assert len(figure.legends) == 1


def test_noise_is_not_drawn_at_full_height() -> None:
    noise = np.random.default_rng(1).normal(0.0, 1e-6, 1000)
    low, high = span([noise], "m")
    assert high - low >= FLOORS["m"]
    assert low < noise.min() < noise.max() < high


def test_an_axis_is_widened_about_its_middle_to_the_floor_of_its_unit() -> None:
    _, axes = axes_of()
    axes.plot([0.0, 1.0], [1.0, 1.0 + 1e-7])
    widen(axes, "m")
    low, high = axes.get_ylim()
    assert high - low == pytest.approx(FLOORS["m"])
    assert 0.5 * (low + high) == pytest.approx(1.0)


def test_torques_are_logarithmic_only_where_they_get_far() -> None:
    for peak_N_m, scale in ((3.0, "linear"), (500.0, "symlog")):
        _, axes = axes_of()
        axes.plot([0.0, 1.0], [0.0, peak_N_m])
        torque_scale(axes)
        assert axes.get_yscale() == scale


def test_a_rare_spike_does_not_squeeze_the_rest_and_a_transient_is_all_seen() -> None:
    values = np.sin(np.linspace(0.0, 20.0, 10_000))
    values[17] = 700.0
    assert span([values], "N·m").high < 3.0
    transient = 4.5 * np.exp(-np.linspace(0.0, 20.0, 10_000))
    assert span([transient], "m").high > 4.5


@pytest.mark.parametrize(
    "name",
    ["paper", "paper_ring", "paper_tree", "paper_star", "paper_extra", "twelve", "switching"],
)
def test_no_edge_of_a_shipped_graph_runs_behind_a_node(name: str) -> None:
    graph = load(name).topology
    _, bows = laid_out(graph.digraph(), graph)
    assert min(bow.clearance for bow in bows.values()) >= 0.0


@pytest.mark.parametrize("count", [3, 6, 9, 12])
def test_no_edge_of_a_complete_graph_runs_behind_a_node(count: int) -> None:
    robots = tuple(f"r{n}" for n in range(1, count + 1))
    graph = Graph.of(robots, generated("complete", robots), ("r1",))
    _, bows = laid_out(graph.digraph(), graph)
    assert min(bow.clearance for bow in bows.values()) >= CLEAR
    assert drawn(graph, "").get_figwidth() * 25.4 + 0.1 >= 88


def test_only_the_papers_experiment_has_the_papers_figure_numbers() -> None:
    assert is_papers(load("paper"))
    assert is_papers(load("paper", ("until_s=10.0",)))
    assert not is_papers(load("paper", ("coordination.p=3.0",)))
    assert not is_papers(load("paper_ring"))
