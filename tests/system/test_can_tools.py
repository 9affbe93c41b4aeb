"""`fleetloop can ...` as an operator uses it, on the buses of a run."""

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest
from support.processes import Run, running

pytestmark = pytest.mark.system

LONG = ("two_robots", "--duration", "60", "--speed", "1")
TOOL = (sys.executable, "-m", "fleetloop", "can")


def tool(*args: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*TOOL, *args], capture_output=True, text=True, timeout=30)


def clients_of_r1() -> int:
    reports = json.loads(tool("list", "--seconds", "0.01", "--json").stdout)
    return int(reports[0]["clients"])


@contextmanager
def started(*args: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [*TOOL, *args], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate(timeout=10)


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Run]:
    with running(tmp_path / "a", *LONG) as run:
        yield run


def test_buses_are_listed_watched_and_fed(run: Run) -> None:
    reports = json.loads(tool("list", "--seconds", "0.5", "--json").stdout)
    assert [report["bus"] for report in reports] == ["r1", "r2"]
    for report in reports:
        assert report["clients"] == 1
        # Two wheels, each torque and encoder at 500 Hz and a heartbeat at 10 Hz; 80 to 125 bits.
        assert report["frames_per_s"] == pytest.approx(2020, rel=0.02)
        assert report["load"] == pytest.approx(0.20, abs=0.02)
        assert [node["state"] for node in report["nodes"]] == ["CLOSED_LOOP_CONTROL"] * 2

    dumped = tool("dump", "r1", "-n", "50").stdout.splitlines()
    assert len(dumped) == 50
    line = re.compile(r"  r1  0[02][9E1]   \[[48]\] ( [0-9A-F]{2}){4,8}")
    assert all(map(line.fullmatch, dumped))

    with started("dump", "-L", "r1,037:7FF", "-n", "2", "-T", "20000") as dump:
        while clients_of_r1() < 2:
            assert dump.poll() is None
        assert tool("send", "r1", "037#R8").returncode == 0
        out, _ = dump.communicate(timeout=20)
    request, answer = out.splitlines()
    assert re.fullmatch(r"\(\d{10}\.\d{6}\) r1 037#R8", request)
    assert re.fullmatch(r"\(\d{10}\.\d{6}\) r1 037#[0-9A-F]{16}", answer)


def test_a_dump_ends_with_its_reader_its_user_and_its_run(run: Run) -> None:
    with started("dump", "any") as dump:
        assert dump.stdout is not None
        assert dump.stdout.readline().startswith("  r")
        dump.stdout.close()
        assert dump.wait(10) == 0
        assert dump.stderr is not None
        assert dump.stderr.read() == ""
    with started("dump", "r1") as dump:
        assert dump.stdout is not None
        dump.stdout.readline()
        dump.send_signal(signal.SIGINT)
        out, err = dump.communicate(timeout=10)
        assert (dump.returncode, err) == (130, "")
        assert out[-1:] in ("", "\n")
    with started("dump", "r1") as dump:
        assert dump.stdout is not None
        dump.stdout.readline()
        run.send(signal.SIGINT)
        _, err = dump.communicate(timeout=20)
        assert dump.returncode == 0
        assert "bus 'r1' closed" in err


def test_a_killed_plant_ends_a_dump_with_3(run: Run) -> None:
    with started("dump", "r1") as dump:
        assert dump.stdout is not None
        dump.stdout.readline()
        run.child("plant").kill()
        _, err = dump.communicate(timeout=20)
        assert dump.returncode == 3
        assert "closed without a word" in err


def test_slcan_software_asks_a_drive_through_the_pseudo_terminal(run: Run, tmp_path: Path) -> None:
    link = tmp_path / "ttyCAN"
    with started("slcan", "r1", "--link", str(link)) as adapter:
        assert adapter.stdout is not None
        assert adapter.stdout.readline() == f"{link}\n"
        with can.Bus(interface="slcan", channel=str(link), sleep_after_open=0.0) as bus:
            bus.send(
                can.Message(arbitration_id=0x017, is_remote_frame=True, dlc=8, is_extended_id=False)
            )
            while (heard := bus.recv(10.0)) is None or heard.arbitration_id != 0x017:
                assert adapter.poll() is None
            assert len(heard.data) == 8
        adapter.send_signal(signal.SIGTERM)
        _, err = adapter.communicate(timeout=10)
        assert adapter.returncode == 130
        assert "1 from it" in err
    assert not link.is_symlink()
