"""What becomes of a run's folder: it may vanish under a run, and a run may never begin."""

import shutil
import signal
import time
from pathlib import Path

import pytest
from support.processes import Run, completed

from fleetloop.record.reader import Record

pytestmark = pytest.mark.system


@pytest.mark.parametrize("mode", [(), ("--in-process",)])
@pytest.mark.parametrize("moved", [True, False])
def test_a_folder_that_vanishes_is_named_at_once(
    mode: tuple[str, ...], moved: bool, tmp_path: Path, runtime_folder: Path
) -> None:
    folder = tmp_path / "a"
    run = Run(folder, "paper", "--duration", "300", "--allow-unchecked", *mode)
    try:
        deadline = time.monotonic() + 30.0
        record = folder / "record.mcap"
        while not (record.exists() and record.stat().st_size > 100_000):
            assert time.monotonic() < deadline
            run.wait(0.05)
        if moved:
            folder.rename(tmp_path / "elsewhere")
        else:
            shutil.rmtree(folder)
        status, out = run.end()
    finally:
        run.kill()
    assert status == 3, out
    assert "record.mcap was removed or moved during the run" in out
    assert "Traceback" not in out
    assert not runtime_folder.exists()
    if moved:
        whole = Record.open(tmp_path / "elsewhere" / "record.mcap")
        assert all(len(rows) > 100 for rows in whole.plant.values())
    else:
        assert list(tmp_path.iterdir()) == []


def test_a_run_that_is_interrupted_before_it_begins_leaves_no_folder(
    tmp_path: Path, runtime_folder: Path
) -> None:
    run = Run(tmp_path / "new" / "a", "paper")
    try:
        deadline = time.monotonic() + 30.0
        while not runtime_folder.exists():
            assert time.monotonic() < deadline
            run.wait(0.002)
        run.send(signal.SIGINT)
        status, out = run.end()
    finally:
        run.kill()
    assert status == 130, out
    assert "interrupted by SIGINT; the run did not begin" in out
    assert list(tmp_path.iterdir()) == []
    assert not runtime_folder.exists()


def test_a_run_whose_controller_never_comes_leaves_no_folder(tmp_path: Path) -> None:
    deployment = tmp_path / "nobody.toml"
    deployment.write_text(
        'roles = ["plant", "recorder", "agent/r2", "agent/r3", "agent/r4"]\n'
        '[network]\nendpoint = "tcp/127.0.0.1:27447"\nusers = "users"\n'
    )
    users = tmp_path / "users"
    users.touch(mode=0o600)
    users.write_text("agent-r1:secret\n")
    status, out = completed(
        tmp_path / "a",
        "realtime_100hz",
        "--deployment",
        str(deployment),
        "--set",
        "clock.start_deadline_s=2.0",
    )
    assert status == 3, out
    assert not (tmp_path / "a").exists(), out
