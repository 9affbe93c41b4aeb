"""Figures of any study: drawn without a warning, labelled, nothing over anything else."""

import itertools
import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from support.studies import FEW, MASS, SHORT, P
from support.study_results import Came, Outcome, made_results

from fleetloop.results.palette import STATE_LINES
from fleetloop.results.pictures import png
from fleetloop.sweep.report.command import figures_of
from fleetloop.sweep.report.figures import agreement
from fleetloop.sweep.report.view import Choice, View, view_of

GRID = SHORT + 'design = "grid"\n'
SAMPLES = SHORT + 'design = "random"\ncases = 60\n'
PERIOD = (
    '[[factor]]\nkey = "control.k4"\nrange = { least = 0.2, most = 20.0, steps = 9, log = true }\n'
)
LAW = '[[factor]]\nkey = "control.law"\nvalues = ["adaptive_dsc", "adaptive_dsc_robust"]\n'
K1 = '[[factor]]\nkey = "control.k1"\nlog_uniform = [0.1, 30.0]\n'
GRAPH = "[[factor]]\ngraph = {}\n"
Q = '[[factor]]\nkey = "coordination.q"\nuniform = [0.5, 5.0]\n'
TORQUE = '[keep]\nquantities = ["peak_torque_wheel_N_m"]\n'


def by_p(case) -> Came:
    if case["p"] < 1.0:
        return Came("failed", -math.inf, "r1: diverged", {"peak_torque_wheel_N_m": 1e7})
    return Came("held", 0.1 * case["p"], "", {"peak_torque_wheel_N_m": case["p"]})


def by_mass(case) -> Came:
    return Came("failed", -case["mass_kg"]) if case["mass_kg"] > 3.0 else Came("held", 1e-3)


def of_nothing(_case) -> Came:
    return Came("error", None, "no")


def held(_case) -> Came:
    return Came("held", 0.5)


def wild(case) -> Came:
    return Came("held", math.sinh(20.0 * (case["k1"] - 15.0) / 15.0))


def stable_above_1(case) -> Came:
    growth = 0.1 * (1.0 - case["p"]) + 1e-3
    found = {"growth_1_s": growth, "growth_sampled_1_s": growth, "growth_46_1_s": growth - 2e-3}
    return Came("held", abs(growth), "", found)


STUDIES: dict[str, tuple[str, Outcome]] = {
    "grid": (GRID + P + PERIOD + TORQUE, by_p),
    "texts": (GRID + P + LAW + FEW, by_p),
    "samples": (SAMPLES + MASS + K1 + FEW, by_mass),
    "graphs": ((SAMPLES + P + Q + GRAPH + FEW).replace("two_robots", "paper"), by_p),
    "theory": (
        SAMPLES.replace('"until_s=0.1"', '"until_s=0.1", "robot.r2.s_0=0.1"')
        + P
        + Q
        + "[theory]\n"
        + FEW,
        stable_above_1,
    ),
    "outliers": (SAMPLES + MASS + K1 + FEW, wild),
    "one factor": (GRID + P + FEW, by_p),
    "all alike": (GRID + P + LAW + FEW, held),
    "no result": (GRID + P + LAW + FEW, of_nothing),
}


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> dict[str, View]:
    folder: Path = tmp_path_factory.mktemp("studies")
    return {
        name: view_of(made_results(folder / name, text, outcome), Choice())
        for name, (text, outcome) in STUDIES.items()
    }


NAMES = {
    "grid": ["map", "main_effects", "inequality_46", "parallel_coordinates"],
    "texts": ["map", "main_effects", "inequality_46", "parallel_coordinates"],
    "samples": ["map", "main_effects", "parallel_coordinates"],
    "graphs": ["map", "main_effects", "inequality_46", "parallel_coordinates"],
    "theory": ["map", "main_effects", "inequality_46", "growth", "parallel_coordinates"],
    "outliers": ["map", "main_effects", "parallel_coordinates"],
    "one factor": ["main_effects", "inequality_46", "parallel_coordinates"],
    "all alike": ["map", "main_effects", "inequality_46", "parallel_coordinates"],
    "no result": ["parallel_coordinates"],
}


