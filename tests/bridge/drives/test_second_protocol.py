"""A second drive protocol is a folder and a row: the one of `support.second_drive` runs a robot."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest
from support.second_drive.tools import PlainSection

from bridge.drives import protocol
from bridge.frame import Frame
from bridge.process.lifecycle import Stop
from configs.connections import NetworkLink
from configs.drives import DRIVES
from configs.errors import ScenarioError
from configs.loading import load, loads, to_toml
from configs.plugins import Kind, find
from configs.resolve import agent_brief, leader_brief, plant_brief, robot_briefs
from configs.signals import PLANT_SIGNALS
from fleetloop.can.census import Census, Node
from fleetloop.check.bus_load import bus_messages
from fleetloop.in_process.run import InProcessRun
from fleetloop.torque_limits import limits

OWN = "support.second_drive:ROW"
NETWORK = NetworkLink("t", "", "", "")


class Rows:
    """The plant's rows of one robot."""

    def __init__(self) -> None:
        self.last = b""

    def add(self, robot: str, source: str, _first_tick: int, rows: bytes) -> None:
        if (robot, source) == ("r1", "plant"):
            self.last = rows

    def end(self, robot: str, source: str) -> None:
        pass

    def traffic(self, bus: str, frames: bytes) -> None:
        pass


@pytest.mark.parametrize("timing", ["ideal", "wire"])
@pytest.mark.parametrize("name", [OWN, "plain"])
def test_a_scenario_runs_with_a_protocol_of_ones_own(monkeypatch, timing: str, name: str) -> None:
    monkeypatch.setitem(DRIVES, "plain", OWN)
    scenario = load(
        "two_robots_100hz",
        (
            f"drive.protocol='{name}'",
            "drive.torque_unit_shaft_N_m=0.0001",
            "mounting={left_sign=-1, gear_ratio=9.0}",
            f"bus.timing='{timing}'",
            "drive.preset='ideal'",
            "until_s=3.0",
            "clock.mode='lockstep'",
        ),
    )
    rows = Rows()
    run = InProcessRun(
        plant_brief(scenario, network=NETWORK),
        [agent_brief(scenario, robot, network=NETWORK, bus=()) for robot in scenario.names],
        leader_brief(scenario),
        rows,
        lambda _: None,
    )
    run.run(Stop())
    assert run.stopped_robots == {}
    memory = memoryview(rows.last).cast("d")
    names = [signal.name for signal in PLANT_SIGNALS]
    last = dict(zip(names, memory[-len(names) :], strict=True))
    assert last["v_m_s"] > 0.1
    frames = 2 * 100 * 4 * 0.9  # of each bus in two seconds: two encoders, two set-points
    assert min(run.frames.values()) > frames


def test_its_section_is_checked_where_it_stands() -> None:
    own = f"drive.protocol='{OWN}'"
    with pytest.raises(ScenarioError, match=r"drive\.torque_unit_shaft_N_m=-1.0: .*greater than 0"):
        load("two_robots", (own, "drive.torque_unit_shaft_N_m=-1.0"))
    with pytest.raises(ScenarioError, match=r"drive\.right_node=63: must be 62 or less"):
        load("two_robots", (own, "drive.right_node=63"))
    with pytest.raises(ScenarioError, match=r"drive\.unit.*unknown key"):
        load("two_robots", ("drive.unit=1.0",))


def test_keys_of_another_protocol_are_told_as_such() -> None:
    words = (
        rf"drive\.watchdog_s=0\.2: unknown key: {OWN} doesn't have this key of odrive; delete it"
    )
    with pytest.raises(ScenarioError, match=words):
        load("two_robots", (f"drive.protocol='{OWN}'", "drive.watchdog_s=0.2"))
    with pytest.raises(ScenarioError, match=r"drive\.torque_unit_shaft_N_m=1\.0: unknown key"):
        load("two_robots", ("drive.torque_unit_shaft_N_m=1.0",))


def test_relations_of_its_keys_are_its_own() -> None:
    """A heartbeat is ODrive's: the countdown that it asks for is not asked of others."""
    short = ("host.heartbeat_age_limit_s=0.001", "clock.countdown_s=0.0")
    with pytest.raises(ScenarioError) as refused:
        load("two_robots", short)
    assert "two of drive.heartbeat_period_s need" in str(refused.value)
    assert "host.heartbeat_age_limit_s=0.001: two of drive.heartbeat_period_s" in str(refused.value)
    assert load("two_robots", (f"drive.protocol='{OWN}'", *short)).clock.countdown_s == 0.0


def test_processes_receive_its_section_without_having_its_module_on_their_path(
    tmp_path: Path,
) -> None:
    """A brief says where the file is, and is unpickled once the file is loaded."""
    (tmp_path / "own_drive.py").write_text(
        "from dataclasses import dataclass\n"
        "from support.second_drive import ROW as PLAIN\n"
        "@dataclass(frozen=True, slots=True, kw_only=True)\n"
        "class Section(PLAIN.section):\n"
        "    gain: float = 1.0\n"
        "ROW = PLAIN._replace(section=Section)\n"
    )
    text = to_toml(load("two_robots", (f"drive.protocol='{OWN}'",))).replace(OWN, "own_drive:ROW")
    (tmp_path / "s.toml").write_text(text)
    scenario = load(tmp_path / "s.toml", ("drive.gain=2.5",))
    sent = pickle.dumps(agent_brief(scenario, "r1", network=NETWORK, bus=()))
    program = "import pickle, sys; print(pickle.load(sys.stdin.buffer).drives.section.gain)"
    path = os.pathsep.join(entry for entry in sys.path if entry != str(tmp_path))
    done = subprocess.run(
        [sys.executable, "-c", program],
        input=sent,
        capture_output=True,
        timeout=30,
        env=os.environ | {"PYTHONPATH": path},
    )
    assert done.stdout == b"2.5\n", done.stderr.decode()


