"""Programs that know nothing of Fleetloop but the name of a bus."""

import subprocess
import sys
from importlib import resources
from pathlib import Path

import can
import cantools
import pytest
from support.processes import running

pytestmark = pytest.mark.system

LONG = ("paper", "--duration", "60", "--speed", "1")
SHORT = ("paper", "--duration", "3", "--allow-unchecked", "--speed", "1")


def test_a_python_can_program_sees_well_formed_cansimple_traffic_and_gets_answers(
    tmp_path: Path,
) -> None:
    text = resources.files("odrive_can").joinpath("dbc/odrive-cansimple-0.6.10.dbc").read_text()
    dbc = cantools.database.load_string(text, "dbc")
    with running(tmp_path / "a", *LONG) as run:
        with can.Bus(interface="fleetloop", channel="r1") as bus:
            messages = [bus.recv(5.0) for _ in range(1500)]
            bus.send(
                can.Message(arbitration_id=0x017, is_remote_frame=True, dlc=8, is_extended_id=False)
            )
            answer = next(m for m in bus if m.arbitration_id == 0x017)
        assert run.launcher.is_running()
    names = set()
    for message in messages:
        found = dbc.get_message_by_frame_id(message.arbitration_id)
        found.decode(message.data, decode_choices=False, allow_truncated=True)
        names.add(found.name)
    assert names == {
        f"Axis{n}_{what}"
        for n in (0, 1)
        for what in ("Heartbeat", "Get_Encoder_Estimates", "Set_Input_Torque")
    }
    times = [message.timestamp for message in messages]
    assert times == sorted(times)
    assert dbc.get_message_by_frame_id(0x017).decode(answer.data)["Bus_Voltage"] == 24.0


def test_requests_of_a_stranger_do_not_change_the_run(tmp_path: Path) -> None:
    from support.processes import completed

    from fleetloop.results.diff import print_comparison

    with running(tmp_path / "a", *SHORT, bus_time_s=0.3) as run:
        with can.Bus(interface="fleetloop", channel="r1") as bus:
            ask = can.Message(
                arbitration_id=0x014, is_remote_frame=True, dlc=8, is_extended_id=False
            )
            for _ in range(100):
                bus.send(ask)
            answers = 0
            while answers < 100:
                message = bus.recv(5.0)
                assert message is not None
                answers += message.arbitration_id == 0x014
        status, out = run.end()
        assert status == 0, out
    completed(tmp_path / "b", "paper", "--duration", "3", "--in-process")
    assert print_comparison(tmp_path / "a", tmp_path / "b", as_json=False) == 0


def test_the_stock_logger_writes_a_log_that_the_stock_reader_reads(tmp_path: Path) -> None:
    log = tmp_path / "r2.asc"
    with running(tmp_path / "a", *SHORT, bus_time_s=0.3) as run:
        command = [sys.executable, "-m", "can.logger", "-i", "fleetloop", "-c", "r2", "-f", log]
        # It ends with its bus, at the end of the run.
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
        assert run.end()[0] == 0
    assert "Connected to FleetloopBus" in done.stdout
    assert "end of the run" in done.stderr
    with can.LogReader(log) as reader:
        identifiers = [message.arbitration_id for message in reader]
    assert {0x009, 0x029, 0x00E, 0x02E} <= set(identifiers)
    assert len(identifiers) > 500
