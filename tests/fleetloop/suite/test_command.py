"""`fleetloop test` and the pytest plug-in on real scenarios, in process and as short as they go."""

import json
import os
import signal
import subprocess
import sys
from importlib import resources
from pathlib import Path

import psutil
import pytest
from support.junit import valid
from support.processes import await_from

from bridge.process.lifecycle import Stop
from fleetloop.suite.cases import Bounds, case_of, run_cases
from fleetloop.suite.command import SuiteOptions, run_tests

pytestmark = pytest.mark.system


def scenario(path: Path, *changes: tuple[str, str]) -> Path:
    text = resources.files("configs").joinpath("two_robots.toml").read_text("utf-8")
    text = text.partition("[[expect]]")[0]
    text = text.replace("duration_s = 4.0", "duration_s = 0.2")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text + "[[expect]]\nsignal = 'v_m_s'\nmax = 1e3\n")
    return path


def fails(path: Path) -> Path:
    with scenario(path).open("a") as file:
        file.write("[[expect]]\nname = 'slow'\nsignal = 'v_m_s'\nmax = -5.0\n")
    return path


def test_a_folder_is_run_side_by_side_and_every_verdict_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bench = tmp_path / "bench"
    bench.mkdir()
    good, bad = scenario(bench / "good.toml"), fails(bench / "bad.toml")
    (bench / "broken.toml").write_text("schema = ")
    options = SuiteOptions(out=tmp_path / "runs", junit=tmp_path / "out.xml")
    assert run_tests([str(bench)], options) == 1
    out = capsys.readouterr().out
    assert "1 failed, 1 error, 1 held in " in out.splitlines()[-1]
    assert "FAILED       slow: v_m_s within -5 or less from 0 s: found " in out
    assert f"again   fleetloop run {bad} --in-process" in out
    assert [path.name for path in (tmp_path / "runs").iterdir()] == ["bad"]
    suites = valid((tmp_path / "out.xml").read_bytes())
    assert {it.attrib["name"] for it in suites} == {str(good), str(bad), str(bench / "broken.toml")}
    assert (suites.attrib["failures"], suites.attrib["errors"]) == ("1", "1")


def test_a_module_that_never_ends_its_import_is_an_error_and_the_others_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "endless.py").write_text("while True:\n    pass\n")
    law = ("[control]", '[control]\nlaw = "endless:Law"')
    scenario(tmp_path / "a_loop.toml", law)
    scenario(tmp_path / "b_sound.toml")
    assert run_tests([str(tmp_path)], SuiteOptions(out=tmp_path / "runs", timeout_s=10.0)) == 1
    out = capsys.readouterr().out
    assert "1 error, 1 held in " in out.splitlines()[-1]
    assert "not done within 10 s" in out


def test_without_scenarios_there_is_nothing_to_test(tmp_path: Path) -> None:
    assert run_tests([str(tmp_path)], SuiteOptions()) == 5
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_takes_too_long_is_ended_and_what_waits_when_all_is_over_is_not_begun(
    tmp_path: Path,
) -> None:
    long = scenario(tmp_path / "a.toml", ("duration_s = 0.2", "duration_s = 1e5"))
    other = scenario(tmp_path / "b.toml")
    cases = [
        case_of(str(p), tmp_path / p.stem, (), processes=False, within_s=60.0)
        for p in (long, other)
    ]
    (late,) = run_cases(cases[:1], (), Bounds(1.0, 600.0, 1), Stop()).values()
    assert (late["verdict"], late["exit_status"]) == ("aborted", 3)
    assert late["reason"] == "took longer than --timeout 1 s"
    ended, waiting = run_cases(cases, (), Bounds(600.0, 1.0, 1), Stop()).values()
    assert ended["reason"] == "--total 1 s was over"
    assert waiting["reason"] == "not run: --total 1 s was over"
    assert not psutil.Process().children(recursive=True)


def test_a_run_ends_with_the_test_that_began_it_even_if_that_is_killed(tmp_path: Path) -> None:
    long = scenario(tmp_path / "a.toml", ("duration_s = 0.2", "duration_s = 1e5"))
    command = [sys.executable, "-P", "-m", "fleetloop", "test", str(long)]
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        await_from(process, lambda: list(tmp_path.glob("runs/*/a/record.mcap")), 60.0)
        children = psutil.Process(process.pid).children(recursive=True)
        assert children
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    _, alive = psutil.wait_procs(children, timeout=60.0)
    assert alive == []


def test_pytest_collects_scenarios_and_shows_what_failed_without_a_traceback(
    tmp_path: Path,
) -> None:
    scenario(tmp_path / "good.fleetloop.toml")
    fails(tmp_path / "bad.fleetloop.toml")
    scenario(tmp_path / "plain.toml")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--rootdir", ".", "-q", "."],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 1, done.stdout + done.stderr
    assert "1 failed, 1 passed" in done.stdout
    assert "FAILED       slow: v_m_s within -5 or less from 0 s: found " in done.stdout
    assert "again   fleetloop run " in done.stdout
    assert "Traceback" not in done.stdout
    assert "runtest" not in done.stdout


def test_all_outcomes_are_one_json_document(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "broken.toml").write_text("schema = ")
    options = SuiteOptions(as_json=True, out=tmp_path / "runs")
    assert run_tests([str(tmp_path / "broken.toml")], options) == 1
    said = json.loads(capsys.readouterr().out)
    (outcome,) = said["outcomes"].values()
    assert (outcome["verdict"], outcome["exit_status"]) == ("refused", 2)
    assert said["counts"] == {"error": 1}
