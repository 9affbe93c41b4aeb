"""Deployment files: what they say, and what is said of a wrong one."""

from pathlib import Path

import pytest

from configs.deployment import Deployment, check_deployment, load_deployment
from configs.errors import ScenarioError
from configs.loading import load
from configs.users import passwords

VCAN = {"interface": "socketcan", "channel": "vcan0"}
NETWORK = {"endpoint": "tcp/10.0.0.1:7447"}


def check(scenario: str = "two_robots_100hz", **data) -> Deployment:
    return check_deployment("where.toml", data, load(scenario), Path("/etc/fleet"))


def complaint(scenario: str = "two_robots_100hz", **data) -> str:
    with pytest.raises(ScenarioError) as caught:
        check(scenario, **data)
    return str(caught.value)


def test_without_a_file_everything_is_here_and_on_our_buses() -> None:
    nothing = check()
    assert nothing == Deployment()
    assert nothing.elsewhere(load("paper")) == ()
    assert nothing.is_ours("r1")
    assert nothing.emulates("r1")
    assert nothing.bus_of("r1") == (("channel", "r1"), ("interface", "fleetloop"))


def test_bus_settings_are_handed_on_as_they_are() -> None:
    bus = {**VCAN, "receive_own_messages": False, "bitrate": 500000, "x": 0.5}
    placed = check(robot={"r1": {"bus": bus}})
    assert placed.bus_of("r1") == tuple(sorted(bus.items()))
    assert not placed.is_ours("r1")


def test_on_another_interface_real_drives_are_expected_unless_it_says_emulated() -> None:
    assert not check(robot={"r1": {"bus": VCAN}}).emulates("r1")
    assert check(robot={"r1": {"bus": VCAN, "emulated": True}}).emulates("r1")


def test_the_plant_may_have_an_interface_of_its_own_to_the_same_bus() -> None:
    plant_bus = {"interface": "socketcan", "channel": "can0"}
    placed = check(robot={"r1": {"bus": VCAN, "plant_bus": plant_bus}})
    assert placed.emulates("r1")
    assert placed.bus_of("r1") == tuple(sorted(VCAN.items()))
    assert placed.plant_bus_of("r1") == tuple(sorted(plant_bus.items()))


@pytest.mark.parametrize(
    ("kind", "emulated", "problem"),
    [
        ("push", False, "isn't emulated: push can't act on it"),
        ("can_drop", False, "isn't emulated: can_drop can't act on it"),
        ("can_corrupt", True, "the timing of its bus isn't emulated: can_corrupt can't act on it"),
        ("node_babbling", True, "node_babbling can't act on it"),
        ("can_drop", True, None),
        ("bus_cut", True, None),
        ("localisation_outage", False, None),
    ],
)
def test_a_fault_that_cannot_act_where_a_robot_is_placed_is_refused(
    kind: str, emulated: bool, problem: str | None
) -> None:
    faults = (f'fault=[{{kind="{kind}", at_s=1.0}}]', 'bus.timing="wire"', 'clock.mode="realtime"')
    data = {"robot": {"r1": {"bus": VCAN, "emulated": emulated}}}
    scenario = load("two_robots_100hz", faults)
    if problem is None:
        check_deployment("where.toml", data, scenario, Path())
        return
    with pytest.raises(ScenarioError) as caught:
        check_deployment("where.toml", data, scenario, Path())
    (line,) = str(caught.value).splitlines()
    assert "robot.r1" in line
    assert problem in line


def test_the_process_of_a_controller_on_another_machine_is_not_the_runs_to_kill() -> None:
    here = ["plant", "recorder", "agent/r2"]
    data = {"roles": here, "network": NETWORK}
    for robot, acts in (("r1", False), ("r2", True)):
        fault = f'fault=[{{kind="process_kill", at_s=1.0, robots=["{robot}"]}}]'
        scenario = load("two_robots_100hz", (fault,))
        if acts:
            check_deployment("where.toml", data, scenario, Path())
            continue
        with pytest.raises(ScenarioError, match=r"isn't started by the run: process_kill can't"):
            check_deployment("where.toml", data, scenario, Path())


def test_what_is_not_among_the_roles_is_elsewhere() -> None:
    placed = check(roles=["plant", "recorder", "agent/r2"], network=NETWORK)
    assert placed.elsewhere(load("two_robots_100hz")) == ("agent/r1",)


