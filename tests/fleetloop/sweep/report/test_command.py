"""`fleetloop sweep report` as it is used: files, tables, JSON, exit status."""

import json
import shlex

import pytest
from support.command_line import fleetloop
from support.studies import FEW, MASS, SHORT, P, opened, study_folder
from support.study_results import Came, made_study

GRID = SHORT + 'design = "grid"\n' + P + FEW
SAMPLES = SHORT + 'design = "random"\ncases = 40\n' + P + MASS + FEW


def some(case) -> Came:
    return Came("failed", -0.2, "no") if case["mass_kg"] > 3.0 else Came("held", 0.1)


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("reports")
    made_study(folder / "study", SAMPLES, some)
    return fleetloop(folder, "sweep", "report", "study"), folder


def test_page_and_figures_are_there(done) -> None:
    result, folder = done
    assert result.returncode == 0
    assert (folder / "study" / "report.html").is_file()
    names = {path.name for path in (folder / "study" / "figures").iterdir()}
    for name in ("map", "main_effects", "parallel_coordinates"):
        assert {f"{name}.png", f"{name}.svg", f"{name}.pdf"} <= names
    assert "captions.md" in names
    assert "report   study/report.html" in result.stdout


def test_the_terminal_has_rate_effects_and_the_worst_with_its_command(done) -> None:
    lines = [" ".join(line.split()) for line in done[0].stdout.splitlines()]
    assert lines[0].startswith("short: 40 of 40 cases: ")
    assert any(line.startswith("failed ") and "Wilson's 95 % interval" in line for line in lines)
    assert "engine 40 kernel" in lines
    assert any(line.startswith("mass [kg] ") for line in lines)
    assert any(line.startswith("again fleetloop run two_robots --in-process") for line in lines)


def test_json_has_the_numbers_of_the_page(done) -> None:
    _, folder = done
    words = ("--x", "mass_kg", "--y", "p", "--color", "margin", "--worst", "2", "--json")
    result = fleetloop(folder, "sweep", "report", "study", *words)
    numbers = json.loads(result.stdout)
    assert numbers["map"] == {"x": "mass_kg", "y": "p"}
    assert numbers["result"] == "margin"
    assert numbers["counts"]["failed"] == numbers["failed"]
    low, high = numbers["failure_rate_interval"]
    assert low < numbers["failure_rate"] < high
    assert [one["verdict"] for one in numbers["worst"]] == ["failed", "failed"]
    assert numbers["interval"] == {"method": "Wilson", "confidence": 0.95}
    assert numbers["page"] == "study/report.html"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("nowhere",), "nowhere: no such folder; name the folder of a study"),
        (
            ("study", "--x", "mas_kg"),
            "--x mas_kg: no such column; did you mean mass_kg?; there are",
        ),
        (("study", "--y", "verdict"), "--y verdict: no such column"),
        (("study", "--color", "mass_kg"), "--color mass_kg: no such result"),
        (("study", "--x", "p", "--y", "p"), "--x p --y p: a map needs two different columns"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(done, words: tuple[str, ...], told: str) -> None:
    result = fleetloop(done[1], "sweep", "report", *words)
    assert result.returncode == 2
    assert result.stderr.startswith(f"fleetloop: {told}")
    assert len(result.stderr.splitlines()) == 1


def test_a_folder_without_rows_is_refused(tmp_path) -> None:
    made_study(tmp_path / "study", SAMPLES, some, [0])
    (part,) = (tmp_path / "study" / "parts").iterdir()
    part.unlink()
    result = fleetloop(tmp_path, "sweep", "report", "study")
    assert result.returncode == 2
    assert "none of its cases is done" in result.stderr


def test_a_study_that_is_running_is_reported_as_far_as_it_is(tmp_path) -> None:
    made_study(tmp_path / "study", SAMPLES, some, range(12))
    dataset = opened(tmp_path / "study")
    try:
        result = fleetloop(tmp_path, "sweep", "report", "study")
    finally:
        dataset.close()
    assert result.returncode == 0
    assert "the study is still running: 12 of 40 cases are in this report" in result.stderr
    page = (tmp_path / "study" / "report.html").read_text("utf-8")
    assert "the study is still running" in page


def test_a_damaged_part_is_named_and_the_report_made(tmp_path) -> None:
    made_study(tmp_path / "study", SAMPLES, some, range(20))
    made_study(tmp_path / "study", SAMPLES, some, range(20, 40))
    first, _ = sorted((tmp_path / "study" / "parts").iterdir())
    first.write_bytes(b"PAR1" + first.read_bytes()[4:200])
    result = fleetloop(tmp_path, "sweep", "report", "study")
    assert result.returncode == 0
    assert f"damaged, not used: study/parts/{first.name}" in result.stderr


def test_a_page_that_cannot_be_written_is_named(tmp_path) -> None:
    made_study(tmp_path / "study", SAMPLES, some)
    (tmp_path / "study" / "figures").write_text("in the way", "utf-8")
    result = fleetloop(tmp_path, "sweep", "report", "study")
    assert result.returncode == 3
    assert "can't make study/figures" in result.stderr


def test_the_command_of_a_worst_case_runs_it_again_with_its_verdict(tmp_path) -> None:
    text = GRID.replace('"expect.0.max_abs=0.2"', '"expect.0.max_abs=0.001"')
    study_folder(tmp_path / "study", text)
    result = fleetloop(tmp_path, "sweep", "report", "study", "--json")
    first = json.loads(result.stdout)["worst"][0]
    assert first["verdict"] == "failed"
    words = shlex.split(first["command"])[1:]
    again = fleetloop(tmp_path, *words, "--no-report", "--json", "--out", "again")
    summary = json.loads(again.stdout)
    assert again.returncode == 1
    assert summary["verdict"] == "failed"
    margins = [one["margin"] for one in summary["expectations"]]
    assert min(margins) == first["margin"]
