"""The hosts of examples/ drive emulated drives, notice what goes wrong, and leave them idle."""

import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import can
import pytest
from support.snippets import snippets

from fleetloop.testing import EmulatedPlant

HERE = Path(__file__).resolve().parents[2] / "examples"
WARNINGS = ("-std=c11", "-Wall", "-Wextra", "-Werror")
END_S = 30.0
CALM = ("drive.watchdog_s=1.0",)
"""A busy machine is no reason to disarm."""
pytestmark = pytest.mark.system


@pytest.fixture(scope="module")
def plant() -> Iterator[EmulatedPlant]:
    with (
        pytest.MonkeyPatch.context() as patch,
        TemporaryDirectory(prefix="fl-", dir="/tmp") as folder,
    ):
        patch.setenv("FLEETLOOP_RUNTIME", f"{folder}/r")
        with EmulatedPlant("two_robots_100hz", robots=["r1"], overrides=CALM) as started:
            yield started


def host(plant: EmulatedPlant, *options: str) -> "subprocess.Popen[str]":
    bus = plant.buses["r1"]
    where = ["--interface", bus["interface"], "--channel", bus["channel"]]
    return subprocess.Popen(
        [sys.executable, str(HERE / "host.py"), *where, *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def states(plant: EmulatedPlant) -> dict[int, int]:
    """By node, the state in its next heartbeat."""
    said: dict[int, int] = {}
    with can.Bus(**plant.buses["r1"]) as bus:
        while len(said) < 2:
            message = bus.recv(5.0)
            assert message is not None
            if message.arbitration_id & 0x1F == 0x01:
                said[message.arbitration_id >> 5] = message.data[4]
    return said


def until(process: "subprocess.Popen[str]", word: str) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        if word in line:
            return
    pytest.fail(f"never said {word!r}: {process.stderr.read() if process.stderr else ''}")


def test_it_clears_errors_arms_drives_forward_and_leaves_the_drives_idle(
    plant: EmulatedPlant,
) -> None:
    plant.inject("drive_estop", robots=["r1"])
    before = plant.poses()["r1"]
    out, err = host(plant, "--seconds", "0.3").communicate(timeout=END_S)
    assert err == ""
    lines = out.splitlines()
    assert lines[:2] == [f"node {n}: clearing errors 0x02000000" for n in (0, 1)]
    assert (lines[2], lines[-1]) == ("armed", "idle")
    assert plant.poses()["r1"].y_m > before.y_m + 0.1  # it looks along y
    assert states(plant) == {0: 1, 1: 1}


def test_the_programs_of_its_page_drive_the_robots_that_they_name(fleetloop_plant) -> None:
    plant = fleetloop_plant("two_robots_100hz", overrides=CALM)
    shown = next(one.text for one in snippets("sh") if one.where.startswith("examples/"))
    commands = [
        shlex.split(line, comments=True)[1:] for line in shown.splitlines() if "python" in line
    ]
    before = plant.poses()
    hosts = [
        subprocess.Popen([sys.executable, *command], cwd=HERE, stdout=subprocess.DEVNULL)
        for command in commands
    ]
    assert [one.wait(END_S) for one in hosts] == [0, 0]
    after = plant.poses()
    assert all(after[robot].y_m > before[robot].y_m + 0.1 for robot in ("r1", "r2"))


def test_an_error_of_one_drive_stops_both(plant: EmulatedPlant) -> None:
    process = host(plant, "--seconds", "60")
    until(process, "0.50 s")
    plant.inject("drive_error", robots=["r1"], wheel="left")
    out, err = process.communicate(timeout=END_S)
    assert process.returncode == 1
    assert err.startswith("host.py: node 1: errors 0x")
    assert out.endswith("idle\n")
    assert set(states(plant).values()) == {1}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_the_drives_idle(plant: EmulatedPlant, number: int) -> None:
    process = host(plant, "--seconds", "60")
    until(process, "0.20 s")
    process.send_signal(number)
    out, _ = process.communicate(timeout=END_S)
    assert process.returncode == 128 + number
    assert out.endswith("idle\n")
    assert set(states(plant).values()) == {1}


def test_no_drives_is_said() -> None:
    with can.Bus(interface="virtual", channel="nobody"):
        done = subprocess.run(
            [sys.executable, str(HERE / "host.py"), "--interface", "virtual"],
            capture_output=True,
            text=True,
            timeout=END_S,
        )
    assert done.returncode == 1
    assert done.stderr == (
        "host.py: node 0: no heartbeat, errors 0x0; node 1: no heartbeat, errors 0x0\n"
    )


@pytest.mark.parametrize("options", [("--torque", "nan"), ("--torque", "inf"), ("--seconds", "-5")])
def test_what_is_no_torque_and_no_time_is_refused_before_the_bus_is_opened(
    options: tuple[str, str],
) -> None:
    done = run_alone(*options)
    assert done.returncode == 2
    assert done.stderr.endswith("--torque and --seconds are finite numbers, --seconds 0 or more\n")


def test_a_bus_that_is_not_there_is_named_in_one_line() -> None:
    done = run_alone("--channel", "r9")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith("host.py: ") and "r9" in line


def run_alone(*options: str) -> "subprocess.CompletedProcess[str]":
    """The host without any plant."""
    return subprocess.run(
        [sys.executable, str(HERE / "host.py"), *options],
        capture_output=True,
        text=True,
        timeout=END_S,
    )


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_host_in_c_compiles_without_a_warning_and_says_what_it_needs(tmp_path: Path) -> None:
    program = tmp_path / "host_socketcan"
    made = subprocess.run(
        ["cc", *WARNINGS, "-o", str(program), str(HERE / "host_socketcan.c")],
        capture_output=True,
        text=True,
        timeout=END_S,
    )
    assert (made.returncode, made.stderr) == (0, "")
    done = subprocess.run([str(program)], capture_output=True, text=True, timeout=END_S)
    assert (done.returncode, done.stderr) == (2, "usage: host_socketcan INTERFACE TORQUE_N_M\n")
    done = subprocess.run(
        [str(program), "none0", "0.1"], capture_output=True, text=True, timeout=END_S
    )
    assert done.returncode == 2
    assert done.stderr.startswith("none0: ")