def test_its_files_are_beside_it(tmp_path: Path) -> None:
    file = tmp_path / "where.toml"
    file.write_text('[network]\nendpoint = "tcp/10.0.0.1:7447"\nusers = "secret/users"\n')
    placed = load_deployment(file, load("two_robots_100hz"))
    assert placed.network.users == tmp_path / "secret/users"


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"robots": {}}, "robots = {}: unknown key; did you mean robot?"),
        ({"robot": {"r1": {"buss": {}}}}, "robot.r1.buss = {}: unknown key; did you mean bus?"),
        ({"robot": {"r7": {}}}, 'robot.r7 = "r7": no such robot; known: r1, r2'),
        ({"roles": ["plant", "recorder", "pilot"]}, 'roles = "pilot": no such role; known: plant'),
        ({"roles": ["plant"], "network": NETWORK}, "must name recorder"),
        ({"roles": ["recorder", "plant"]}, "network = (missing): must be given: agent/r1, agent/"),
        (
            {"network": {"endpoint": "10.0.0.1"}},
            'network.endpoint = "10.0.0.1": must be tcp/HOST:PORT',
        ),
        (
            {"robot": {"r1": {"bus": {"interface": "pcan"}}}},
            "robot.r1.bus.channel = (missing): must be given: what the interface pcan opens",
        ),
        (
            {"robot": {"r1": {"bus": VCAN}, "r2": {"bus": VCAN}}},
            'robot.r2.bus.channel = "vcan0": r1 is there with the same node ids',
        ),
        (
            {"robot": {"r1": {"bus": {**VCAN, "can_filters": []}}}},
            "robot.r1.bus.can_filters = []: must be a text, a number, true or false",
        ),
        (
            {"robot": {"r1": {"plant_bus": VCAN}}},
            'robot.r1.plant_bus.interface = "socketcan": both ends must be on interfaces other',
        ),
        ({"robot": {"r1": {"emulated": False}}}, "robot.r1.emulated = false: must be true: a bus "),
    ],
)
def test_what_is_wrong_is_named_with_what_would_be_right(data: dict, said: str) -> None:
    assert f"where.toml: {said}" in complaint(**data) or said in complaint(**data)


def test_another_interface_needs_real_time() -> None:
    said = complaint("two_robots", robot={"r1": {"bus": VCAN}})
    assert 'robot.r1.bus.interface = "socketcan": in lockstep the plant holds the bus' in said
    assert "--clock realtime" in said


def test_all_problems_come_at_once() -> None:
    said = complaint(roles=["plant"], robot={"r7": {}, "r1": {"emulated": False}})
    assert len(said.splitlines()) == 4


def users(tmp_path: Path, text: str, mode: int = 0o600) -> Deployment:
    file = tmp_path / "users"
    file.write_text(text)
    file.chmod(mode)
    return check(network={**NETWORK, "users": str(file)})


def test_passwords_are_read_from_the_file_that_the_deployment_names(tmp_path: Path) -> None:
    placed = users(tmp_path, "agent-r1:a:b\n\nagent-r2:c\n")
    assert passwords(placed.network, ("agent-r1",)) == {"agent-r1": "a:b"}
    assert passwords(None, ()) == {}


@pytest.mark.parametrize(
    ("text", "mode", "said"),
    [
        ("agent-r2:c\n", 0o600, "no line agent-r1:<password>"),
        ("agent-r1:\n", 0o600, "no line agent-r1:<password>"),
        ("agent-r1:a\n", 0o644, "others may read it; chmod 600"),
    ],
)
def test_a_password_file_that_will_not_do_is_refused(
    text: str, mode: int, said: str, tmp_path: Path
) -> None:
    with pytest.raises(ScenarioError, match=said):
        passwords(users(tmp_path, text, mode).network, ("agent-r1",))


def test_without_password_file_or_certificates_nobody_comes_from_elsewhere() -> None:
    with pytest.raises(ScenarioError, match="name a file with a line identity:password"):
        passwords(check(network=NETWORK).network, ("agent-r1",))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"nowhere\.toml: can't be read: No such file"):
        load_deployment(tmp_path / "nowhere.toml", load("paper"))
