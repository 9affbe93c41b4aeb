"""What a run leaves: summary, report, figures, and comparison of two runs."""

import json
import re
import shutil
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from configs.errors import ScenarioError
from configs.loading import load
from fleetloop.launch.run import RunOptions, run_scenario
from fleetloop.record.reader import Record
from fleetloop.results.diff import compare, print_comparison
from fleetloop.results.divergence import Tolerance
from fleetloop.results.report import write_report


def test_the_summary_holds_what_is_promised(finished_run: Path) -> None:
    summary = json.loads((finished_run / "summary.json").read_text())
    assert summary["verdict"] == "held"
    assert summary["ticks"] == 2000
    assert summary["wall_s"] > 0
    assert summary["real_time_factor"] == pytest.approx(4.0 / summary["wall_s"], rel=0.01)
    assert set(summary["robots"]) == {"r1", "r2"}
    for robot in summary["robots"].values():
        assert (
            set(robot["settle_s"])
            == set(robot["final_max"])
            == {
                "x_e_m",
                "y_e_m",
                "theta_e_rad",
            }
        )
        assert robot["peak_torque_wheel_N_m"] > 0
    assert set(summary["s_spread"]) == {"peak", "settle_s", "final", "final_from_s"}
    # The last five seconds of a run of four are all of them.
    assert summary["s_spread"]["final_from_s"] == 0.0
    assert summary["overruns"] == 0
    # Two encoder and two torque frames per tick from tick 0 on, heartbeats, and the arming.
    assert 8000 < summary["frames_per_bus"]["r1"] < 9000
    assert summary["seed"] == 1
    assert "eclipse-zenoh" in summary["versions"]


