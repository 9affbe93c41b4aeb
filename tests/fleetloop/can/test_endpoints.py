"""`fleetloop can endpoints`: the table of a firmware, or of the drives on a bus that is up."""

import json
from pathlib import Path

import pytest

from bridge.can_bus.interface import FleetloopBus
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.frames import Command
from bridge.frame import Frame
from configs.errors import InfrastructureError, ScenarioError
from fleetloop.can.endpoints import ask, endpoint_file, write_endpoints

HEARTBEAT = f.HEARTBEAT.pack(0, 1, 0, 0, 0)


def test_a_firmware_is_chosen_by_name_and_one_that_no_drive_has_is_refused(capsys) -> None:
    assert write_endpoints(None, "0.6.11", None) == 0
    table = json.loads(capsys.readouterr().out)
    assert (table["fw_version"], table["hw_version"]) == ("0.6.11", "4.4.58")
    with pytest.raises(ScenarioError, match=r"--fw-version 0\.5\.6: right is 0\.6 and a revision"):
        write_endpoints(None, "0.5.6", None)
    with pytest.raises(ScenarioError, match="says itself which firmware it has"):
        write_endpoints("r1", "0.6.11", None)


def test_without_a_word_it_is_the_firmware_that_drives_have_by_default(tmp_path: Path) -> None:
    out = tmp_path / "flat_endpoints.json"
    assert write_endpoints(None, None, out) == 0
    assert json.loads(out.read_text())["fw_version"] == "0.6.10"
    with pytest.raises(ScenarioError, match=r"--out .*No such file or directory"):
        write_endpoints(None, None, tmp_path / "nowhere" / "x.json")


def test_a_protocol_without_endpoints_is_refused_by_name(capsys) -> None:
    name = "support.second_drive:ROW"
    with pytest.raises(ScenarioError, match=f"--protocol {name}: its drives have no file of end"):
        write_endpoints(None, None, None, name)
    assert capsys.readouterr().out == ""


def test_a_drive_on_the_bus_is_asked_for_its_versions(buses, in_background) -> None:
    found = []

    def asking() -> None:
        with FleetloopBus("r1") as bus:
            found.append(ask(bus, "r1", 10.0, endpoint_file()))

    in_background(asking)
    buses.await_clients(1)
    request = f.request(5, Command.GET_VERSION)
    version = f.VERSION.pack(2, 4, 4, 58, 0, 6, 11, 0)
    buses.deliver(Frame(0x0A5, b"12345678"), Frame(f.identifier(5, Command.HEARTBEAT), HEARTBEAT))
    assert buses.taken(1) == [request]
    buses.deliver(Frame(request.can_id & 0x7FF, b""), Frame(request.can_id & 0x7FF, version))
    assert buses.until(lambda: bool(found))
    assert found == [((0, 6, 11), (4, 4, 58))]


def test_a_bus_without_drives_is_named(buses) -> None:
    with (
        FleetloopBus("r1") as bus,
        pytest.raises(InfrastructureError, match=r"no drive.s heartbeat within 0\.05 s"),
    ):
        ask(bus, "r1", 0.05, endpoint_file())
