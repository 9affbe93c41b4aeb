"""Runs that stand still on the way: lockstep goes on, real time says at once who froze."""

import json
import re
from pathlib import Path

import pytest
from support.processes import Run, completed, running

from fleetloop.results.diff import print_comparison

pytestmark = pytest.mark.system

LONGER_THAN_ANY_DEADLINE_S = 2.5
LOCKSTEP = ("paper", "--duration", "8", "--set", "clock.tick_deadline_s=1.0", "--allow-unchecked")


def stopped(run: Run, *, all_of_it: bool) -> None:
    """Stop the launcher, as Ctrl-Z does, or everybody, for longer than anybody waits."""
    roles = [run.child(name) for name in run.names()] if all_of_it else []
    for process in (run.launcher, *roles):
        process.suspend()
    run.wait(LONGER_THAN_ANY_DEADLINE_S)
    for process in (*roles, run.launcher):
        process.resume()


@pytest.mark.parametrize("all_of_it", [False, True], ids=["launcher", "everybody"])
def test_a_lockstep_run_that_was_stopped_goes_on_to_the_same_record(
    all_of_it: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with running(tmp_path / "a", *LOCKSTEP, bus_time_s=0.5) as run:
        stopped(run, all_of_it=all_of_it)
        status, out = run.end()
    assert status == 0, out
    assert completed(tmp_path / "b", *LOCKSTEP, "--in-process")[0] == 0
    assert print_comparison(tmp_path / "a", tmp_path / "b", as_json=False) == 0
    assert capsys.readouterr().out.startswith("identical")
    machine = run.summary()["machine"]
    assert machine["stopped_and_continued"] == 1, (machine, out)
    assert machine["longest_stall_s"] > LONGER_THAN_ANY_DEADLINE_S - 0.5
    assert re.search(
        r"launcher: tick \d+ .*: stopped for \d+\.\d+ s at t = .* \(Ctrl-Z\), and continued",
        out,
    )


def test_a_controller_that_freezes_in_real_time_is_named_at_once_and_when_it_goes_on(
    tmp_path: Path,
) -> None:
    args = ("realtime_100hz", "--duration", "6", "--allow-unchecked", "--set", "host.rearm=true")
    with running(tmp_path / "a", *args, bus_time_s=1.0) as run:
        run.child("r3").suspend()
        silence = run.await_line(
            r"r3: tick \d+ .*: no sign of life for \d\.\d s, since tick \d+ .*", 30.0
        )
        assert silence[0].endswith(", stopped by a signal")
        run.child("r3").resume()
        run.await_line(r"r3: tick \d+ .*: back: goes on after \d+\.\d s", 30.0)
        stalled = run.await_line(
            r"r3: tick \d+ .*: stalled: this controller, or its machine, stalled .*", 30.0
        )
        run.end()
    said = run.summary()["notices"]["r3"]
    assert silence[0].removeprefix("r3: ") in said
    assert stalled[0].removeprefix("r3: ") in said


def test_what_happens_to_a_robot_is_said_when_it_happens(tmp_path: Path) -> None:
    # Beyond any bound: the motion diverges with the first torque.
    args = ("two_robots", "--set", "robot.r1.v_m_s=1e6", "--json")
    run = Run(tmp_path / "a", *args)
    try:
        run.await_line(r"r1: tick 0 \(t = 0\.000 s\): diverged: its motion diverged.*", 30.0)
        status, out = run.end()
    finally:
        run.kill()
    assert status == 1
    assert json.loads(out[out.index("{") : out.rindex("}") + 1])["verdict"] == "failed"
    assert "r1" in run.summary()["stopped_robots"]


@pytest.mark.parametrize(
    ("scenario", "child", "status", "cause"),
    [
        ("paper", "r2", 3, "agent/r2: left the run early"),
        ("paper", "plant", 3, "plant: left the run early"),
        pytest.param("realtime_100hz", "r2", 1, "r2: cut short at", marks=pytest.mark.wall_clock),
        ("realtime_100hz", "plant", 3, "plant: left the run early"),
    ],
)
def test_who_is_told_to_leave_is_named_at_once(
    scenario: str, child: str, status: int, cause: str, tmp_path: Path
) -> None:
    with running(tmp_path / "a", scenario, "--duration", "6") as run:
        run.child(child).terminate()
        run.await_line(rf"{child}: left the run early: asked to stop", 30.0)
        assert run.end()[0] == status
    assert run.summary()["reason"].startswith(cause)
