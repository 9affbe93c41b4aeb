"""`fleetloop compare` as it is used: runs, tables, page, and what can go wrong with a law."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest
from support.command_line import fleetloop

from bridge.process.lifecycle import Stop
from configs.loading import load
from fleetloop.compare.contenders import contenders, scenario_under
from fleetloop.compare.jobs import Trial
from fleetloop.compare.runs import Planned, folders
from fleetloop.jobs import pool
from fleetloop.jobs.job import Told

LAWS = """
from dataclasses import dataclass
import os
from agents.laws.interface import Law, LawOutput, Parameters

class Quiet(Law):
    @dataclass(frozen=True, slots=True, kw_only=True)
    class Gains(Parameters):
        pass

    def __init__(self, gains, wheels, period_s, path):
        self.ticks = 0

    def step(self, state, motion, reference, along):
        return LawOutput(0.0, 0.0, None, ())

class Raises(Quiet):
    def step(self, state, motion, reference, along):
        self.ticks += 1
        if self.ticks > 100:
            raise KeyError("gone")
        return LawOutput(0.0, 0.0, None, ())

class Hangs(Quiet):
    def step(self, state, motion, reference, along):
        while True:
            pass

class Leaves(Quiet):
    def step(self, state, motion, reference, along):
        os._exit(7)
"""


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("compared")
    (folder / "odd.py").write_text(LAWS)
    words = ("--laws", "adaptive_dsc_robust,odd:Raises", "--duration", "0.3")
    done = fleetloop(folder, "compare", "two_robots", *words, "--out", "out")
    return done, folder / "out"


def test_each_law_has_a_row_and_one_that_stops_its_reason(compared) -> None:
    done, _ = compared
    assert done.returncode == 0, done.stderr
    assert "adaptive_dsc_robust" in done.stdout
    assert "STOPPED odd:Raises: r1 stopped: " in done.stdout
    assert "KeyError: 'gone'" in done.stdout


def test_the_page_needs_nothing_else_and_the_numbers_are_for_programs(compared) -> None:
    _, out = compared
    page = (out / "compare.html").read_text("utf-8")
    assert page.count("data:image/png;base64,") == len(list((out / "figures").glob("*.png")))
    assert "src=" not in page.replace('src="data:', "")
    numbers = json.loads((out / "compare.json").read_text("utf-8"))
    robust, raises = numbers["laws"]
    assert robust["step"]["ratio"] == 1.0
    assert robust["worst"]["torque_wheel_N_m"]["peak"] <= 2.0
    assert raises["step"] is None
    assert [run["seed"] for run in raises["runs"]] == [1]
    assert {claim["verdict"] for claim in numbers["claims"]} == {"not testable here"}


def test_runs_leave_their_scenario_and_summary_but_no_record(compared) -> None:
    _, out = compared
    run = out / "adaptive_dsc_robust"
    assert sorted(path.name for path in run.iterdir()) == ["scenario.toml", "summary.json"]
    assert load(run / "scenario.toml").control.name == "adaptive_dsc_robust"


def trial(folder: Path, label: str) -> Trial:
    (folder / "odd.py").write_text(LAWS)
    (one,) = contenders(label)
    scenario = scenario_under(load("two_robots", ("until_s=0.2",)), one, folder=str(folder))
    return Trial(Told.of(scenario, str(folder)), folder / label.replace(":", "-"), False)


def test_a_law_that_ends_its_process_ends_its_own_run_alone(tmp_path: Path) -> None:
    done = pool.work([trial(tmp_path, label) for label in ("odd:Leaves", "odd:Quiet")], Stop())
    assert done[0] == "the run's process ended early (exit status 7)"
    assert done[1].summary["ticks"] == 100
    assert not psutil.Process().children()


def test_a_run_that_tells_nothing_is_ended(tmp_path: Path) -> None:
    done = pool.work([trial(tmp_path, "odd:Hangs")], Stop(), silence_s=0.5)
    assert done[0] == "stands still: nothing for 0.5 s, ended"
    assert not psutil.Process().children()


def test_a_stop_ends_all_runs(tmp_path: Path) -> None:
    stop = Stop()

    def on_progress(far: object, done: object) -> None:
        stop.request("interrupted")

    assert pool.work([trial(tmp_path, "odd:Hangs")], stop, on_progress) == {}
    assert not psutil.Process().children()


def test_ctrl_c_keeps_nothing_and_leaves_no_process(tmp_path: Path) -> None:
    words = ("compare", "paper", "--laws", "adaptive_dsc,fixed_dsc", "--out", "out")
    with subprocess.Popen(
        [sys.executable, "-m", "fleetloop", *words],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        env=os.environ,
    ) as process:
        assert process.stderr is not None
        process.stderr.readline()  # the first line about how far it is
        children = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"nothing was kept" in err
    assert children
    assert not any(child.is_running() for child in children)
    assert not (tmp_path / "out").exists()


def test_folders_of_runs_differ_whatever_the_laws_are_called() -> None:
    scenario = load("two_robots")
    planned = [Planned(label, 1, scenario) for label in ("a:B", "a B", "a-B", "..")]
    assert folders(planned) == ["a-B", "a-B-2", "a-B-3", "law"]
    planned = [Planned("a", seed, scenario) for seed in (1, 2)]
    assert folders(planned) == ["a-seed-1", "a-seed-2"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--laws", "fixd_dsc"), "did you mean fixed_dsc"),
        (("--laws", "fixed_dsc", "--seeds", "-1"), "a seed is a whole number"),
        (("--laws", "fixed_dsc", "--clock", "realtime"), "--clock lockstep"),
    ],
)
def test_a_wrong_option_starts_nothing(words, said: str, tmp_path: Path) -> None:
    done = fleetloop(tmp_path, "compare", "two_robots", *words)
    assert done.returncode == 2
    assert said in " ".join(done.stderr.split())
    assert not list(tmp_path.iterdir())