def test_a_check_of_its_keys_that_fails_is_told_with_its_place(tmp_path: Path) -> None:
    (tmp_path / "failing.py").write_text(
        "from dataclasses import dataclass\n"
        "from support.second_drive import ROW as PLAIN\n"
        "@dataclass(frozen=True, slots=True, kw_only=True)\n"
        "class Section(PLAIN.section):\n"
        "    def problems(self, clock, host):\n"
        "        yield 1 / 0\n"
        "ROW = PLAIN._replace(section=Section)\n"
    )
    scenario = to_toml(load("two_robots", (f"drive.protocol='{OWN}'",)))
    (tmp_path / "s.toml").write_text(scenario.replace(OWN, "failing:ROW"))
    with pytest.raises(
        ScenarioError, match=r"drive\.protocol = .*its check: .*failing\.py, line 6"
    ):
        load(tmp_path / "s.toml")


def test_an_unknown_protocol_is_one_complaint() -> None:
    """Nothing is said of its keys, nor of ODrive's in their place."""
    with pytest.raises(ScenarioError) as refused:
        load("two_robots", ("drive.protocol='odriv'", "clock.countdown_s=0.0"))
    (complaint,) = refused.value.complaints
    assert (complaint.where, complaint.key) == ("--set drive.protocol='odriv'", "")
    assert "did you mean odrive?" in complaint.remedy


def test_a_record_of_it_is_read_without_it() -> None:
    written = to_toml(load("two_robots", (f"drive.protocol='{OWN}'", "drive.right_node=7")))
    elsewhere = written.replace("support.second_drive", "not_here")
    with pytest.raises(ScenarioError, match="no module not_here is installed"):
        loads("a record", elsewhere)
    read = loads("a record", elsewhere, recorded=True)
    assert read.drive.right_node == 7
    assert to_toml(read) == elsewhere


def test_limits_of_an_odrive_are_not_checked_of_it() -> None:
    scenario = load("two_robots", (f"drive.protocol='{OWN}'", "drive.preset='realistic'"))
    assert [limit.key for limit in limits(scenario, scenario.robot[0])] == [
        "drive.current_limit_A",
        "supply.voltage_V",
    ]
    assert scenario.drive.derating() is None


def test_an_unknown_key_of_it_is_told_with_the_known_ones() -> None:
    known = r"did you mean torque_unit_shaft_N_m\? \(known here: .*right_node, torque_constant"
    with pytest.raises(ScenarioError, match=rf"drive\.torque_unit.*unknown key; {known}"):
        load("two_robots", (f"drive.protocol='{OWN}'", "drive.torque_unit_N_m=1.0"))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("canopen", "known: odrive"),
        ("canopen", 'one of your own is "module:ROW"'),
        ("nowhere_at_all:ROW", "no module nowhere_at_all is installed"),
        ("support.second_drive:NOTHING", "has no NOTHING; it has ROW"),
        ("support.second_drive:PlainClient", "PlainClient is no drive protocol: it has no client"),
    ],
)
def test_a_protocol_that_does_not_exist_is_named(name: str, words: str) -> None:
    with pytest.raises(ScenarioError, match=r"drive\.protocol") as refused:
        load("two_robots", (f"drive.protocol='{name}'",))
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = 1\ndef broken(:\n", "line 2: invalid syntax"),
        ("x = 1\n\nROW = 1 / 0\n", "line 3: ZeroDivisionError: division by zero"),
        ("import nowhere_at_all\n", "line 1: ModuleNotFoundError: No module named"),
    ],
)
def test_the_place_where_its_module_fails_is_said(
    monkeypatch, tmp_path, text: str, words: str
) -> None:
    file = tmp_path / "failing_drive.py"
    file.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ScenarioError, match=r"drive\.protocol") as refused:
        load("two_robots", ("drive.protocol='failing_drive:ROW'",))
    assert f"{file}, {words}" in str(refused.value)


def test_its_section_load_and_decoder_hang_on_the_row(monkeypatch) -> None:
    scenario = load("two_robots", (f"drive.protocol='{OWN}'",))
    robot = robot_briefs(scenario)[0]
    assert robot.drive.section == PlainSection()
    messages = bus_messages([robot], 1_000_000)
    assert sorted(message.can_id for message in messages) == [0x100, 0x101, 0x200, 0x201]
    monkeypatch.setitem(DRIVES, "plain", OWN)
    plain, own = (find(Kind.DRIVE, name, "", DRIVES) for name in ("plain", OWN))
    assert protocol(plain) is protocol(own)
    assert protocol(own).words(Frame(0x105, bytes(8))) == "plain node 5"
    census = Census(1_000_000, protocol(own))
    census.count(Frame(0x105, bytes(8)), 0)
    assert census.nodes == [Node(5, "ON", "")]
