"""Processes of controllers killed, frozen and started again by faults, by either clock."""

from pathlib import Path

import numpy as np
import pytest
from support.processes import completed, running

from fleetloop.record.reader import Record
from fleetloop.replay.command import ReplayOptions, replay_run
from fleetloop.results.summary_file import read_summary

pytestmark = pytest.mark.system

H_S = 0.002
WATCHDOG_S = 0.1
SILENCE_S = 0.2
LOCKSTEP = (
    *("two_robots", "--duration", "1.0", "--set", "expect=[]", "--allow-unchecked"),
    *("--set", f"coordination.silence_limit_s={SILENCE_S}"),
)
BOTH_WAYS = "--set", "graph.edges=['r1 -> r2', 'r2 -> r1']"


def faulty(*faults: str) -> tuple[str, str]:
    return "--set", f"fault=[{', '.join(faults)}]"


def on_late(policy: str) -> tuple[str, ...]:
    return "--set", f"clock.on_late='{policy}'"


AT_ONCE = (*on_late("drop"), "--set", "clock.tick_deadline_s=20.0")
"""Who has gone is dropped at once; a machine that stalls makes nobody late."""


def kinds(folder: Path, robot: str) -> list[tuple[int, str]]:
    """What was said of a robot's controller and its absence, with the ticks."""
    about = {"killed", "frozen", "held", "dropped", "awaited", "back", "rejoined"}
    events = read_summary(folder)["events"]
    return [
        (it["tick"], it["kind"]) for it in events if it["source"] == robot and it["kind"] in about
    ]


def test_a_killed_robot_coasts_and_its_neighbour_lets_it_go_by_age(tmp_path: Path) -> None:
    kill = faulty("{kind='process_kill', at_s=0.4, robots=['r1']}")
    status, out = completed(tmp_path / "a", *LOCKSTEP, *kill, *AT_ONCE)
    assert status == 0, out
    assert {(200, "killed"), (200, "dropped")} == set(kinds(tmp_path / "a", "r1"))
    record = Record.open(tmp_path / "a" / "record.mcap")
    # The drive: its last set-point acts until its watchdog trips, then the robot coasts.
    plant = record.plant["r1"]
    torque, t = plant["motor_right_wheel_N_m"], plant["t_s"]
    assert (torque[(t > 0.4) & (t < 0.4 + WATCHDOG_S - H_S)] == torque[200]).all()
    assert torque[200] != 0.0
    assert not torque[t > 0.4 + WATCHDOG_S + H_S].any()
    speed = plant["v_m_s"][t > 0.4 + WATCHDOG_S + H_S]
    assert (speed > 0.0).all()
    assert (np.diff(speed) < 0.0).all()
    # The formation: its last path state is of the tick at which it was killed.
    rows = record.controller["r2"]
    heard = rows["neighbours"] > 0
    assert heard[rows["t_s"] < 0.4 + SILENCE_S].all()
    assert not heard[rows["t_s"] > 0.4 + SILENCE_S + H_S / 2].any()
    # v̂ = v_r before, so without anybody heard (38) and (45) keep ṡ = v_r.
    assert rows["s"] == pytest.approx(0.6 * rows["t_s"], abs=1e-6)
    gone = record.controller["r1"]
    assert np.isfinite(gone["s"][:200]).all()
    assert np.isnan(gone["s"][200:]).all()
    assert len(gone) == 500


def test_a_killed_controller_comes_again_to_the_same_record_each_time(tmp_path: Path) -> None:
    """Killed at 0.3 s and again at 0.5 s; by a restart at 0.7 s for the third time."""
    faults = faulty(
        "{kind='process_kill', at_s=0.3, for_s=0.1, robots=['r2']}",
        "{kind='process_restart', at_s=0.6, robots=['r1']}",
    )
    args = (*LOCKSTEP, *BOTH_WAYS, *faults, *AT_ONCE, "--record-inputs")
    for name in "abc":
        status, out = completed(tmp_path / name, *args)
        assert status == 0, out
    records = {(tmp_path / name / "record.mcap").read_bytes() for name in "abc"}
    assert len(records) == 1
    for robot in ("r1", "r2"):  # both processes of each
        assert replay_run(tmp_path / "a", ReplayOptions(robot=robot)) == 0
    said = [(150, "killed"), (150, "dropped"), (200, "awaited"), (200, "back")]
    assert sorted(kinds(tmp_path / "a", "r2")[:4]) == sorted(said)
    assert kinds(tmp_path / "a", "r2")[4][1] == "rejoined"
    restarted = kinds(tmp_path / "a", "r1")
    assert {(300, "killed"), (300, "dropped"), (301, "awaited"), (301, "back")} < set(restarted)
    rows = Record.open(tmp_path / "a" / "record.mcap").controller
    for robot, part in rows.items():
        steps = np.diff(part["s"])
        assert np.nanmax(np.abs(steps)) < 0.6 * H_S + 1e-4, robot
        assert np.isfinite(part["s"][-50:]).all(), robot


