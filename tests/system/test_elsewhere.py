"""Controllers that somebody else starts: `fleetloop agent` against a run with roles excluded."""

import re
import signal
import subprocess
import sys

import numpy as np
import pytest
from support.addresses import free_port, multicast_bus, multicast_goes_nowhere
from support.elsewhere import SCENARIO, SHORT, Agent, deployment, start, with_password
from support.own_files import write_own_at_100_hz
from support.processes import Run, completed

from fleetloop.record.reader import Record

pytestmark = pytest.mark.system


@pytest.mark.wall_clock
def test_a_controller_elsewhere_drives_its_robot_to_the_end_of_the_run(tmp_path, agents) -> None:
    where = with_password(tmp_path)
    agents.append(Agent("r2", where))  # that this run ends early, the run tells it
    run = start(tmp_path, where, "--duration", "3")
    try:
        status, out = run.end()
        assert status == 0, out
        status, said = agents[0].end()
        assert status == 0
        assert "end of the run" in said
    finally:
        run.kill()
    record = Record.open(tmp_path / "run" / "record.mcap")
    for rows in (*record.plant.values(), *record.controller.values()):
        assert rows["tick"].tolist() == list(range(300))
    assert set(run.summary()["realtime"]["robots"]) == {"r1", "r2"}
    assert "router" not in run.summary()["notices"]
    clock = run.summary()["clock_offsets"]["agent/r2"]
    assert abs(clock["ahead_ms"]) <= clock["uncertain_ms"]  # it is the same clock


def test_a_machine_whose_clock_is_off_is_refused_with_what_that_would_cost(
    tmp_path, agents
) -> None:
    where = with_password(tmp_path)
    agents.append(Agent("r2", where, ahead_s=0.2))
    run = start(tmp_path, where)
    try:
        status, out = run.end()
        assert status == 3
        assert agents[0].end()[0] == 3
    finally:
        run.kill()
    found = re.search(r"the clock of r2 is \+(\S+) ms \(± (\S+) ms\) off that of r1, which it", out)
    assert found is not None, out
    assert abs(float(found[1]) - 200.0) <= float(found[2]) + 1.0
    assert "more than network.clock_tolerance_m = 0.02" in out
    assert not (tmp_path / "run").exists()


def test_a_controller_elsewhere_runs_a_law_of_the_users_own(tmp_path, agents) -> None:
    scenario, where = str(write_own_at_100_hz(tmp_path)), with_password(tmp_path)
    agents.append(Agent("r2", where, scenario=[scenario]))
    status, out = completed(tmp_path / "run", scenario, "--deployment", str(where), *SHORT)
    assert status == 0, out
    status, said = agents[0].end()
    assert (status, "end of the run" in said) == (0, True), said
    rows = Record.open(tmp_path / "run" / "record.mcap").controller["r2"]
    off = np.hypot(rows["x_e_m"], rows["y_e_m"])
    assert len(rows) == 100
    assert np.allclose(rows["distance_m"], off, rtol=0.0, atol=1e-12)


@pytest.mark.skipif(multicast_goes_nowhere(), reason="no route for multicast here")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL, signal.SIGSTOP])
def test_a_controller_elsewhere_stops_when_the_launcher_does(
    number: signal.Signals, tmp_path, agents
) -> None:
    where = with_password(tmp_path)
    # On a bus that outlives the launcher, as a real one does.
    bus = f"[robot.r2]\nemulated = true\n{multicast_bus()}\n"
    where.write_text(where.read_text() + bus)
    agents.append(Agent("r2", where))
    run = start(tmp_path, where)
    try:
        run.await_bus_time(1.5)
        run.send(number)
        if number != signal.SIGSTOP:  # which is to the others what a cut cable is
            status, out = run.end()
            assert status == (130 if number == signal.SIGINT else -9), out
        status, said = agents[0].end()
    finally:
        run.kill()
    assert status == 3
    why = "the launcher is gone, or the network to it"
    if number == signal.SIGINT:
        why = "the run was ended: interrupted by SIGINT"
    assert f"agent/r2: {why}: drives disarmed" in said


def test_a_controller_elsewhere_that_is_killed_ends_the_run_with_its_name(tmp_path, agents) -> None:
    where = with_password(tmp_path)
    agents.append(Agent("r2", where))
    run = start(tmp_path, where)
    try:
        run.await_bus_time(1.5)
        agents[0].process.kill()
        status, out = run.end()
    finally:
        run.kill()
    assert status == 3
    assert "agent/r2: lost; it, its machine or the network to it is gone" in out
    assert run.survivors() == []


def test_when_one_controller_is_lost_those_elsewhere_are_told_who(tmp_path, agents) -> None:
    (tmp_path / "users").write_text("agent-r1:one\nagent-r2:two\n")
    (tmp_path / "users").chmod(0o600)
    where = deployment(tmp_path, extra='users = "users"\n')
    where.write_text(where.read_text().replace(', "agent/r1"', ""))
    agents += [Agent(robot, where) for robot in ("r1", "r2")]
    run = start(tmp_path, where)
    try:
        run.await_bus_time(1.5)
        agents[0].process.kill()
        assert run.end()[0] == 3
        status, said = agents[1].end()
    finally:
        run.kill()
    assert status == 3
    assert (
        "agent/r2: the run was ended: agent/r1: lost; it, its machine or the network to it" in said
    )


def test_a_controller_elsewhere_that_is_interrupted_says_so_and_leaves_its_drives_idle(
    tmp_path, agents
) -> None:
    where = with_password(tmp_path)
    agents.append(Agent("r2", where))
    run = start(tmp_path, where)
    try:
        run.await_bus_time(1.5)
        agents[0].process.send_signal(signal.SIGTERM)
        status, said = agents[0].end()
        run.send(signal.SIGINT)
        run.end()
    finally:
        run.kill()
    assert status == 130
    assert "interrupted by SIGTERM" in said
    torque = Record.open(tmp_path / "run" / "record.mcap").plant["r2"]["motor_right_wheel_N_m"]
    assert torque[-1] == 0.0


def test_who_waits_for_a_router_that_is_not_there_can_be_interrupted(tmp_path, agents) -> None:
    agents.append(Agent("r2", with_password(tmp_path)))
    process = agents[0].process
    assert process.stderr is not None
    assert "waiting for run" in process.stderr.readline()
    process.send_signal(signal.SIGTERM)
    status, said = agents[0].end()
    assert (status, said) == (130, "agent/r2: interrupted by SIGTERM\n")


@pytest.mark.wall_clock
def test_the_plant_may_be_elsewhere_too(tmp_path) -> None:
    (tmp_path / "users").write_text("plant:secret\n")
    (tmp_path / "users").chmod(0o600)
    where = tmp_path / "where.toml"
    where.write_text(
        'roles = ["recorder", "agent/r1", "agent/r2"]\n'
        f'network = {{ endpoint = "tcp/127.0.0.1:{free_port()}", users = "users" }}\n'
    )
    common = (*SCENARIO, "--set", "duration_s=2.0", "--deployment", str(where))
    run = Run(tmp_path / "run", *common)
    with subprocess.Popen(
        [sys.executable, "-m", "fleetloop", "plant", *common, "--join"],
        stderr=subprocess.PIPE,
        text=True,
    ) as plant:
        try:
            status, out = run.end()
            _, said = plant.communicate(timeout=10.0)
        finally:
            run.kill()
            plant.kill()
    assert status == 0, out
    assert plant.returncode == 0, said
    assert "ended after 200 ticks" in said
    assert run.summary()["ticks"] == 200
