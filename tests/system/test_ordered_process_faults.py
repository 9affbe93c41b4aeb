"""Faults of processes ordered during a run: killed, frozen, slowed and there again, as ordered."""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from support.processes import Run, completed, running

from fleetloop.door.client import RefusedError, RunClient, open_run
from fleetloop.record.reader import Record
from fleetloop.results.run_folder import SCENARIO, read_record

pytestmark = pytest.mark.system

FREE = "two_robots", "--set", "expect=[]", "--allow-unchecked"
BOTH_WAYS = "--set", "graph.edges=['r1 -> r2', 'r2 -> r1']"
SILENCE = "--set", "coordination.silence_limit_s=0.2"


def on_late(policy: str) -> tuple[str, ...]:
    return "--set", f"clock.on_late='{policy}'", "--set", "clock.tick_deadline_s=20.0"


@contextmanager
def going_on(folder: Path, *args: str, bus_time_s: float = 0.3) -> Iterator[tuple[Run, RunClient]]:
    with (
        running(folder, *FREE, *SILENCE, *args, bus_time_s=bus_time_s) as run,
        open_run("") as client,
    ):
        yield run, client
        assert run.survivors() == []


def inject(client: RunClient, kind: str, **fault: Any) -> dict[str, Any]:
    answered: dict[str, Any] = client.ask("fault.inject", fault={"kind": kind, **fault})["fault"]
    return answered


def clear(client: RunClient, name: str) -> dict[str, Any]:
    (ended,) = client.ask("fault.clear", names=[name])["cleared"]
    assert ended["state"] == "cleared"
    return dict(ended)


def said(run: Run, robot: str) -> list[tuple[int, str]]:
    """What was said of a robot's controller and its absence, with the ticks."""
    about = {"killed", "frozen", "held", "dropped", "awaited", "back"}
    events = run.summary()["events"]
    return sorted(
        (it["tick"], it["kind"]) for it in events if it["source"] == robot and it["kind"] in about
    )


def same(one: Record, other: Record) -> bool:
    """Whether two records agree bit for bit."""
    return all(
        np.array_equal(rows[robot][name], others[robot][name], equal_nan=True)
        for rows, others in ((one.plant, other.plant), (one.controller, other.controller))
        for robot in rows
        for name in rows[robot].dtype.names
    )


def repeated(folder: Path, tables: list[dict[str, Any]]) -> Path:
    """The folder of a run whose scenario lists these faults."""
    scenario = tomllib.loads((folder / SCENARIO).read_text()) | {"fault": tables}
    again = folder.parent / "again"
    (folder.parent / "listed.toml").write_text(tomli_w.dumps(scenario))
    status, out = completed(again, str(folder.parent / "listed.toml"), "--allow-unchecked")
    assert status == 0, out
    return again


def test_killed_frozen_and_slowed_in_lockstep_drop_as_in_a_scenario_that_lists_them(
    tmp_path: Path,
) -> None:
    args = ("--duration", "5", "--speed", "1", *on_late("drop"), "--record-inputs")
    with going_on(tmp_path / "a", *args) as (run, client):
        slow = inject(client, "process_slow", robots=["r1"], extra_s=0.001)
        kill = inject(client, "process_kill", robots=["r2"])
        with pytest.raises(RefusedError, match="r2: its controller is absent"):
            inject(client, "process_freeze", robots=["r2"])
        killed = clear(client, "process_kill")
        nap = inject(client, "process_freeze", robots=["r1"], name="nap")
        assert clear(client, "nap")["to_tick"] > nap["from_tick"]
        restart = inject(client, "process_restart", robots=["r2"], at_s=4.0)
        assert (restart["from_tick"], restart["state"]) == (2000, "planned")
        with pytest.raises(RefusedError, match=r"the process of r2 is absent from 3\.9 s on"):
            inject(client, "process_kill", robots=["r2"], at_s=3.9, for_s=0.5)
        slowed = clear(client, "process_slow")
        tables = client.ask("fault.list")["tables"]
        status, out = run.end()
    assert status == 0, out
    assert said(run, "r2") == [
        *[(kill["from_tick"], it) for it in ("dropped", "killed")],
        *[(killed["to_tick"], it) for it in ("awaited", "back")],
        *[(2000, it) for it in ("dropped", "killed")],
        *[(2001, it) for it in ("awaited", "back")],
    ]
    assert slow["from_tick"] < kill["from_tick"] < killed["to_tick"] < slowed["to_tick"]
    one = read_record(run.folder, partial=False)
    assert same(one, read_record(repeated(run.folder, tables), partial=False))
    s = one.controller["r2"]["s"]
    assert np.isnan(s[kill["from_tick"] : killed["to_tick"]]).all()
    assert np.isfinite(s[-50:]).all()


