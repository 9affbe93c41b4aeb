"""`fleetloop.run`: one scenario, in this process or over processes, in any thread."""

import gc
import os
import signal
import threading
from pathlib import Path

import numpy as np
import pytest

import fleetloop
from fleetloop import Progress, Run, Scenario, ScenarioError


@pytest.fixture(scope="module")
def short() -> Scenario:
    return fleetloop.load("two_robots").with_(until_s=0.2, expect=[])


def open_files() -> int:
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


def test_progress_and_events_come_while_it_runs(short: Scenario) -> None:
    far: list[Progress] = []
    events = []
    run = fleetloop.run(short.with_(until_s=1.1), on_progress=far.append, on_event=events.append)
    assert [one.t_s for one in far] == sorted(one.t_s for one in far)
    assert far[0].t_s == 0.0 and far[-1].share == 1.0
    assert far[-1].ends_at_s == 1.1 and far[-1].wall_s > 0.0
    assert [(e.source, e.kind) for e in events] == [(e.source, e.kind) for e in run.events]
    assert events[0].kind == "armed"


def test_a_temporary_folder_goes_with_its_run_unless_it_is_saved(
    short: Scenario, tmp_path: Path
) -> None:
    run = fleetloop.run(short)
    folder = run.folder
    assert (folder / "summary.json").exists()
    saved = run.save(tmp_path / "kept")
    with pytest.raises(ScenarioError, match="kept: exists; name a new folder"):
        run.save(tmp_path / "kept")
    x = run["r1"].x_m
    del run
    gc.collect()
    assert not folder.exists()
    assert np.array_equal(saved["r1"].x_m, x)


def test_a_named_folder_is_left_as_the_command_leaves_it(short: Scenario, tmp_path: Path) -> None:
    run = fleetloop.run(short, out=tmp_path / "mine")
    assert run.folder == tmp_path / "mine"
    assert {"record.mcap", "summary.json", "scenario.toml", "layout.json"} <= {
        path.name for path in run.folder.iterdir()
    }
    with pytest.raises(ScenarioError, match="mine: exists and is not an empty folder"):
        fleetloop.run(short, out=tmp_path / "mine")


def test_many_runs_leave_no_open_file(short: Scenario) -> None:
    fleetloop.run(short)
    before = open_files()
    for _ in range(3):
        fleetloop.run(short)
    gc.collect()
    assert open_files() == before


@pytest.mark.parametrize(
    ("changes", "options", "text"),
    [
        ({}, {"speed": 2.0}, "speed = 2: in_process=True runs as fast as it can"),
        ({}, {"speed": -1.0}, "speed = -1.0: 0 "),
        ({}, {"deployment": "d.toml"}, "deployment = d.toml: in_process=True has no buses"),
        ({"clock": {"mode": "realtime"}}, {}, "add in_process=False, or with_(clock="),
        ({"control.k4": 30.0}, {}, "force=True runs it all the same\nerror: r1, r2: sampled"),
    ],
)
def test_what_can_not_be_run_is_refused_in_the_words_of_a_program(
    short: Scenario, changes: dict[str, object], options: dict[str, object], text: str
) -> None:
    with pytest.raises(ScenarioError) as caught:
        fleetloop.run(short.with_(changes), **options)
    assert text in str(caught.value)


def test_what_is_to_be_minded_is_noted_with_the_run(short: Scenario) -> None:
    run = fleetloop.run(fleetloop.load("two_robots").with_(until_s=0.2))
    assert any("the run ends at 0.2 s" in note for note in run.notes)


def test_ctrl_c_ends_a_run_in_order_and_interrupts_the_program(
    short: Scenario, tmp_path: Path
) -> None:
    sent = []

    def interrupt(far: Progress) -> None:
        if far.t_s > 0.3 and not sent:  # a second one interrupts at once
            sent.append(far.t_s)
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # xdist has another
    try:
        with pytest.raises(KeyboardInterrupt, match="interrupted by SIGINT"):
            fleetloop.run(short.with_(until_s=20.0), out=tmp_path / "run", on_progress=interrupt)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    run = Run(tmp_path / "run")
    assert run.verdict == "interrupted"
    assert 0.3 < run.t_s[-1] < 2.0


def test_an_error_in_the_programs_own_function_ends_the_run_and_is_raised(
    short: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(ZeroDivisionError):
        fleetloop.run(short, on_progress=lambda _: 1 / 0)
    assert not list(tmp_path.iterdir())


@pytest.mark.system
def test_over_processes_the_record_is_the_same_also_in_another_thread(short: Scenario) -> None:
    runs: list[Run] = []
    thread = threading.Thread(target=lambda: runs.append(fleetloop.run(short, in_process=False)))
    thread.start()
    thread.join(60.0)
    here = fleetloop.run(short)
    (there,) = runs
    assert there.summary.mode == "lockstep"
    for name in (*here["r1"],):
        assert np.array_equal(there.signal(name), here.signal(name), equal_nan=True), name


@pytest.mark.system
def test_ctrl_c_leaves_no_process_of_a_run_over_processes(short: Scenario, tmp_path: Path) -> None:
    def interrupt(far: Progress) -> None:
        if far.t_s > 0.0:
            os.kill(os.getpid(), signal.SIGINT)

    endless = short.with_(until_s=600.0)
    with pytest.raises(KeyboardInterrupt):
        fleetloop.run(endless, in_process=False, out=tmp_path / "ended", on_progress=interrupt)
    assert not [
        path
        for path in Path("/proc").glob("[0-9]*/cmdline")
        if str(tmp_path / "ended").encode() in _read(path)
    ]
    assert Run(tmp_path / "ended", partial=True).verdict == "interrupted"


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""
