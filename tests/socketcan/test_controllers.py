"""A robot over two CAN controllers with a mainline driver: the plant on can0, its host on can1."""

import json
import subprocess
from pathlib import Path

import pytest
from socketcan.deployments import on_socketcan
from support.processes import Run

from fleetloop.record.reader import Record

pytestmark = [pytest.mark.system, pytest.mark.timeout(280)]
SCENARIO = Path(__file__).with_name("one_robot.toml")


def statistics(channel: str) -> dict:
    """What the driver has counted on an interface."""
    command = ["ip", "-s", "-j", "link", "show", channel]
    done = subprocess.run(command, check=True, capture_output=True, timeout=30)
    counted: dict = json.loads(done.stdout)[0]["stats64"]
    return counted


def test_one_robot_drives_over_two_controllers_and_their_driver(need, tmp_path) -> None:
    need("can0", "can1")
    before = {channel: statistics(channel) for channel in ("can0", "can1")}
    deployment = on_socketcan(tmp_path, {"r1": "can0 can1"})
    dump = ["candump", "-L", "-n", "300", "can1"]
    with subprocess.Popen(dump, stdout=subprocess.PIPE, text=True) as witness:
        process = Run(tmp_path / "run", str(SCENARIO), "--deployment", str(deployment))
        try:
            status, out = process.end(within_s=200.0)
            seen, _ = witness.communicate(timeout=30)
        finally:
            witness.kill()
            process.kill()
    assert status == 0, out
    summary = process.summary()
    assert summary["stopped_robots"] == summary["bus_troubles"] == {}
    rows = Record.open(tmp_path / "run" / "record.mcap").plant["r1"]
    assert rows["tick"].tolist() == list(range(200))
    assert rows["x_m"][-1] > 1.0
    identifiers = {line.split()[2].partition("#")[0] for line in seen.splitlines()}
    assert identifiers >= {"001", "009", "00E", "021", "029", "02E", "007", "027"}
    crossed = summary["frames_per_bus"]["r1"]
    sent = {
        channel: statistics(channel)["tx"]["packets"] - before[channel]["tx"]["packets"]
        for channel in before
    }
    received = {
        channel: statistics(channel)["rx"]["packets"] - before[channel]["rx"]["packets"]
        for channel in before
    }
    assert crossed > 4 * 190
    assert sent["can0"] == received["can1"]
    assert sent["can1"] == received["can0"]
    assert sum(sent.values()) == pytest.approx(crossed, abs=20)
