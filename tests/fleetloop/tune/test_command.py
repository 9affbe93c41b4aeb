"""`fleetloop tune` as it is used: what it leaves, going on, what it refuses."""

import json
import os
import signal
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import psutil
import pyarrow.parquet as pq
import pytest
from support.command_line import fleetloop
from support.sweeping import cluster
from support.tunings import HEAD, PEAK, SEEDS, P, written

from configs.errors import ScenarioError
from configs.loading import load as load_scenario
from fleetloop.sweep.cluster import Place
from fleetloop.sweep.options import Ways
from fleetloop.sweep.plan import Plan
from fleetloop.tune import command, storage

WAYS = Ways(Place(1), kernel=False, as_json=True)
START = '[[parameter]]\nkey = "robot.*.v_m_s"\nuniform = [0.1, 1.1]\nbaseline = 0.3\n'
SPEED = (
    HEAD.replace("trials = 12", "trials = 6").replace('"grid"', '"random"\ncases = 2')
    + "check_cases = 3\nstartup_trials = 3\n"
    + SEEDS
    + P
    + START
    + '[objective]\nquantity = "final_x_e_m"\nover = "worst"\n'
)


def numbers(folder: Path) -> dict:
    return json.loads((folder / "tune.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def tuned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which six trials were done."""
    folder = tmp_path_factory.mktemp("tuned")
    path = written(folder, SPEED)
    assert command.begin(str(path), None, None, folder / "out", WAYS) == 0
    return folder / "out"


def test_the_folder_has_all_that_was_said(tuned: Path) -> None:
    told = numbers(tuned)
    assert told["done"] == told["trials"] == len(list((tuned / "trials").glob("*.parquet"))) == 6
    assert told["ended"] == "all trials are done"
    assert set(told["judged"]) == {"baseline", "best"}
    assert told["judged"]["baseline"]["values"] == {"p": 3.0, "v_m_s": 0.3}
    page = (tuned / "tune.html").read_text("utf-8")
    assert all(
        word in page
        for word in ("worst final_x_e_m, minimised", "the best feasible one so far", "v_m_s")
    )
    assert (tuned / "figures" / "slices.pdf").exists()


def test_the_best_is_no_worse_than_any_feasible_trial(tuned: Path) -> None:
    told = numbers(tuned)
    values = [one["objective"] for one in told["all"] if one["feasible"]]
    assert told["judged"]["best"]["objective"] == min(values)


def test_other_cases_are_as_many_as_asked_and_no_trials(tuned: Path) -> None:
    best = numbers(tuned)["judged"]["best"]
    assert sum(best["other_cases"]["verdicts"].values()) == 3
    rows = pq.read_table(tuned / "check" / f"trial-{best['trial']:05d}.parquet")
    assert rows.num_rows == 3


def test_rows_of_a_trial_have_its_parameters_and_the_commands_that_run_its_cases(
    tuned: Path,
) -> None:
    rows = pq.read_table(tuned / "trials" / "trial-00000.parquet").to_pylist()
    assert [(row["p"], row["v_m_s"]) for row in rows] == [(3.0, 0.3)] * 2
    assert all("--set robot.r2.v_m_s=0.3" in row["command"] for row in rows)


def test_the_best_gains_are_a_fragment_of_a_scenario(tuned: Path) -> None:
    best = numbers(tuned)["judged"]["best"]["values"]
    text = (tuned / "best.toml").read_text("utf-8")
    table = tomllib.loads(text)
    assert table["coordination"]["p"] == best["p"]
    assert [(one["name"], one["v_m_s"]) for one in table["robot"]] == [
        ("r1", best["v_m_s"]),
        ("r2", best["v_m_s"]),
    ]


def test_the_command_runs_the_base_with_the_best_gains(tuned: Path) -> None:
    told = numbers(tuned)
    words = told["command"].split()
    assert words[:4] == ["fleetloop", "run", "two_robots", "--in-process"]
    options = [after for word, after in pairwise(words) if word == "--set"]
    scenario = load_scenario("two_robots", tuple(options))
    assert scenario.coordination.p == told["judged"]["best"]["values"]["p"]


def test_the_best_study_is_one_that_sweeps_the_same_cases(tuned: Path) -> None:
    study = Plan.of(str(tuned / "best_study.toml")).study
    assert study.total == 2
    assert study.factor[-1].values == (numbers(tuned)["judged"]["best"]["values"]["v_m_s"],)


def test_a_tuning_that_goes_on_further_is_the_longer_one(tuned: Path, tmp_path: Path) -> None:
    path = written(tmp_path, SPEED)
    assert command.begin(str(path), 4, None, tmp_path / "grown", WAYS) == 0
    assert command.resume(tmp_path / "grown", str(path), None, None, WAYS) == 0
    assert numbers(tmp_path / "grown")["all"] == numbers(tuned)["all"]


def test_going_on_when_all_is_done_computes_nothing_and_says_the_same(tuned: Path) -> None:
    before, files = numbers(tuned), sorted((tuned / "trials").iterdir())
    times = [path.stat().st_mtime_ns for path in files]
    assert command.resume(tuned, None, None, None, WAYS) == 0
    after = numbers(tuned)
    assert after["all"] == before["all"]
    assert after["judged"] == before["judged"]
    assert [path.stat().st_mtime_ns for path in files] == times


def test_another_file_is_refused_and_what_differs_is_said(tuned: Path, tmp_path: Path) -> None:
    other = written(tmp_path, SPEED.replace("uniform = [0.1, 1.1]", "uniform = [0.2, 1.1]"))
    with pytest.raises(ScenarioError, match=r"not the tuning of .*: parameter: .*0\.2.* there"):
        command.resume(tuned, str(other), None, None, WAYS)
    with pytest.raises(ScenarioError, match="--seed 7: this tuning was begun with seed 1"):
        command.resume(tuned, None, None, 7, WAYS)
    with pytest.raises(ScenarioError, match="--trials 2: it was begun with 6"):
        command.resume(tuned, None, 2, None, WAYS)


def test_a_folder_without_a_tuning_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"no study was begun there: no tuning\.toml"):
        command.resume(tmp_path, None, None, None, WAYS)


def test_without_a_feasible_trial_no_gains_are_left_and_the_status_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = HEAD.replace("trials = 12", "trials = 2") + SEEDS + P + PEAK
    text += '[[constraint]]\nquantity = "peak_x_e_m"\nat_most = 1e-9\n'
    path = written(tmp_path, text)
    ways = Ways(Place(1), kernel=False)
    assert command.begin(str(path), None, None, tmp_path / "out", ways) == 1
    out = capsys.readouterr().out
    assert "no feasible trial; trial" in out
    assert "misses worst peak_x_e_m ≤ 1e-09" in out
    assert not (tmp_path / "out" / "best.toml").exists()


def test_a_budget_that_is_over_at_once_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, HEAD + SEEDS + P + PEAK + "[stop]\nbudget_s = 1e-9\n")
    assert command.begin(str(path), None, None, tmp_path / "out", WAYS) == 1
    assert "no trial is done (budget_s = 1e-09 s is over): go on with" in capsys.readouterr().err


