"""Runs by the wall clock: every tick is recorded, what the clock did is told."""

from pathlib import Path

import numpy as np
import pytest
from support.processes import WAIT_S, completed, running

from fleetloop.record.reader import Record

pytestmark = [pytest.mark.system, pytest.mark.wall_clock]


def test_a_real_time_run_takes_its_time_and_records_every_tick(tmp_path: Path) -> None:
    args = ("realtime_100hz", "--duration", "4", "--allow-unchecked")
    with running(tmp_path / "a", *args, bus_time_s=1.0) as run:
        status, out = run.end()
    assert status == 0, out
    assert "real time: misses" in out
    summary = run.summary()
    assert summary["ticks"] == 400
    assert summary["wall_s"] >= 4.0
    clock = summary["realtime"]
    assert set(clock["robots"]) == {"r1", "r2", "r3", "r4"}
    assert clock["late_us"]["p50"] > 0.0
    assert clock["round_trip_us"]["p50"] > 0.0
    assert clock["cpu_percent_of_one_core"] > 0.0
    agents = {f"agent/{robot}" for robot in ("r1", "r2", "r3", "r4")}
    assert set(summary["cpu_s"]) == {"plant", "recorder", "launcher"} | agents
    record = Record.open(tmp_path / "a" / "record.mcap")
    for robot in record.robots:
        assert record.plant[robot]["tick"].tolist() == list(range(400))
        assert record.controller[robot]["tick"].tolist() == list(range(400))
        # It goes where it should, whatever the machine was doing.
        errors = np.hypot(record.controller[robot]["x_e_m"], record.controller[robot]["y_e_m"])
        assert errors[-1] < 0.5 * errors[0]
        assert np.abs(record.controller[robot]["tau_right_wheel_N_m"]).max() <= 2.0


def test_lockstep_runs_the_same_scenario_without_the_clock(tmp_path: Path) -> None:
    args = ("realtime_100hz", "--clock", "lockstep", "--duration", "2", "--allow-unchecked")
    status, out = completed(tmp_path / "a", *args)
    assert status == 0, out
    rows = Record.open(tmp_path / "a" / "record.mcap").controller["r1"]
    assert not rows["late_s"].any()
    assert not rows["round_trip_s"].any()


def test_a_controller_that_is_killed_ends_a_real_time_run_with_its_name(tmp_path: Path) -> None:
    with running(tmp_path / "a", "realtime_100hz", bus_time_s=1.0) as run:
        run.child("r3").kill()
        status, out = run.end()
        assert status == 3
        assert "agent/r3 was killed by SIGKILL, after " in out
        assert run.survivors() == []


RESTART = ("--set", "host.restarts=1", "--set", "coordination.v_hat_0=0.6")


@pytest.mark.parametrize("robot", ["r1", "r3"])
def test_a_controller_that_is_killed_is_started_again_and_rejoins(
    robot: str, tmp_path: Path
) -> None:
    """r1 hears the leader only, r3 a neighbour."""
    expect = "expect=[{signal='s_spread', from_s=5.0, max=0.02}]"
    args = ("realtime_100hz", "--duration", "6", *RESTART, "--set", expect)
    with running(tmp_path / "a", *args, bus_time_s=1.5) as run:
        run.child(robot).kill()
        run.await_line(rf"{robot}: tick \d+ .*: rejoined: at s = .*", WAIT_S)
        status, out = run.end()
        assert status == 0, out
        assert run.survivors() == []
    summary = run.summary()
    assert summary["verdict"] == "held"
    said = summary["notices"][robot]
    again = f"restarted: agent/{robot} was killed by SIGKILL; started again, start 1 of 1"
    assert any(line.endswith(again) for line in said)
    assert any(line.endswith(": rearmed") for line in said)
    record = Record.open(tmp_path / "a" / "record.mcap")
    rows = record.controller
    assert all(len(part) == 600 for part in rows.values())
    gone = np.isnan(rows[robot]["s"])
    assert 0 < gone.sum() < 500
    # All agree: for the others nothing jumps, and the robot is where it would have been.
    for other, part in rows.items():
        assert np.abs(np.diff(part["s"])[~np.isnan(np.diff(part["s"]))]).max() < 0.02, other
    assert summary["s_spread"]["peak"] < 0.02


def test_one_end_too_many_ends_the_run(tmp_path: Path) -> None:
    with running(tmp_path / "a", "realtime_100hz", *RESTART, bus_time_s=1.5) as run:
        run.child("r3").kill()
        run.await_line(r"r3: tick \d+ .*: rejoined: at s = .*", WAIT_S)
        run.child("r2").kill()
        status, out = run.end()
        assert status == 3
        assert "agent/r2 was killed by SIGKILL, after " in out
        assert run.survivors() == []


def test_a_controller_that_a_person_ends_leaves_a_run_that_is_not_checked(tmp_path: Path) -> None:
    args = ("realtime_100hz", "--duration", "3", "--set", "expect=[]")
    with running(tmp_path / "a", *args, bus_time_s=1.0) as run:
        run.child("r3").terminate()
        status, out = run.end()
    assert (status, "verdict  not checked: r3: cut short at " in out) == (1, True), out
    summary = run.summary()
    assert "of 3 s: asked to stop" in summary["cut_short"]["r3"]
    assert set(summary["cut_short"]) == {"r3"}
