"""`fleetloop campaign` as it is used: matrix, files, exit status, resumption, a cell run again."""

import csv
import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import psutil
import pyarrow.parquet
import pytest
from support.command_line import fleetloop

SHORT = ("--for", "0.1", "--recover-within", "0.2", "--hold", "0.1")
SHORT += ("--set", "duration_s=1.0", "--set", "expect.0.from_s=0.6", "--set", "expect.1.from_s=0.6")
KINDS = "push,localisation_outage,under_voltage"
STRONG = ("--param", "push.force_body_N=400")


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("campaign")
    words = ("--faults", KINDS, "--at", "0.3,0.5", *SHORT, *STRONG, "--out", "out")
    words += ("--junit", "out.xml")
    return fleetloop(folder, "campaign", "two_robots", *words), folder / "out"


def test_the_matrix_has_a_row_per_kind_a_column_per_time_and_its_legend(campaign) -> None:
    done, _ = campaign
    lines = [" ".join(line.split()) for line in done.stdout.splitlines()]
    assert "fault 0.3 s 0.5 s" in lines
    assert "under_voltage - -" in lines
    assert any(line.startswith("H held; R recovered") for line in lines)
    assert any(line.startswith("under_voltage refused: can't act") for line in lines)


def test_files_have_every_cell(campaign) -> None:
    _, out = campaign
    numbers = json.loads((out / "campaign.json").read_text("utf-8"))
    rows = list(csv.DictReader((out / "campaign.csv").read_text("utf-8").splitlines()))
    table = pyarrow.parquet.read_table(out / "campaign.parquet")
    assert len(numbers["cells"]) == len(rows) == table.num_rows == 6
    assert [row["kind"] for row in rows] == table.column("kind").to_pylist()
    assert {row["verdict"] for row in rows if row["kind"] == "under_voltage"} == {"refused"}
    page = (out / "campaign.html").read_text("utf-8")
    assert page.count('class="detail"') == 6
    assert "src=" not in page


def test_ci_gets_a_suite_per_kind_and_a_case_per_cell(campaign) -> None:
    done, out = campaign
    root = ET.parse(out.parent / "out.xml").getroot()
    suites = {suite.get("name"): suite for suite in root}
    assert suites["two_robots: push"].get("tests") == "2"
    assert suites["two_robots: under_voltage"].get("skipped") == "2"
    assert suites["two_robots: without a fault"].get("failures") == "0"
    assert done.returncode == (1 if int(root.get("failures", "0")) else 0)


def test_a_cell_gives_the_same_verdict_by_its_command(campaign, tmp_path: Path) -> None:
    _, out = campaign
    cells = json.loads((out / "campaign.json").read_text("utf-8"))["cells"]
    for kind in ("push", "localisation_outage"):
        cell = next(one for one in cells if one["kind"] == kind)
        words = shlex.split(cell["command"])[1:]
        done = fleetloop(tmp_path, *words, "--no-report", "--out", kind)
        assert (done.returncode == 0) == (cell["verdict"] in ("held", "recovered")), done.stderr


def test_a_campaign_that_was_killed_goes_on_and_computes_no_cell_twice(tmp_path: Path) -> None:
    words = ("--faults", "push,link_delay", "--at", "0.2,0.4,0.6", *SHORT)
    with subprocess.Popen(
        [sys.executable, "-m", "fleetloop", "campaign", "two_robots", *words, "--out", "out"],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=os.environ,
    ) as process:
        file = tmp_path / "out" / "results.jsonl"
        while not file.exists() or len(file.read_bytes().splitlines()) < 3:
            assert process.poll() is None
        children = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(signal.SIGKILL)
    _, alive = psutil.wait_procs(children, timeout=10)
    assert not alive
    before = file.read_bytes()
    before = before[: before.rfind(b"\n") + 1]
    with file.open("ab") as opened:
        opened.write(b'{"cell": {"kind": "pu')
    done = fleetloop(tmp_path, "campaign", "--resume", "out")
    assert done.returncode == 0, done.stderr
    data = file.read_bytes()
    assert data.startswith(before)
    cells = [json.loads(line)["cell"] for line in data.splitlines() if b'"cell"' in line[:8]]
    assert len(cells) == len({(cell["kind"], cell["at_s"]) for cell in cells}) == 6


def test_a_scenario_that_fails_without_a_fault_is_said_and_fails_the_campaign(
    tmp_path: Path,
) -> None:
    never = ("--set", "expect.1.max=-0.04")
    words = ("--faults", "push", "--at", "0.3", *SHORT, *never, "--out", "out")
    done = fleetloop(tmp_path, "campaign", "two_robots", *words, "--allow", "failed")
    assert done.returncode == 1
    assert "WITHOUT A FAULT, seed 1: failed: y_e_m" in done.stdout


@pytest.mark.system
def test_a_fault_of_a_process_is_a_whole_run_over_processes(tmp_path: Path) -> None:
    words = ("--faults", "process_freeze,process_slow", "--at", "0.3", *SHORT)
    done = fleetloop(tmp_path, "campaign", "two_robots", *words, "--out", "out")
    slow = next(line for line in done.stdout.splitlines() if "process_slow" in line)
    assert slow.split() == ["process_slow", "H"], done.stderr
    assert "needs clock.on_late = 'hold' or 'drop'" in done.stdout
    assert "--in-process" not in (tmp_path / "out" / "campaign.csv").read_text("utf-8")
    assert not (tmp_path / "out" / "run").exists()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("two_robots", "--faults", "psuh"), "no such kind"),
        (("two_robots", "--at", "9"), "below its duration_s"),
        (("two_robots", "--robots", "r9"), "no such robot"),
        (("two_robots", "--allow", "fine"), "no such verdict"),
        (("two_robots", "--set", "expect=[]"), "expects nothing"),
        (("--resume", "nowhere"), "no results.jsonl there"),
        ((), "name a scenario"),
    ],
)
def test_what_is_no_campaign_is_refused(tmp_path: Path, words: tuple[str, ...], told: str) -> None:
    done = fleetloop(tmp_path, "campaign", *words)
    assert done.returncode == 2
    assert told in " ".join(done.stderr.replace("│", " ").split())
    assert not (tmp_path / "runs").exists()