@pytest.mark.parametrize("name", STUDIES)
def test_any_study_is_drawn_as_far_as_there_is_something(views, name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figures = figures_of(views[name])
        assert all(png(one.figure)[:4] == b"\x89PNG" for one in figures)
    assert [one.name for one in figures if one.name != "map_with_theory"] == NAMES[name]


def panels(view: View, name: str) -> list[Axes]:
    (one,) = [figure for figure in figures_of(view) if figure.name == name]
    FigureCanvasAgg(one.figure).draw()
    return one.figure.axes


@pytest.mark.parametrize("name", STUDIES)
def test_no_label_of_an_axis_lies_over_another(views, name: str) -> None:
    for figure in figures_of(views[name]):
        FigureCanvasAgg(figure.figure).draw()
        for axes in figure.figure.axes:
            for axis in (axes.xaxis, axes.yaxis):
                low, high = sorted(axis.get_view_interval())
                labels = [
                    tick.label1
                    for tick in axis.get_major_ticks()
                    if tick.label1.get_text()
                    and tick.label1.get_visible()
                    and low <= tick.get_loc() <= high
                ]
                boxes = [label.get_window_extent() for label in labels]
                for one, other in itertools.pairwise(boxes):
                    assert not one.shrunk(0.9, 0.9).overlaps(other), (figure.name, labels)


def test_axes_are_labelled_with_units(views) -> None:
    axes, bar = panels(views["samples"], "map")
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("mass [kg]", "k1")
    assert bar.get_ylabel() == "failure rate"
    assert axes.get_yscale() == "log"


def test_a_map_shows_where_no_case_is(views) -> None:
    axes, _ = panels(views["samples"], "map")
    assert views["samples"].heat is not None
    assert views["samples"].heat.empty > 0
    assert any(found.get_hatch() for found in axes.collections)
    (one,) = [figure for figure in figures_of(views["samples"]) if figure.name == "map"]
    assert f"hatched: {views['samples'].heat.empty} of" in one.caption
    whole, _ = panels(views["grid"], "map")
    assert not any(found.get_hatch() for found in whole.collections)


def test_a_small_grid_has_its_values_in_its_cells(views) -> None:
    axes, _ = panels(views["grid"], "map")
    texts = [text.get_text() for text in axes.texts]
    assert sorted(set(texts)) == ["0", "100"]
    assert len(texts) == 27


def test_a_boundary_is_named_in_the_legend(views) -> None:
    (one,) = [figure for figure in figures_of(views["graphs"]) if figure.name == "map"]
    assert "(46)" in one.caption
    legends = [text.get_text() for legend in one.figure.legends for text in legend.get_texts()]
    assert legends in (["(46)"], [])  # none: it holds or fails all over the map


def test_main_effects_have_the_means_and_intervals_that_were_computed(views) -> None:
    effect = views["samples"].effects[0]
    axes = panels(views["samples"], "main_effects")[0]
    assert axes.get_title() == f"ε² {effect.share:.2f}"
    points = axes.lines[0].get_xydata()
    assert np.asarray(points).tolist() == [[one.at, one.mean] for one in effect.bins]


def test_in_parallel_coordinates_a_case_that_stopped_is_there_too(views) -> None:
    (axes,) = panels(views["grid"], "parallel_coordinates")
    by_colour = {to_hex(lines.get_color()[0]): lines for lines in axes.collections}
    failed, held_ones = (by_colour[STATE_LINES[state]] for state in ("failed", "held"))
    assert len(failed.get_segments()) == 9
    assert len(held_ones.get_segments()) == 18
    assert all(segment[-1][1] < 0.0 for segment in failed.get_segments())
    assert "no value" in [text.get_text() for text in axes.texts]


def test_of_a_study_against_theory_the_share_of_unstable_cases_is_mapped(views) -> None:
    view = views["theory"]
    assert view.result.name == "unstable_rate"
    (one,) = [figure for figure in figures_of(view) if figure.name == "map"]
    assert one.caption.startswith("Share of unstable cases over p and q;")
    grows = view.results.rates[0].values
    assert set(grows[view.results.factors[0].values == 0.5]) == {1.0}
    assert set(grows[view.results.factors[0].values == 2.0]) == {0.0}


def test_what_contradicts_theory_is_told(views) -> None:
    view = views["theory"]
    at_1 = int((view.results.factors[0].values == 1.0).sum())
    assert [one.disagree for one in view.against] == [0, at_1]
    captions = {one.name: one.caption for one in figures_of(view)}
    assert f"{at_1} disagree, of at most 0.001 1/s" in captions["inequality_46"]
    assert "The least growth of any case is 0.001 1/s" in captions["growth"]


def test_verdicts_and_46_are_counted_against_each_other(views) -> None:
    results = views["graphs"].results
    stable = results.derived[0].values > results.derived[1].values
    failed = results.failed == 1.0
    assert agreement(results) == (
        f"it holds in {stable.sum()}, of which {(stable & failed).sum()} failed;"
        f" it doesn't in {(~stable).sum()}, of which {(~stable & ~failed).sum()} held"
    )
