"""Runs over processes: the same record as in one process, bit for bit."""

import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from support.processes import completed, running

from fleetloop.results.diff import print_comparison
from fleetloop.results.run_folder import read_record

pytestmark = pytest.mark.system

CYCLE = 'graph={edges=["r1 -> r2", "r2 -> r1"], leader=["r2"]}'


LOSSY = (
    'network={default={delay={kind="normal", mean_s=0.1, std_s=0.05}, duplication=0.1,'
    ' loss={kind="bernoulli", probability=0.3}, distance={range_m=1.5, exponent=8}},'
    ' edge=[{edges=["leader -> *", "localisation -> *"], delay={kind="constant", delay_s=0.03}}]}'
)
WIRE = 'bus.timing="wire"'
SIDES = (" right", " left")
KINDS = ["blf", "log"]


def logged(path: Path) -> list[tuple[int, str, str]]:
    """Time, source and kind of all events in a record."""
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [
            (message.log_time, said.name, said.message.partition(":")[0])
            for _, _, message, said in reader.iter_decoded_messages(topics="log")
        ]


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("--set", CYCLE, "--set", LOSSY, "--set", "localisation.delay_s=0.0"),
        ("--set", WIRE, "--set", "clock.control_period_s=0.001"),
    ],
    ids=["two_robots", "lossy_cycle", "wire"],
)
def test_processes_and_one_process_leave_the_same_record_bit_for_bit(
    overrides: tuple[str, ...], tmp_path: Path, capsys
) -> None:
    a, b, c = (tmp_path / name for name in "abc")
    overrides = (*overrides, "--set", f"bus.record={KINDS}")
    assert completed(a, "two_robots", *overrides)[0] == 0
    assert completed(b, "two_robots", "--in-process", *overrides)[0] == 0
    assert completed(c, "two_robots", *overrides)[0] == 0
    assert print_comparison(a, b, as_json=False) == 0
    assert print_comparison(a, c, as_json=False) == 0
    frames = [json.loads((x / "summary.json").read_text())["frames_per_bus"] for x in (a, b, c)]
    assert frames[0] == frames[1] == frames[2]
    assert min(frames[0].values()) > 4 * 2000
    nodes = [json.loads((x / "summary.json").read_text())["nodes"] for x in (a, b, c)]
    assert nodes[0] == nodes[1] == nodes[2]
    if WIRE in overrides:
        assert set(nodes[0]) == {f"{r}/{r}{side}" for r in ("r1", "r2") for side in ("", *SIDES)}
        sent = nodes[0]["r1/r1"]
        assert sent["sent"] == sent["accepted"] > 2 * 4000
    ticks = 4000 if WIRE in overrides else 2000
    assert f"identical: {ticks} ticks of 2 robots" in capsys.readouterr().out
    recorded = ["record.mcap", *(f"can/{bus}.{kind}" for bus in ("r1", "r2") for kind in KINDS)]
    for name in recorded:
        assert (a / name).read_bytes() == (b / name).read_bytes() == (c / name).read_bytes(), name


SWITCHING = """graph={edges=["r1 -> r2", "r2 -> r1"], leader=["r2"], switch=[
  {random=true, probability=0.5, dwell_s=0.03, seed=5},
  {at_s=0.3, rotate=[["r1 -> r2", "leader -> r1"], ["r2 -> r1", "leader -> r2"]], dwell_s=0.07},
  {at_s=0.6, edges=["r2 -> r1"]}]}"""


def test_edges_come_and_go_at_the_same_ticks_over_processes(tmp_path: Path) -> None:
    args = ("two_robots", "--duration", "0.8", "--allow-unchecked", "--set", SWITCHING)
    assert completed(tmp_path / "a", *args)[0] == 0
    assert completed(tmp_path / "b", *args, "--in-process")[0] == 0
    records = [(tmp_path / name / "record.mcap").read_bytes() for name in "ab"]
    assert records[0] == records[1]
    rows = read_record(tmp_path / "a", partial=False).controller["r2"]
    assert set(rows["neighbours"]) == {0.0, 1.0}
    assert np.isnan(rows["age_of_r1_s"][rows["neighbours"] == 0.0]).all()
    assert not np.isnan(rows["age_of_r1_s"][rows["neighbours"] == 1.0]).any()