def test_the_scenario_in_the_folder_repeats_the_run(finished_run: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    scenario = str(finished_run / "scenario.toml")
    assert load(scenario) == load("two_robots")
    run_scenario(scenario, RunOptions(in_process=True, out=again, figures=False, as_json=True))
    assert (again / "record.mcap").read_bytes() == (finished_run / "record.mcap").read_bytes()


def test_every_figure_is_there_for_papers_in_column_width(finished_run: Path) -> None:
    folder = finished_run / "figures"
    names = {path.stem for path in folder.iterdir()} - {"captions"}
    assert {"graph", "positions", "x_e", "y_e", "theta_e", "parameter_errors"} <= names
    assert {"path_variables", "speed_estimates", "torques"} <= names
    captions = (folder / "captions.md").read_text("utf-8")
    for name in names:
        image = imread(folder / f"{name}.png")
        width_mm = image.shape[1] / 300 * 25.4
        assert min(abs(width_mm - 88), abs(width_mm - 180)) < 1, name
        assert image[..., :3].std() > 0.02
        svg = (folder / f"{name}.svg").read_text("utf-8")
        assert "<text" in svg  # not outlines
        pdf = (folder / f"{name}.pdf").read_bytes()
        assert pdf.startswith(b"%PDF")
        assert b"/FontFile2" in pdf  # TrueType, embedded
        assert f"`{name}`: " in captions
    assert captions.count("scenario two_robots") == len(names)
    assert "the paper's Figure" not in captions


def test_the_page_stands_alone_and_says_the_verdict(finished_run: Path) -> None:
    page = (finished_run / "report.html").read_text()
    assert len(re.findall(r'<img [^>]*src="data:image/png;base64,', page)) == 10
    assert 'class="verdict held"' in page
    fetched = re.findall(r"<(?:script|link|img|iframe)[^>]*(?:src|href)=[\"'](?!data:)", page)
    assert fetched == []
    assert "@import" not in page
    assert "url(http" not in page
    assert len(page) < 5_000_000


def test_page_summary_and_terminal_say_the_same_of_what_went_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = RunOptions(
        in_process=True, out=tmp_path / "a", overrides=("robot.r1.v_m_s=1e6",), force=True
    )
    assert run_scenario("two_robots", options) == 1
    printed, noted = capsys.readouterr()
    summary = json.loads((tmp_path / "a" / "summary.json").read_text())
    page = unescape((tmp_path / "a" / "report.html").read_text())
    reason = summary["stopped_robots"]["r1"]
    assert reason.startswith("tick 0 (t = 0.000 s): its motion diverged")
    assert f"STOPPED r1: {reason}" in printed
    assert f"<li>STOPPED r1: {reason}</li>" in page
    told = reason.replace("): ", "): diverged: ", 1)
    assert f"r1: {told}" in noted.splitlines()
    for notice in summary["notices"].get("r1", []):
        if notice == told:
            continue  # its reason is there
        assert f"r1: {notice}" in printed
        assert f"r1: {notice}" in page
    assert '<td class="text">0 s</td><td class="text">r1: diverged: its motion' in page
    # Results come before the figures are made.
    assert printed.index("verdict  failed") < printed.index("report ")


def test_the_page_can_be_made_again_without_a_summary(finished_run: Path, tmp_path: Path) -> None:
    shutil.copy(finished_run / "record.mcap", tmp_path)
    page = write_report(tmp_path).read_text()
    assert "the run left no summary.json" in page


def test_a_run_is_identical_to_itself(finished_run: Path, capsys) -> None:
    assert print_comparison(finished_run, finished_run, as_json=False) == 0
    assert capsys.readouterr().out.startswith("identical: 2000 ticks of 2 robots")


def test_the_first_difference_is_named_by_tick_robot_and_field(
    finished_run: Path, tmp_path: Path, capsys
) -> None:
    other = tmp_path / "other"
    changed = ("robot.r2.pose.x_m=1.951",)
    options = RunOptions(in_process=True, overrides=changed, out=other, figures=False, as_json=True)
    run_scenario("two_robots", options)
    capsys.readouterr()
    assert print_comparison(finished_run, other, as_json=False) == 1
    out = capsys.readouterr().out
    assert "tick 0, robot r2, plant x_m: 1.95 in A, 1.951 in B" in out


def test_a_single_bit_is_a_difference_and_so_is_the_sign_of_zero(finished_run: Path) -> None:
    a = Record.open(finished_run / "record.mcap")
    b = Record.open(finished_run / "record.mcap")
    rows = b.controller["r1"]
    rows["s"][0] = -0.0
    found = compare(a, b).first
    assert (found.tick, found.robot, found.field) == (0, "r1", "s")
    rows["s"][0] = 0.0
    rows["mu"][1999] = np.nextafter(rows["mu"][1999], 1.0)
    found = compare(a, b).first
    assert (found.tick, found.robot, found.field) == (1999, "r1", "mu")


def test_a_shorter_run_differs_where_it_ends(finished_run: Path) -> None:
    a = Record.open(finished_run / "record.mcap")
    b = Record.open(finished_run / "record.mcap")
    b.plant["r1"] = b.plant["r1"][:100]
    found = compare(a, b).first
    assert (found.tick, found.field) == (100, "number of ticks")


def test_runs_of_other_robots_signals_and_ends_are_told_apart(
    finished_run: Path, tmp_path: Path, capsys
) -> None:
    other = tmp_path / "other"
    changed = ("until_s=1.0", "control.law='adaptive_dsc_robust'", "robot.r2.name='r9'")
    edges = ("graph.edges=['r1 -> r9']",)
    options = RunOptions(
        in_process=True, overrides=(*changed, *edges), out=other, figures=False, as_json=True
    )
    run_scenario("two_robots", options)
    capsys.readouterr()
    assert print_comparison(finished_run, other, as_json=False) == 1
    out = capsys.readouterr().out
    assert "robot (all), record robots: 'r2' in A, 'r9' in B" in out
    assert "also unlike: tick 500, robot r1, plant number of ticks: 2000 in A, 500 in B" in out
    assert print_comparison(finished_run, other, as_json=True) == 1
    said = json.loads(capsys.readouterr().out)
    assert {one["robot"] for one in said["unlike"]} == {"(all)", "r1"}
    assert said["signals"][0]["first"]["robot"] == "r1"


def test_within_a_tolerance_runs_are_alike_and_an_unknown_signal_is_refused(
    finished_run: Path, tmp_path: Path, capsys
) -> None:
    other = tmp_path / "other"
    options = RunOptions(
        in_process=True,
        overrides=("robot.r2.control.k1=2.001",),
        out=other,
        figures=False,
        as_json=True,
    )
    run_scenario("two_robots", options)
    capsys.readouterr()
    assert print_comparison(finished_run, other, as_json=False, size_first=True) == 1
    assert "signals by the size of their difference" in capsys.readouterr().out
    close = Tolerance.parse(["0.01"])
    assert print_comparison(finished_run, other, as_json=False, tolerance=close) == 0
    assert "within the tolerance: 2000 ticks of 2 robots" in capsys.readouterr().out
    unknown = Tolerance.parse(["no_such=1"])
    with pytest.raises(
        ScenarioError, match=r"--tolerance no_such=1: no such signal; there are .*s"
    ):
        print_comparison(finished_run, other, as_json=False, tolerance=unknown)
