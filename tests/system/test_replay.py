"""Replays of runs over processes: what was recorded of a controller gives its rows bit for bit."""

from pathlib import Path

import pytest
from support.processes import WAIT_S, completed, running

from fleetloop.replay.command import ReplayOptions, replay_run

pytestmark = pytest.mark.system

LOSSY = (
    'network={default={delay={kind="normal", mean_s=0.1, std_s=0.05}, duplication=0.1,'
    ' loss={kind="bernoulli", probability=0.3}, distance={range_m=1.5, exponent=8}}}'
)


def test_a_lockstep_run_replays_with_a_lossy_network(tmp_path: Path, capsys) -> None:
    args = (
        "two_robots",
        "--record-inputs",
        "--duration",
        "1",
        "--set",
        LOSSY,
        "--set",
        "expect=[]",
    )
    status, out = completed(tmp_path / "a", *args)
    assert status == 0, out
    for robot in ("r1", "r2"):
        assert replay_run(tmp_path / "a", ReplayOptions(robot=robot)) == 0
        assert "identical: 500 ticks" in capsys.readouterr().out


@pytest.mark.wall_clock
def test_a_real_time_run_replays_and_so_does_a_controller_that_was_started_again(
    tmp_path: Path, capsys
) -> None:
    args = ("realtime_100hz", "--duration", "3", "--set", "host.restarts=1", "--set", "expect=[]")
    with running(tmp_path / "a", *args, bus_time_s=1.5) as run:
        run.child("r3").kill()
        run.await_line(r"r3: tick \d+ .*: rejoined: at s = .*", WAIT_S)
        status, out = run.end()
        assert status == 0, out
    for robot in ("r1", "r2", "r4"):
        assert replay_run(tmp_path / "a", ReplayOptions(robot=robot)) == 0
        assert "identical: 300 ticks" in capsys.readouterr().out
    assert replay_run(tmp_path / "a", ReplayOptions(robot="r3")) == 0
    said = capsys.readouterr()
    assert "1 of its 2 logs end before their controller did" in said.err
    assert "bit for bit" in said.out
