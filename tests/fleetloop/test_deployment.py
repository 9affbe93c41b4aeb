"""The command line with deployments: what is refused, before anything is started."""

import json
from pathlib import Path

import pytest

from configs.deployment import Deployment, check_deployment
from configs.errors import InfrastructureError, ScenarioError
from configs.loading import load
from fleetloop.check.command import check_scenario
from fleetloop.launch import placement
from fleetloop.launch.agent import run_agent
from fleetloop.launch.plant import PlantOptions, run_plant
from fleetloop.launch.run import RunOptions, run_scenario

HERE = 'roles = ["plant", "recorder", "agent/r1"]\n[network]\nendpoint = "tcp/127.0.0.1:7447"\n'


@pytest.fixture
def where(tmp_path: Path) -> Path:
    file = tmp_path / "where.toml"
    file.write_text(HERE)
    return file


def test_a_run_without_network_has_nothing_to_place(where, tmp_path) -> None:
    options = RunOptions(in_process=True, deployment=where, out=tmp_path / "run")
    with pytest.raises(ScenarioError, match="--in-process has no buses and no network to place"):
        run_scenario("two_robots", options)
    assert not (tmp_path / "run").exists()


def test_credentials_are_missed_before_a_folder_is_made(where, tmp_path) -> None:
    options = RunOptions(deployment=where, out=tmp_path / "run")
    with pytest.raises(ScenarioError, match="agent-r2"):
        run_scenario("two_robots_100hz", options)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("scenario", "robot", "said"),
    [
        ("two_robots_100hz", "r9", "r9: no such robot in two_robots_100hz; known: r1, r2"),
        ("two_robots", "r1", 'clock.mode = "lockstep": a controller on its own'),
        ("two_robots_100hz", "r2", "name a file with a line identity:password"),
    ],
)
def test_an_agent_that_can_not_start_says_why(scenario: str, robot: str, said: str, where) -> None:
    with pytest.raises(ScenarioError) as caught:
        run_agent(scenario, robot, where, ())
    assert said in str(caught.value)


def test_an_agent_needs_to_know_its_router(tmp_path) -> None:
    (tmp_path / "where.toml").write_text("[robot.r1]\n")
    with pytest.raises(ScenarioError, match=r"needs a deployment with \[network\] endpoint"):
        run_agent("two_robots_100hz", "r1", tmp_path / "where.toml", ())


def test_a_plant_whose_interface_is_missing_says_which_and_leaves_no_folder(
    tmp_path, runtime_folder
) -> None:
    file = tmp_path / "where.toml"
    file.write_text(
        '[robot.r1]\nemulated = true\nbus = { interface = "socketcan", channel = "can77" }\n'
    )
    with pytest.raises(InfrastructureError, match="drives of r1: no CAN bus: socketcan channel"):
        run_plant("two_robots", PlantOptions(deployment=file))
    assert not runtime_folder.exists()


def placed(**data) -> Deployment:
    return check_deployment("where", data, load("two_robots_100hz"), Path())


def test_the_router_listens_where_it_is_told_and_is_reached_at_its_endpoint() -> None:
    network = {"endpoint": "tcp/base:7447", "listen": "tcp/0.0.0.0:7447"}
    assert placement.outside(placed(network=network)).endpoint == "tcp/0.0.0.0:7447"
    assert (
        placement.outside(placed(network={"endpoint": "tcp/base:7447"})).endpoint == "tcp/base:7447"
    )
    assert placement.outside(Deployment()) is None


def test_machines_agree_on_the_runs_name() -> None:
    scenario = load("two_robots_100hz")
    network = {"endpoint": "tcp/base:7447"}
    assert placement.run_name(scenario, Deployment()) is None
    assert placement.run_name(scenario, placed(network=network)) == "two_robots_100hz"
    assert placement.run_name(scenario, placed(network={**network, "run": "lab"})) == "lab"


def test_a_controller_is_told_its_bus_verbatim_and_the_pace_only_on_ours() -> None:
    pcan = {"interface": "pcan", "channel": "PCAN_USBBUS1", "bitrate": 1000000}
    deployment = placed(robot={"r1": {"bus": pcan}})
    assert dict(placement.agent_bus(deployment, "r1")) == pcan
    assert dict(placement.agent_bus(deployment, "r2", socket="/x/r2.can")) == {
        "interface": "fleetloop",
        "channel": "/x/r2.can",
        "batched": True,
    }


def test_a_check_says_where_real_drives_would_be_driven(tmp_path, capsys) -> None:
    file = tmp_path / "where.toml"
    file.write_text('[robot.r2]\nbus = { interface = "socketcan", channel = "can0" }\n')
    assert check_scenario("two_robots_100hz", (), deployment=file, as_json=True) == 0
    places = {
        finding["robots"][0]: finding["value"]
        for finding in json.loads(capsys.readouterr().out)["findings"]
        if finding["title"] == "place"
    }
    assert places == {
        "r1": "controller here, emulated drives on fleetloop r1",
        "r2": "controller here, REAL drives on socketcan can0",
    }
