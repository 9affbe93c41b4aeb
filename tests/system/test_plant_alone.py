"""`fleetloop plant` and its pytest fixture, driven by clients that we did not write."""

import asyncio
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import psutil
import pytest
from odrive_can import CanMsg, ODriveCAN
from odrive_can.odrive import DriveError
from support.own_files import write_own_at_100_hz

from fleetloop.testing import EmulatedPlant, PlantError

pytestmark = pytest.mark.system
PLANT = (sys.executable, "-m", "fleetloop", "plant")
PERIOD_S = 0.002
"""Of the scenario two_robots."""


async def until(holds: Callable[[], bool], act: Callable[[], None] = lambda: None) -> None:
    """Act every 20 ms until something holds; at most 10 s."""
    async with asyncio.timeout(10.0):
        while not holds():
            act()
            await asyncio.sleep(0.02)


def test_an_independent_odrive_client_drives_an_axis_unchanged(fleetloop_plant) -> None:
    plant = fleetloop_plant("two_robots", robots=["r1"], overrides=["robot.r1.v_m_s=0.0"])
    asyncio.run(drive_left_wheel(plant))


async def drive_left_wheel(plant: EmulatedPlant) -> None:
    """Discover, arm, torque, feedback, emergency stop, clear: node 1 is the left wheel."""
    feedback: list[CanMsg] = []
    with can.Bus(**plant.buses["r1"]) as bus:
        axis = ODriveCAN(axis_id=1, can_bus=bus)
        axis.feedback_callback = lambda message, _: feedback.append(message)
        async with asyncio.timeout(10.0):
            await axis.start()
        try:
            axis.check_alive()
            axis.check_errors()
            assert axis.axis_state == "IDLE"
            axis.clear_errors()
            axis.set_controller_mode("TORQUE_CONTROL", "PASSTHROUGH")
            axis.set_axis_state_no_wait("CLOSED_LOOP_CONTROL")
            push = lambda: axis.set_input_torque(0.1)  # noqa: E731 - it feeds the watchdog
            await until(lambda: axis.axis_state == "CLOSED_LOOP_CONTROL", push)
            before = plant.poses()["r1"]
            await until(lambda: plant.poses()["r1"].theta_rad < before.theta_rad - 0.1, push)
            pushed = plant.poses()["r1"]
            assert pushed.torque_left_wheel_N_m == pytest.approx(0.1)
            assert pushed.torque_right_wheel_N_m == 0.0
            assert feedback[-1].data["Vel_Estimate"] > 0.0
            assert feedback[-1].data["Pos_Estimate"] > feedback[0].data["Pos_Estimate"]
            axis._send_message("Estop")
            await until(lambda: axis.axis_state == "IDLE", push)
            with pytest.raises(DriveError, match="ESTOP_REQUESTED"):
                axis.check_errors()
            assert plant.poses()["r1"].torque_left_wheel_N_m == 0.0
            axis.clear_errors()
            await axis.wait_for_heartbeat()
            await axis.wait_for_heartbeat()
            axis.check_errors()
        finally:
            axis.stop()


def test_the_fixture_takes_a_scenario_with_a_law_of_the_users_own(
    fleetloop_plant, tmp_path: Path
) -> None:
    scenario = write_own_at_100_hz(tmp_path)
    plant = fleetloop_plant(scenario, robots=["r1"], overrides=["control.k_x_1_s=3.0"])
    assert plant.poses()["r1"].x_m == pytest.approx(3.02)
    with pytest.raises(PlantError, match=r"control\.k_x_1_s=-3\.0: must be greater than 0"):
        fleetloop_plant(scenario, overrides=["control.k_x_1_s=-3.0"])


def test_a_client_that_falls_silent_is_disarmed_by_the_watchdog(fleetloop_plant) -> None:
    plant = fleetloop_plant("two_robots", robots=["r1"], overrides=["drive.watchdog_s=0.2"])
    with can.Bus(**plant.buses["r1"]) as bus:
        send(bus, 0x007, bytes([8, 0, 0, 0]))
        send(bus, 0x00E, bytes.fromhex("cdcccc3d"))  # 0.1 N·m
        await_state(bus, 8)
        idle = await_state(bus, 1)
        # Bodies were last moved before that tick's heartbeat, under the torque until then.
        assert any(m.timestamp > idle.timestamp for m in heard(bus, 1.0))
    assert plant.poses()["r1"].torque_right_wheel_N_m == 0.0


def test_an_absurd_set_point_ends_the_motion_of_its_robot_alone() -> None:
    with EmulatedPlant("two_robots", overrides=["drive.watchdog_s=0.0"]) as plant:
        with can.Bus(**plant.buses["r1"]) as one, can.Bus(**plant.buses["r2"]) as other:
            send(one, 0x007, bytes([8, 0, 0, 0]))
            send(one, 0x00E, bytes.fromhex("ffff7f7f"))
            beats = (m.data[:5] for m in heard(one, 20.0) if m.arbitration_id == 0x001)
            assert bytes([8, 0, 0, 0, 1]) in beats  # MISSING_ESTIMATE, idle
            assert sum(1 for _ in heard(other, 0.2)) > 10
        assert plant.poses()["r1"].v_m_s == 0.0
        said = plant.stop()
    assert "STOPPED r1: tick " in said
    assert "under wheel torques of 3.4e+38 and 0 N·m" in said
    assert "r2" not in said.replace("frames: r1", "")


def send(bus: can.BusABC, identifier: int, data: bytes) -> None:
    """Send a data frame."""
    bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))