def test_a_frozen_controller_is_held_and_goes_on_to_the_same_record(tmp_path: Path) -> None:
    freeze = faulty("{kind='process_freeze', at_s=0.3, for_s=0.3, robots=['r1']}")
    args = (*LOCKSTEP, *BOTH_WAYS, *freeze, *on_late("hold"), "--set", "host.rearm=true")
    for name in "ab":
        status, out = completed(tmp_path / name, *args)
        assert status in (0, 1), out  # a watchdog stops it
    records = {(tmp_path / name / "record.mcap").read_bytes() for name in "ab"}
    assert len(records) == 1
    said = kinds(tmp_path / "a", "r1")
    assert sorted(said) == sorted([(150, "frozen"), (150, "held"), (300, "back")])
    rows = Record.open(tmp_path / "a" / "record.mcap").controller
    assert all(np.isfinite(part["s"]).all() for part in rows.values())
    t, heard = rows["r2"]["t_s"], rows["r2"]["neighbours"] > 0
    assert not heard[(t > 0.3 + SILENCE_S + H_S / 2) & (t < 0.6)].any()
    assert heard[t > 0.64].all()


def test_a_frozen_controller_that_was_dropped_is_replaced(tmp_path: Path) -> None:
    freeze = faulty("{kind='process_freeze', at_s=0.3, for_s=0.2, robots=['r2']}")
    status, out = completed(tmp_path / "a", *LOCKSTEP, *freeze, *on_late("drop"))
    assert status == 0, out
    said = [(150, "frozen"), (150, "dropped"), (250, "awaited"), (250, "back")]
    assert sorted(kinds(tmp_path / "a", "r2")[:4]) == sorted(said)
    assert kinds(tmp_path / "a", "r2")[4][1] == "rejoined"


def test_a_run_goes_on_without_a_controller_that_dies_by_accident(tmp_path: Path) -> None:
    args = ("two_robots", "--set", "expect=[]", *BOTH_WAYS, *AT_ONCE)
    with running(tmp_path / "a", *args, bus_time_s=0.5) as run:
        run.child("r2").kill()
        status, out = run.end()
        assert run.survivors() == []
    assert status == 1, out
    said = read_summary(tmp_path / "a")
    assert said["verdict"] == "not checked"
    assert said["cut_short"].keys() == {"r2"}
    texts = {it["text"] for it in said["events"] if it["kind"] == "dropped"}
    assert texts == {"agent/r2 was killed by SIGKILL", "its controller has left its bus"}
    assert len(Record.open(tmp_path / "a" / "record.mcap").controller["r1"]) == 2000


def test_under_abort_a_killed_controller_ends_the_run_with_its_fault(tmp_path: Path) -> None:
    kill = faulty("{kind='process_kill', at_s=0.4, robots=['r2'], name='bang'}")
    status, out = completed(tmp_path / "a", *LOCKSTEP, *kill)
    assert status == 3
    assert "agent/r2 was killed by SIGKILL by fault bang, after 2" in " ".join(out.split())


def test_in_one_process_they_are_refused(tmp_path: Path) -> None:
    kill = faulty("{kind='process_kill', at_s=0.4}")
    status, out = completed(tmp_path / "a", *LOCKSTEP, *kill, "--in-process")
    assert status == 2
    assert "process_kill can't act in one process" in out
    assert "without --in-process" in out


@pytest.mark.wall_clock
def test_in_real_time_they_act_at_their_ticks_and_end_no_run(tmp_path: Path) -> None:
    faults = faulty(
        "{kind='process_slow', at_s=0.3, for_s=0.1, robots=['r1'], extra_s=0.002}",
        "{kind='process_kill', at_s=0.6, for_s=0.5, robots=['r2']}",
        "{kind='process_freeze', at_s=2.0, for_s=0.7, robots=['r1']}",
    )
    args = ("two_robots_100hz", "--duration", "3.5", "--set", "expect=[]", *faults)
    status, out = completed(tmp_path / "a", *args, "--set", "host.rearm=true")
    assert status in (0, 1), out  # a watchdog stops the frozen one
    summary = read_summary(tmp_path / "a")
    assert summary["verdict"] in ("failed", "not checked")
    of_r2, of_r1 = kinds(tmp_path / "a", "r2"), kinds(tmp_path / "a", "r1")
    assert of_r2[0] == (60, "killed")
    assert of_r2[1][1] == "rejoined"
    assert of_r2[1][0] >= 110
    assert of_r1[0] == (200, "frozen")
    rows = Record.open(tmp_path / "a" / "record.mcap").controller
    assert np.isnan(rows["r2"]["s"][60:110]).all()
    assert np.isfinite(rows["r2"]["s"][-20:]).all()
    assert rows["r1"]["late_s"][200] == pytest.approx(0.7, abs=0.3)
    # By age: r2 hears nothing that is newer.
    assert rows["r2"]["age_of_r1_s"][260] > 0.5