def test_without_optuna_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    path = written(tmp_path, HEAD + SEEDS + P + PEAK)
    with pytest.raises(ScenarioError, match=r"needs Optuna: pip install 'fleetloop\[sweep\]'"):
        command.begin(str(path), None, None, tmp_path / "out", WAYS)
    assert storage.NEEDS.count("\n") == 0


@pytest.mark.system
@pytest.mark.timeout(400)
def test_ctrl_c_keeps_what_is_done_and_workers_change_nothing(tuned: Path, tmp_path: Path) -> None:
    path = written(tmp_path, SPEED)
    words = ("tune", str(path), "--jobs", "2", "--in-process", "--out", str(tmp_path / "out"))
    process = subprocess.Popen(
        [sys.executable, "-m", "fleetloop", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        while not list((tmp_path / "out").glob("trials/trial-00001.parquet")):
            assert process.poll() is None, process.communicate()
            try:
                process.wait(0.05)
            except subprocess.TimeoutExpired:
                continue
        children = psutil.Process(process.pid).children(recursive=True)
        os.kill(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=60)
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
    _, alive = psutil.wait_procs(children, timeout=10)
    assert not alive
    if process.returncode == 130:  # else it was quicker
        assert "go on with fleetloop tune --resume" in err
    done = fleetloop(tmp_path, "tune", "--resume", "out", "--jobs", "1", "--in-process")
    assert done.returncode == 0, done.stderr
    assert numbers(tmp_path / "out")["all"] == numbers(tuned)["all"]


@pytest.mark.system
@pytest.mark.timeout(400)
def test_the_workers_of_a_cluster_bring_the_same_trials(tuned: Path, tmp_path: Path) -> None:
    path = written(tmp_path, SPEED)
    with cluster(tmp_path, workers=2) as dask:
        words = ("--scheduler", dask.address, "--in-process", "--out", "out")
        done = fleetloop(tmp_path, "tune", str(path), *words)
        assert all(process.poll() is None for process in dask.processes)  # they are the user's
    assert done.returncode == 0, done.stderr
    assert numbers(tmp_path / "out")["all"] == numbers(tuned)["all"]
    assert 1 <= numbers(tmp_path / "out")["workers"] <= 2


def test_options_of_a_cluster_that_do_not_go_together_are_refused(tmp_path: Path) -> None:
    path = str(written(tmp_path, SPEED))
    done = fleetloop(tmp_path, "tune", path, "--scheduler", "tcp://127.0.0.1:1", "--jobs", "2")
    assert done.returncode == 2
    assert "--scheduler tcp://127.0.0.1:1: has its workers; leave out --jobs" in done.stderr
    done = fleetloop(tmp_path, "tune", path, "--tls-ca", "ca.pem")
    assert done.returncode == 2
    assert "--tls-ca: of a --scheduler; none is given" in done.stderr
    assert not (tmp_path / "runs").exists()
