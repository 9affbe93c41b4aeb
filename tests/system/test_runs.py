"""A run in the background is listed, seen by robot, and stopped from another shell."""

import json
from pathlib import Path

import pytest
from support.command_line import fleetloop
from support.processes import running

from fleetloop.door.client import open_run
from fleetloop.results.run_folder import SUMMARY

pytestmark = pytest.mark.system

TWO = ("two_robots", "--set", "expect=[]", "--duration", "60", "--speed", "1", "--json-lines")


def test_a_run_in_the_background_is_listed_and_stopped(tmp_path: Path) -> None:
    folder = tmp_path / "a"
    with running(folder, *TWO) as run:
        (one,) = json.loads(fleetloop(tmp_path, "ps", "--json").stdout)
        assert (one["scenario"], one["folder"]) == ("two_robots", str(folder))
        with open_run(one["run"]) as client:
            robots = client.ask("run.status")["robots"]
        assert [robots[name]["phase"] for name in ("r1", "r2")] == ["driving", "driving"]
        assert robots["r2"]["neighbours"].keys() == {"r1"}
        assert robots["r1"]["bus_frames_per_s"] > 0.0
        assert robots["r1"]["right_drive"] == "CLOSED_LOOP_CONTROL"
        done = fleetloop(tmp_path, "stop", str(folder), "--json")
        status, out = run.end()
    assert (done.returncode, status) == (0, 130)
    told = json.loads(done.stdout)
    assert (told["run"], told["folder"]) == (one["run"], str(folder))
    assert told["verdict"] == json.loads((folder / SUMMARY).read_text())["verdict"] == "interrupted"
    last = json.loads([line for line in out.splitlines() if line.startswith('{"kind"')][-1])
    assert (last["kind"], last["outcome"]["exit_status"]) == ("outcome", 130)