def await_state(bus: can.BusABC, state: int) -> can.Message:
    """The first heartbeat of the right drive with this state; at most 20 s of bus time."""
    beats = (m for m in heard(bus, 20.0) if m.arbitration_id == 0x001)
    beat = next((m for m in beats if m.data[4] == state), None)
    assert beat is not None
    return beat


def heard(bus: can.BusABC, seconds: float) -> Iterator[can.Message]:
    """What comes within so many seconds of bus time."""
    first = message = bus.recv(5.0)
    while message is not None and message.timestamp <= first.timestamp + seconds:
        yield message
        message = bus.recv(5.0)


def test_it_starts_without_the_libraries_of_runs_and_their_records() -> None:
    python, *plant = PLANT
    done = subprocess.run(
        [python, "-X", "importtime", *plant, "two_robots", "--duration", "0.1"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    modules = (line.rpartition("|")[2].strip() for line in done.stderr.splitlines())
    loaded = {module.partition(".")[0] for module in modules}
    assert "plant" in loaded
    assert not loaded & {"matplotlib", "mcap", "zstandard"}


def test_only_the_named_robots_have_a_bus(fleetloop_plant) -> None:
    assert set(fleetloop_plant("two_robots").buses) == {"r1", "r2"}
    assert set(fleetloop_plant("two_robots", robots=["r2"]).buses) == {"r2"}


def test_what_it_can_not_start_is_told_in_its_own_words() -> None:
    with pytest.raises(PlantError, match="--robots r9: not emulated here; known: r1, r2"):
        EmulatedPlant("two_robots", robots=["r9"])
    with pytest.raises(PlantError, match="no shipped scenario of that name"):
        EmulatedPlant("nowhere")


def test_it_ends_with_the_test_and_leaves_nothing_behind(runtime_folder: Path) -> None:
    with EmulatedPlant("two_robots") as plant:
        assert runtime_folder.exists()
        process = psutil.Process(plant._process.pid)
    assert not process.is_running()
    assert not runtime_folder.exists()
    with pytest.raises(PlantError, match="the plant has ended"):
        plant.poses()
    assert plant.stop() == ""


def test_it_ends_when_the_process_that_started_it_is_killed(runtime_folder: Path) -> None:
    script = (
        "import sys; from fleetloop.testing import EmulatedPlant\n"
        "plant = EmulatedPlant('two_robots'); print(plant._process.pid, flush=True)\n"
        "sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as owner:
        plant = psutil.Process(int(owner.stdout.readline()))
        owner.kill()
    plant.wait(60.0)
    assert not runtime_folder.exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_well_and_it_says_what_crossed_its_buses(
    number: signal.Signals, runtime_folder: Path
) -> None:
    with subprocess.Popen(
        [*PLANT, "two_robots"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        lines = [process.stdout.readline(), process.stdout.readline()]
        channel = lines[0].split("channel=")[1].split()[0]
        with can.Bus(interface="fleetloop", channel=channel) as bus:
            assert bus.recv(5.0).arbitration_id in (0x001, 0x009, 0x021, 0x029)
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 0
    assert "frames: r1 " in said
    assert "right node 0, left node 1" in lines[1]
    assert not runtime_folder.exists()


def test_a_duration_ends_it_and_json_is_what_can_bus_takes() -> None:
    done = subprocess.run(
        [*PLANT, "two_robots", "--duration", "0.2", "--json"],
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.splitlines()
    buses = json.loads(line)["buses"]
    assert buses["r1"]["interface"] == "fleetloop"
    assert os.path.basename(buses["r1"]["channel"]) == "r1.can"  # noqa: PTH119 - gone by now


def test_an_unknown_request_is_answered_with_those_that_are_known(fleetloop_plant) -> None:
    with pytest.raises(PlantError, match="'dance': no such request; known: poses, inject, clear"):
        fleetloop_plant("two_robots")._ask("dance")


def test_bus_time_keeps_the_wall_clocks_pace(fleetloop_plant) -> None:
    plant = fleetloop_plant("two_robots")

    def reading() -> tuple[float, float, float]:
        """Bus time between two instants of the wall clock."""
        earliest_s = time.monotonic()
        bus_s = plant.time_s()
        return earliest_s, bus_s, time.monotonic()

    with can.Bus(**plant.buses["r1"]) as bus:
        before = reading()
        assert sum(1 for _ in heard(bus, 1.0)) > 10
        after = reading()
    passed_s = after[1] - before[1]
    assert passed_s <= after[2] - before[0] + PERIOD_S
    assert passed_s > 0.5 * (after[0] - before[2])


def test_a_fault_is_injected_and_cleared_and_refused_with_the_reason(fleetloop_plant) -> None:
    plant = fleetloop_plant("two_robots", robots=["r1"], overrides=["robot.r1.v_m_s=0.0"])
    name = plant.inject("push", force_body_N=50.0)
    deadline = time.monotonic() + 10.0
    while plant.poses()["r1"].v_m_s < 0.1:
        assert time.monotonic() < deadline
    plant.clear(name)
    for words, said in (
        (("pusch",), "did you mean push"),
        (("push", "r2"), "r2: nothing here that it can act on"),
        (("link_loss",), "a plant on its own has no controllers"),
    ):
        kind, *robots = words
        with pytest.raises(PlantError, match=said):
            plant.inject(kind, **({"robots": robots} if robots else {}))
    with pytest.raises(PlantError, match="nobody: no fault to clear; there are: push"):
        plant.clear("nobody")
