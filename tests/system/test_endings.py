"""However a run ends: in time, with the cause named, nothing left behind, the record opens."""

import re
import signal
from pathlib import Path

import pytest
from mcap.reader import make_reader
from support.processes import Run, completed, running

from fleetloop.record.reader import Record

pytestmark = pytest.mark.system


def check_remains(run: Run, runtime_folder: Path) -> None:
    """No process, no socket, no folder; the record opens with our reader and the stock one."""
    assert run.survivors() == []
    assert not runtime_folder.exists()
    record = Record.open(run.folder / "record.mcap")
    assert all(len(rows) > 0 for rows in record.plant.values())
    with (run.folder / "record.mcap").open("rb") as stream:
        statistics = make_reader(stream).get_summary().statistics
    assert statistics.message_count > 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_run_in_order(number: signal.Signals, tmp_path, runtime_folder) -> None:
    with running(tmp_path / "a", "paper") as run:
        run.send(number)
        status, out = run.end()
        assert status == 130
        assert f"interrupted by {number.name}" in out
        check_remains(run, runtime_folder)
    assert run.summary()["verdict"] == "interrupted"


@pytest.mark.parametrize(
    ("child", "name"),
    [("plant", "plant"), ("recorder", "recorder"), ("r1", "agent/r1"), ("r4", "agent/r4")],
)
def test_a_killed_process_is_named_with_the_tick(
    child: str, name: str, tmp_path, runtime_folder
) -> None:
    with running(tmp_path / "a", "paper") as run:
        run.child(child).kill()
        status, out = run.end()
        assert status == 3
        check_remains(run, runtime_folder)
    summary = run.summary()
    assert summary["verdict"] == "aborted"
    assert summary["reason"] == f"{name} was killed by SIGKILL, after {summary['ticks']} ticks"
    assert f"verdict  aborted: {summary['reason']}" in out


def test_a_killed_launcher_leaves_nothing_and_the_plant_says_the_tick(
    tmp_path, runtime_folder
) -> None:
    with running(tmp_path / "a", "paper") as run:
        run.send(signal.SIGKILL)
        _, out = run.end()
        check_remains(run, runtime_folder)
    assert "plant: the launcher is gone; ended after " in out


@pytest.mark.parametrize(
    ("child", "words"),
    [
        ("plant", r"plant: no progress for [1-9]\d*\.\d s"),
        ("recorder", r"recorder: no progress for [1-9]\d*\.\d s"),
        # Whoever misses it first: the plant, or the robot that hears r2.
        (
            "r2",
            r"no answer from the controller of r2 within 0\.9 s|within 0\.75 s no path state of r2",
        ),
    ],
)
def test_a_wedged_process_is_named_once_the_tick_deadline_is_over(
    child: str, words: str, tmp_path, runtime_folder
) -> None:
    deadline = ("--set", "clock.tick_deadline_s=1.0")
    with running(tmp_path / "a", "paper", *deadline) as run:
        run.child(child).suspend()
        status, out = run.end()
        assert status == 3
        assert re.search(words, out), out
        check_remains(run, runtime_folder)


def test_a_port_in_use_ends_with_3_and_its_name_and_leaves_no_folder(tmp_path: Path) -> None:
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        endpoint = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        option = f'network.endpoint="{endpoint}"'
        status, out = completed(tmp_path / "a", "two_robots", "--set", option)
    assert status == 3
    assert endpoint in out
    assert "in use" in out
    assert "Traceback" not in out
    assert list(tmp_path.iterdir()) == []


def test_a_runtime_folder_that_can_not_be_made_ends_with_3(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("FLEETLOOP_RUNTIME", "/proc/nowhere")
    status, out = completed(tmp_path / "a", "two_robots")
    assert status == 3
    assert "can't make the run's folder for sockets" in out
    assert "/proc/nowhere" in out