def test_a_robot_joins_and_leaves_at_the_same_ticks_over_processes(tmp_path: Path) -> None:
    args = ("two_robots", "--duration", "0.8", "--allow-unchecked")
    args += ("--set", "robot.r2.joins_at_s=0.2", "--set", "robot.r2.leaves_at_s=0.5")
    args += ("--set", "robot.r2.v_m_s=0.0", "--set", "coordination.v_hat_0=0.6")
    assert completed(tmp_path / "a", *args)[0] == 0
    assert completed(tmp_path / "b", *args, "--in-process")[0] == 0
    records = [(tmp_path / name / "record.mcap").read_bytes() for name in "ab"]
    assert records[0] == records[1]
    record = read_record(tmp_path / "a", partial=False)
    rows, h_s = record.controller["r2"], 0.002
    there = (rows["t_s"] > 0.2 - 0.5 * h_s) & (rows["t_s"] < 0.5 - 0.5 * h_s)
    assert np.array_equal(np.isfinite(rows["s"]), there)
    assert np.array_equal(rows["tau_right_wheel_N_m"] != 0.0, there)
    # Both agree from the first tick on: it goes with the other, whatever its body does.
    assert rows["s"][there] == pytest.approx(record.controller["r1"]["s"][there], abs=1e-6)
    before = record.plant["r2"][rows["t_s"] < 0.2]
    assert np.ptp(before["x_m"]) == np.ptp(before["y_m"]) == 0.0
    summaries = [json.loads((tmp_path / name / "summary.json").read_text()) for name in "ab"]
    events, in_process = (summary["events"] for summary in summaries)
    assert events == in_process
    assert logged(tmp_path / "a" / "record.mcap") == [
        (max(it["tick"], 0) * 2_000_000, it["source"], it["kind"]) for it in events
    ]
    assert [(it["source"], it["kind"]) for it in events[:2]] == [("r1", "armed"), ("r2", "armed")]
    assert max(it["tick"] for it in events[:2]) < 0
    assert [(it["t_s"], it["kind"]) for it in events[2:]] == [(0.2, "joined"), (0.5, "left")]
    said = summaries[0]["notices"]["r2"]
    assert [line.partition("): ")[2][:13] for line in said] == ["joined: at s ", "left"]


def test_a_robot_that_diverges_is_named_and_the_other_goes_on_in_either_mode(
    tmp_path: Path, capsys
) -> None:
    args = ("two_robots", "--duration", "0.5", "--set", "robot.r1.v_m_s=1e6")
    with running(tmp_path / "a", *args, bus_time_s=0.1) as run:
        status, out = run.end()
    assert completed(tmp_path / "b", *args, "--in-process")[0] == status == 1, out
    assert print_comparison(tmp_path / "a", tmp_path / "b", as_json=False) == 0
    assert "identical: 250 ticks of 2 robots" in capsys.readouterr().out
    assert run.summary()["verdict"] == "failed"
    stopped = run.summary()["stopped_robots"]
    assert list(stopped) == ["r1"]
    assert stopped["r1"].startswith(
        "tick 0 (t = 0.000 s): its motion diverged: v = 1e+06 m/s, ω = "
    )


def test_four_robots_are_at_least_six_processes_under_two_gibibytes(tmp_path: Path) -> None:
    with running(tmp_path / "a", "paper", "--duration", "2", "--allow-unchecked") as run:
        names = run.names()
        family = [run.launcher, *(run.child(name) for name in names)]
        memory = sum(process.memory_info().rss for process in family)
        status, out = run.end()
    assert names == ["plant", "r1", "r2", "r3", "r4", "recorder"]
    assert memory < 2 * 2**30
    assert status == 0, out
    summary = run.summary()
    assert summary["ticks"] == 2000
    assert summary["real_time_factor"] > 0
    # Each bus carries four frames at every tick: two encoders, two torques.
    assert all(count > 4 * 2000 for count in summary["frames_per_bus"].values())
    assert set(summary["frames_per_bus"]) == {"r1", "r2", "r3", "r4"}


def test_a_run_held_to_a_speed_takes_its_time(tmp_path: Path) -> None:
    args = ("two_robots", "--duration", "1", "--allow-unchecked", "--speed", "1")
    with running(tmp_path / "a", *args, bus_time_s=0.3) as run:
        status, out = run.end()
    assert status == 0, out
    assert run.summary()["wall_s"] >= 0.99
