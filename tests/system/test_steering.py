"""A run that goes on is paused, stepped, held to a speed and given another speed of the leader."""

import json
import tomllib
from pathlib import Path

import pytest
from support.processes import completed, running

from fleetloop.door.client import RefusedError, open_run
from fleetloop.results.diff import print_comparison
from fleetloop.results.run_folder import SCENARIO, SUMMARY, read_record

pytestmark = pytest.mark.system

DEADLINE_S = 0.4
TWO = ("two_robots", "--set", "expect=[]", "--set", f"clock.tick_deadline_s={DEADLINE_S}")


def test_however_it_was_paused_and_sped_it_leaves_the_record_of_its_scenario(
    tmp_path: Path, capsys
) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    with running(a, *TWO, "--duration", "4", "--speed", "1") as run, open_run("") as client:
        paused = client.ask("run.pause")["tick"]
        status = client.ask("run.status")
        assert (status["state"], status["tick"]) == ("paused", paused)
        run.wait(5.0 * DEADLINE_S)  # beyond all deadlines of lockstep
        assert client.ask("run.status")["tick"] == paused
        assert client.ask("run.step", ticks=10)["tick"] == paused + 10
        assert client.ask("run.status")["tick"] == paused + 10
        pushed = client.ask("fault.inject", fault={"kind": "push", "force_body_N": 2.0})["fault"]
        assert (pushed["state"], pushed["from_tick"]) == ("planned", paused + 11)
        client.ask("run.leader_speed", speed_m_s=0.2, ramp_s=0.5)
        ordered = client.ask("run.leader_speed", speed_m_s=0.3, ramp_s=1.0)  # in its place
        cleared = client.ask("fault.clear", names=[])["cleared"]
        assert [one["to_tick"] for one in cleared] == [paused + 11]  # it never acted
        assert client.ask("run.speed", factor=4)["speed"] == 4.0
        assert client.ask("run.step", ticks=50)["tick"] == paused + 60
        within = client.ask("run.leader_speed", speed_m_s=0.7, ramp_s=0.2)  # the first ramp
        client.ask("run.speed", factor=0)
        with pytest.raises(RefusedError, match=r"ramp_s = -1\.0: must be 0 or more"):
            client.ask("run.leader_speed", speed_m_s=0.3, ramp_s=-1)
        client.ask("run.resume")
        status, out = run.end()
    assert status == 0, out
    steps = tomllib.loads((a / SCENARIO).read_text())["leader"]["steps"]
    assert steps == [
        {"t_s": ordered["t_s"], "speed_m_s": 0.3, "ramp_s": 1.0},
        {"t_s": within["t_s"], "speed_m_s": 0.7, "ramp_s": 0.2},
    ]
    events = json.loads((a / SUMMARY).read_text())["events"]
    assert [one["tick"] for one in events if one["kind"] == "leader_speed"][-1] == within["tick"]
    assert completed(b, str(a / SCENARIO), "--in-process")[0] == 0
    assert print_comparison(a, b, as_json=False) == 0, capsys.readouterr().out
    tick = ordered["tick"]
    v_r_hat = read_record(a, partial=False).controller["r1"]["v_r_hat"]
    assert v_r_hat[tick + 1] == pytest.approx(0.6, abs=1e-9)  # the ramp begins with 0.6
    assert v_r_hat[tick + 2] < 0.6 - 1e-6


@pytest.mark.wall_clock
def test_a_deadline_shorter_than_signs_of_life_are_apart_ends_no_run(tmp_path: Path) -> None:
    options = ("--set", "clock.tick_deadline_s=0.15", "--duration", "1.5", "--speed", "1")
    status, out = completed(tmp_path / "run", "two_robots", "--set", "expect=[]", *options)
    assert status == 0, out


@pytest.mark.wall_clock
def test_in_real_time_the_leader_changes_its_speed_and_nobody_the_pace(tmp_path: Path) -> None:
    options = ("--clock", "realtime", "--set", "expect=[]", "--duration", "30")
    speeds = ("--set", "leader.speed_m_s=0.6", "--set", "coordination.v_hat_0=0.6")
    args = ("two_robots_100hz", *options, *speeds, "--allow-unchecked")
    with running(tmp_path / "run", *args) as run, open_run("") as client:
        for request, arguments in (("run.pause", {}), ("run.step", {"ticks": 1})):
            with pytest.raises(RefusedError, match="keeps real time, whose pace nobody sets"):
                client.ask(request, **arguments)
        ordered = client.ask("run.leader_speed", speed_m_s=0.3, ramp_s=0.0)
        assert "late" not in ordered
        while client.ask("run.status")["tick"] < ordered["tick"] + 20:
            run.wait(0.05)
        assert client.ask("run.status")["leader_speed_m_s"] == 0.3
        client.ask("run.stop")
        status, out = run.end()
    assert status == 130, out
    assert "stopped by its operator" in out
    rows = read_record(tmp_path / "run", partial=True).controller["r1"]
    tick = ordered["tick"]
    assert rows["v_r_hat"][tick] == pytest.approx(0.6, abs=1e-9)
    assert rows["v_r_hat"][tick + 1] < 0.6 - 1e-4
