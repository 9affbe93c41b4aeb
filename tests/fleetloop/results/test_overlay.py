"""The page of several runs: a column and a colour each, and what differs in their scenarios."""

from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from configs.errors import ScenarioError
from fleetloop.launch.run import RunOptions, run_scenario
from fleetloop.record.reader import Record
from fleetloop.results.drawing import COLOURS
from fleetloop.results.known import known_of
from fleetloop.results.overlay import labels, write_overlay
from fleetloop.results.overlay_figures import SIGNALS, _signal, overlay_figures
from fleetloop.results.pictures import png
from fleetloop.results.run_folder import read_record


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two short runs: another gain and another end."""
    folder = tmp_path_factory.mktemp("runs")
    changes = {"first": ("until_s=0.4",), "second": ("until_s=0.3", "robot.r2.control.k1=2.5")}
    for name, overrides in changes.items():
        options = RunOptions(
            in_process=True,
            out=folder / name,
            overrides=overrides,
            figures=False,
            as_json=True,
            allow_unchecked=True,
        )
        assert run_scenario("two_robots", options) == 0
    return [folder / name for name in changes]


def records(runs: list[Path]) -> list[Record]:
    return [read_record(run, partial=False) for run in runs]


def test_the_page_has_a_column_per_run_and_says_what_differs(
    runs: list[Path], tmp_path: Path
) -> None:
    text = write_overlay(runs, records(runs), tmp_path / "out").read_text("utf-8")
    page = unescape(text)
    assert page.count("data:image/png;base64,") == 8
    for n, name in enumerate(("first", "second")):
        assert f'style="background:{COLOURS[n]}"></span>{name}</th>' in page
    assert "<tr><td>simulated [s]</td><td>0.4</td><td>0.3</td></tr>" in page
    assert "<tr><td>robot.r2.control.k1</td><td>-</td><td>2.5</td></tr>" in page
    assert "<tr><td>until_s</td><td>0.4</td><td>0.3</td></tr>" in page
    assert "coordination.p" not in page  # it is the same
    assert "x_e_m within ±0.05 from 3 s" in page
    assert page.count("<script") == 1  # of the theme
    assert "http" not in page


def test_every_figure_shows_each_run_in_its_colour(runs: list[Path], tmp_path: Path) -> None:
    write_overlay(runs, records(runs), tmp_path / "out")
    files = list((tmp_path / "out" / "figures").glob("*.png"))
    assert len(files) == 8
    for file in files:
        image = imread(file)[..., :3]
        for colour in COLOURS[:2]:
            wanted = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
            assert (np.abs(image - wanted).max(axis=2) < 0.1).sum() > 20, (file.name, colour)


def test_many_robots_are_a_band_from_the_least_to_the_greatest(runs: list[Path]) -> None:
    record = records(runs)[0]
    many = [f"r{n}" for n in range(1, 7)]
    alike = {robot: record.controller["r1" if n % 2 else "r2"] for n, robot in enumerate(many)}
    fleet = replace(record, robots=tuple(many), controller=alike)
    (axes,) = _signal(SIGNALS[0], {"fleet": fleet}).axes
    low, high = (line.get_ydata() for line in axes.get_lines())
    both = np.stack([record.controller[robot]["x_e_m"] for robot in ("r1", "r2")])
    assert low.min() == both.min()
    assert high.max() == both.max()


def test_names_of_folders_are_drawn_as_they_are(runs: list[Path]) -> None:
    first, second = map(known_of, records(runs))
    hostile = {r"m$\frac$": first, "_hidden": second}
    for one in overlay_figures(hostile):
        png(one.figure)
        (legend,) = one.figure.legends or [axes.get_legend() for axes in one.figure.axes]
        assert [text.get_text() for text in legend.get_texts()] == [r"m\$\frac\$", " _hidden"]


def test_labels_are_names_as_far_as_they_differ() -> None:
    assert labels([Path("a/x"), Path("b/y/record.mcap")]) == ["x", "y"]
    assert labels([Path("a/x"), Path("b/x")]) == ["a/x", "b/x"]
    assert labels([Path("a/x"), Path("a/x")]) == ["a/x (1)", "a/x (2)"]


def test_more_runs_than_colours_are_refused(runs: list[Path], tmp_path: Path) -> None:
    many = [runs[0]] * (len(COLOURS) + 1)
    with pytest.raises(
        ScenarioError, match=f"{len(many)} runs: at most {len(COLOURS)} can be told apart"
    ):
        write_overlay(many, records(many), tmp_path / "out")
