"""Faults ordered during a run: at the tick that is answered, as if the scenario had listed them."""

import json
import re
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from support.command_line import fleetloop
from support.processes import Run, completed, running

from fleetloop.door.client import RefusedError, RunClient, open_run
from fleetloop.results.run_folder import SCENARIO, SUMMARY, read_record

pytestmark = pytest.mark.system

PACED = ("two_robots", "--set", "expect=[]", "--duration", "8", "--speed", "1")


@contextmanager
def going_on(folder: Path, *args: str) -> Iterator[tuple[Run, RunClient]]:
    with running(folder, *PACED, *args, bus_time_s=0.3) as run, open_run("") as client:
        yield run, client


def inject(client: RunClient, kind: str, **fault: Any) -> dict[str, Any]:
    answered: dict[str, Any] = client.ask("fault.inject", fault={"kind": kind, **fault})["fault"]
    return answered


def same_but_for_ages(a: Path, b: Path) -> bool:
    """Whether two records agree bit for bit in the signals that both have."""
    one, other = read_record(a, partial=False), read_record(b, partial=False)
    return all(
        np.array_equal(rows[robot][name], others[robot][name], equal_nan=True)
        for rows, others in ((one.plant, other.plant), (one.controller, other.controller))
        for robot in rows
        for name in rows[robot].dtype.names
        if not name.startswith("age_of_")
    )


def test_they_leave_the_record_of_a_scenario_that_lists_them_at_these_ticks(tmp_path: Path) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    with going_on(a) as (run, client):
        shove = inject(client, "push", robots=["r2"], force_body_N=4.0, for_s=5.0, name="shove")
        assert shove["state"] == "acting"
        assert shove["to_tick"] - shove["from_tick"] == 2500
        cut = inject(client, "link_partition", edges=["r1 -> r2"])
        inject(client, "link_delay", edges=["leader -> *", "localisation -> r2"], delay_s=0.03)
        inject(client, "localisation_outage", for_s=0.2)
        inject(client, "link_loss", edges=["r1 -> r2"], probability=0.5)
        (ended,) = client.ask("fault.clear", names=["shove"])["cleared"]
        assert shove["from_tick"] < ended["to_tick"] < shove["to_tick"]
        (ended,) = client.ask("fault.clear", names=["link_partition"])["cleared"]
        assert ended["to_tick"] > cut["from_tick"]
        tables = client.ask("fault.list")["tables"]
        status, out = run.end()
    assert status == 0, out
    assert len(tables) == 5
    scenario = tomllib.loads((a / SCENARIO).read_text()) | {"fault": tables}
    (tmp_path / "listed.toml").write_text(tomli_w.dumps(scenario))
    status, out = completed(b, str(tmp_path / "listed.toml"), "--in-process")
    assert status == 0, out
    assert same_but_for_ages(a, b)
    summaries = [json.loads((folder / SUMMARY).read_text()) for folder in (a, b)]
    changes, in_process = (
        [one for one in it["events"] if one["kind"].startswith("fault")] for it in summaries
    )
    assert changes == in_process
    assert [one["kind"] for one in changes].count("fault_applied") == 7  # of 5 faults, by target
    said = r"r2: tick \d+ \(t = .* s\): fault_applied: shove \(push\)"
    assert re.search(said, out), out
    assert [one["state"] for one in summaries[0]["faults"]] == [
        *("cleared", "cleared", "acting", "over", "acting")
    ]
    assert [one["ordered"] for one in summaries[1]["faults"]] == [False] * 5
    rows = read_record(b, partial=False).controller["r2"]
    assert rows["age_of_r1_s"].max() > 0.1  # the cut was there


def test_they_are_listed_cleared_and_refused_with_the_reason(tmp_path: Path) -> None:
    later = 'fault=[{kind="push", name="later", at_s=7.5, robots=["r1"]}]'
    with going_on(tmp_path / "run", "--set", later) as (run, client):
        (listed,) = client.ask("fault.list")["faults"]
        assert (listed["name"], listed["state"], listed["from_tick"]) == ("later", "planned", 3750)
        assert not listed["ordered"]
        said = fleetloop(tmp_path, "fault", "other", "list")
        assert said.returncode == 2
        assert f"other: no such run goes on on this machine; there are: {client.run}" in said.stderr
        said = fleetloop(tmp_path, "fault", str(run.folder), "inject", "push", "--robot", "r2")
        assert "push on r2: applied at tick " in said.stdout, said.stderr
        planned = inject(client, "push", at_s=7.0, for_s=0.1, torque_body_N_m=0.1)
        assert (planned["name"], planned["state"]) == ("push_2", "planned")
        assert planned["from_tick"] == 3500
        for fault, why in (
            ({"kind": "push", "at_s": 0.1}, "at_s = 0.1: has gone: the run is at"),
            ({"kind": "push", "name": "later"}, "another fault of this run has this name"),
            ({"kind": "can_corrupt"}, "needs bus.timing = 'wire'"),
            ({"kind": "push", "robots": ["r9"]}, "no such robot"),
            ({"kind": "link_delay", "delay_s": -1.0}, "delay_s = -1.0: must be 0 or more"),
        ):
            with pytest.raises(RefusedError) as refusal:
                client.ask("fault.inject", fault=fault)
            assert why in str(refusal.value)
        with pytest.raises(
            RefusedError, match="nobody: no such fault in this run; there are: later"
        ):
            client.ask("fault.clear", names=["nobody"])
        cleared = client.ask("fault.clear", names=[])["cleared"]
        assert [one["name"] for one in cleared] == ["later", "push", "push_2"]
        with pytest.raises(RefusedError, match="push: was cleared already"):
            client.ask("fault.clear", names=["push"])
        toml = fleetloop(tmp_path, "fault", "list", "--toml").stdout
        (again,) = tomllib.loads(toml)["fault"]  # the other two never acted
        assert (again["name"], again["at_s"]) == ("push", cleared[1]["from_s"])


@pytest.mark.wall_clock
def test_in_real_time_they_act_at_the_tick_that_is_answered_and_again_after_a_restart(
    tmp_path: Path,
) -> None:
    options = ("--clock", "realtime", "--set", "host.restarts=1", "--set", "expect=[]")
    args = ("two_robots_100hz", *options, "--duration", "5", "--allow-unchecked")
    with running(tmp_path / "run", *args) as run, open_run("") as client:
        push = inject(client, "push", robots=["r1"], force_body_N=1.0, for_s=0.5)
        delay = inject(client, "link_delay", edges=["r1 -> r2"], delay_s=0.1)
        # It is answered before it acts: the controller is to have acted when it is killed.
        run.await_line(r"r2: tick \d+ .*: fault_applied: link_delay on r1 -> r2", 20.0)
        run.child("r2").kill()
        _, out = run.end()
    summary = run.summary()
    changes = [
        (one["source"], one["text"], one["tick"])
        for one in summary["events"]
        if one["kind"] == "fault_applied"
    ]
    assert ("r1", "push", push["from_tick"]) in changes
    # The report of the first controller was lost with it, not what it had announced.
    told = re.findall(
        r"^r2: tick (\d+) .*: fault_applied: link_delay on r1 -> r2$", out, re.MULTILINE
    )
    first, again = sorted({int(tick) for tick in told})
    assert first == delay["from_tick"], out
    assert again > first