def test_a_frozen_controller_is_held_until_it_is_cleared_and_catches_up(tmp_path: Path) -> None:
    args = ("--duration", "4", "--speed", "1", *BOTH_WAYS, *on_late("hold"))
    with going_on(tmp_path / "a", *args, "--set", "host.rearm=true") as (run, client):
        nap = inject(client, "process_freeze", robots=["r1"])
        awake = clear(client, "process_freeze")
        tables = client.ask("fault.list")["tables"]
        status, out = run.end()
    assert status == 0, out
    assert said(run, "r1") == [
        *[(nap["from_tick"], it) for it in ("frozen", "held")],
        (awake["to_tick"], "back"),
    ]
    one = read_record(run.folder, partial=False)
    assert same(one, read_record(repeated(run.folder, tables), partial=False))
    assert all(np.isfinite(part["s"]).all() for part in one.controller.values())


def test_under_abort_one_that_comes_again_is_refused_and_one_that_does_not_ends_the_run(
    tmp_path: Path,
) -> None:
    with going_on(tmp_path / "a", "--duration", "8", "--speed", "1") as (run, client):
        with pytest.raises(RefusedError, match=r"ends a lockstep run: needs clock\.on_late"):
            inject(client, "process_kill", robots=["r2"], for_s=0.1)
        with pytest.raises(RefusedError, match=r"ends a lockstep run: needs clock\.on_late"):
            inject(client, "process_restart", robots=["r2"])
        later = inject(client, "process_kill", at_s=7.0, name="later")
        assert later["state"] == "planned"
        assert clear(client, "later")["to_tick"] == 3500
        inject(client, "process_slow", extra_s=0.001, for_s=0.1)
        assert inject(client, "process_kill", robots=["r2"], name="bang")["state"] == "acting"
        status, out = run.end()
    assert status == 3
    assert "agent/r2 was killed by SIGKILL by fault bang" in " ".join(out.split())


@pytest.mark.wall_clock
def test_in_real_time_the_launcher_ends_what_controllers_can_not(tmp_path: Path) -> None:
    args = ("--clock", "realtime", "--set", "clock.control_period_s=0.01", "--duration", "7")
    rearm = ("--set", "host.rearm=true", "--set", "host.rearm_limit_s=10.0")
    with going_on(tmp_path / "a", *args, *rearm) as (run, client):
        slow = inject(client, "process_slow", robots=["r1"], extra_s=0.002, for_s=0.2)
        kill = inject(client, "process_kill", robots=["r2"])
        with pytest.raises(RefusedError, match="r2: its controller is absent"):
            inject(client, "process_slow", robots=["r2"])
        killed = clear(client, "process_kill")
        nap = inject(client, "process_freeze", robots=["r1"])
        awake = clear(client, "process_freeze")
        inject(client, "process_restart", robots=["r1"])
        status, out = run.end()
    assert status in (0, 1), out
    assert {(kill["from_tick"], "killed")} == set(said(run, "r2"))
    assert [kind for _, kind in said(run, "r1")] == ["frozen", "killed"]
    assert said(run, "r1")[0] == (nap["from_tick"], "frozen")
    assert slow["to_tick"] - slow["from_tick"] == 20
    rows = read_record(run.folder, partial=False).controller
    assert np.isnan(rows["r2"]["s"][kill["from_tick"] : killed["to_tick"]]).all()
    assert np.isfinite(rows["r2"]["s"][-20:]).all()
    # One that was frozen has all its ticks afterwards.
    assert np.isfinite(rows["r1"]["t_s"][nap["from_tick"] : awake["to_tick"]]).all()
    assert np.isfinite(rows["r1"]["late_s"][nap["from_tick"] : awake["to_tick"]]).all()
