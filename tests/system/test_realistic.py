"""Real drives and buses: the formation holds, processes and reference agree, buses are recorded."""

import json
from contextlib import ExitStack
from pathlib import Path

import can
import cantools
import pytest
from support.processes import completed, running

from bridge.can_bus import sockets
from fleetloop.results.diff import print_comparison

pytestmark = pytest.mark.system


def test_the_formation_tracks_within_20_mm_with_real_drives_and_buses(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    status, out = completed(folder, "realistic", "--in-process")
    assert status == 0, out  # its expectations say it
    summary = json.loads((folder / "summary.json").read_text())
    worst = {e["signal"]: abs(e["value"]) for e in summary["expectations"]}
    assert max(worst["x_e_m"], worst["y_e_m"]) < 0.02
    assert max(worst["motor_right_wheel_N_m"], worst["motor_left_wheel_N_m"]) < 0.5


def test_processes_leave_the_same_record_as_the_reference_with_all_of_it_on(
    tmp_path: Path, capsys
) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    args = ("realistic", "--duration", "3", "--set", "expect=[]", "--set", 'bus.record=["log"]')
    assert completed(a, *args)[0] == 0
    assert completed(b, *args, "--in-process")[0] == 0
    assert print_comparison(a, b, as_json=False) == 0
    for bus in ("r1", "r2", "r3", "r4"):
        assert (a / "can" / f"{bus}.log").read_bytes() == (b / "can" / f"{bus}.log").read_bytes()


def test_listeners_change_nothing_and_a_self_declared_synchronous_client_is_refused(
    tmp_path: Path, capsys
) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    args = ("realistic", "--duration", "4", "--set", "expect=[]")
    heard = 0
    with running(a, *args, "--speed", "2", bus_time_s=0.1) as run, ExitStack() as listeners:
        path = next(sockets.base_folder().glob("*/r1.can"))
        for options in ({}, {"batched": True}, {"receive_own_messages": True}):
            listener = can.Bus(interface="fleetloop", channel=str(path), **options)
            listeners.enter_context(listener)
        with pytest.raises(can.CanInitializationError, match="controllers that the run started"):
            can.Bus(interface="fleetloop", channel=str(path), synchronous="r1")
        with pytest.raises(can.CanOperationError, match="end of the run"):
            while listener.recv(10.0) is not None:
                heard += 1
        status, out = run.end()
    assert status == 0, out
    assert heard > 1000
    assert completed(b, *args, "--in-process")[0] == 0
    assert print_comparison(a, b, as_json=False) == 0
    assert "identical: 800 ticks of 4 robots" in capsys.readouterr().out


def test_every_bus_is_recorded_and_each_frame_is_one_of_the_vendors_dbc(tmp_path: Path) -> None:
    from importlib import resources

    assert completed(tmp_path / "run", "two_robots", "--in-process")[0] == 0
    text = resources.files("odrive_can").joinpath("dbc/odrive-cansimple-0.6.10.dbc").read_text()
    dbc = cantools.database.load_string(text, "dbc")
    names = set()
    with can.LogReader(tmp_path / "run" / "can" / "r2.blf") as reader:
        for message in reader:
            known = dbc.get_message_by_frame_id(message.arbitration_id)
            known.decode(message.data, decode_choices=False, allow_truncated=True)
            names.add(known.name.partition("_")[2])
    assert {"Heartbeat", "Get_Encoder_Estimates", "Set_Input_Torque", "Set_Axis_State"} <= names


def test_seven_robots_share_a_bus_at_200_hz_and_twenty_are_refused(tmp_path: Path) -> None:
    def scenario(n: int) -> str:
        lines = ["schema = 1", f'name = "shared_{n}"', "duration_s = 1.0", "[clock]"]
        lines += ["control_period_s = 0.005", "countdown_s = 0.5", "share_period_s = 0.02"]
        lines += ["[bus]", 'timing = "wire"', "[control]", 'law = "adaptive_dsc_robust"']
        lines += ["k4 = 0.36", *(f"gamma_{k}_s = 0.02" for k in (1, 2, 3))]
        for k in range(n):
            lines += ["[[robot]]", f'name = "r{k + 1}"', 'bus = "fleet"']
            lines += [f"pose = {{ x_m = -3.5, y_m = {1.0 + k} }}"]
            lines += [f'offset = {{ kind = "world", y_m = {float(k)} }}']
        path = tmp_path / f"shared_{n}.toml"
        path.write_text("\n".join(lines) + "\n")
        return str(path)

    assert completed(tmp_path / "a", scenario(7))[0] == 0
    assert completed(tmp_path / "b", scenario(7), "--in-process")[0] == 0
    assert print_comparison(tmp_path / "a", tmp_path / "b", as_json=False) == 0

    from typer.testing import CliRunner

    from fleetloop.cli import app

    runner = CliRunner(env={"COLUMNS": "200"})
    assert runner.invoke(app, ["check", scenario(7)]).exit_code == 0
    refused = runner.invoke(app, ["check", scenario(20)])
    assert refused.exit_code == 1
    assert "161.9% mean" in refused.output
    assert "189.4% worst" in refused.output
