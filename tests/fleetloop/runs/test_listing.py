"""Runs that go on, as their doors say it; here the launcher is the test."""

import json
import os
from threading import Event, Thread

import pytest

from bridge.can_bus import sockets
from configs.errors import InfrastructureError
from fleetloop.door.requests import Request
from fleetloop.door.server import Door
from fleetloop.runs import listing
from fleetloop.runs.listing import NO_ANSWER, NO_DOOR, GoingOn, going_on, list_runs
from fleetloop.runs.stopping import stop_run

ABOUT = {"run": "demo-000001", "folder": "/runs/demo", "scenario": "demo", "tick": 5, "t_s": 0.5}


@pytest.fixture
def served():
    """A door that is looked at in a thread, as a launcher does; called with its requests."""
    over, threads = Event(), []
    with sockets.run_folder("demo-000001") as folder:

        def serve(**answers: dict) -> None:
            requests = {
                name.replace("_", "."): Request({}, lambda respond, it=it: respond(it))
                for name, it in answers.items()
            }
            door = Door(folder, requests)

            def look() -> None:
                with door:
                    while not over.wait(0.005):
                        door.look()

            threads.append(Thread(target=look))
            threads[0].start()

        yield serve
        over.set()
        for thread in threads:
            thread.join(10.0)


def test_a_run_is_listed_with_its_launcher(served) -> None:
    served(about=ABOUT, run_status={"state": "paused"})
    assert going_on() == [GoingOn("demo-000001", "demo", "paused", 0.5, os.getpid(), "/runs/demo")]


def test_a_run_without_a_door_is_listed_with_who_holds_its_lock() -> None:
    with sockets.run_folder("starting-000002") as folder:
        assert going_on() == [GoingOn("starting-000002", None, NO_DOOR, None, os.getpid(), None)]
        (folder / sockets.LOCK).rename(folder.parent / "elsewhere")
        (folder / sockets.LOCK).touch()  # of a run that was killed
        assert going_on() == []
        (folder.parent / "elsewhere").unlink()


def test_it_is_a_table_or_json(served, capsys) -> None:
    served(about=ABOUT, run_status={"state": "running"})
    list_runs(as_json=False)
    header, row = capsys.readouterr().out.splitlines()
    assert header.split() == ["run", "scenario", "state", "t", "[s]", "pid", "folder"]
    assert row.split() == ["demo-000001", "demo", "running", "0.50", str(os.getpid()), "/runs/demo"]
    list_runs(as_json=True)
    (run,) = json.loads(capsys.readouterr().out)
    assert (run["run"], run["state"], run["pid"]) == ("demo-000001", "running", os.getpid())


def test_a_run_that_does_not_answer_is_listed_in_bounded_time(monkeypatch) -> None:
    monkeypatch.setattr("fleetloop.door.client.CONNECT_S", 0.05)
    with sockets.run_folder("stuck-000001") as folder, Door(folder, {}):
        (found,) = going_on()
    assert found == GoingOn("stuck-000001", None, NO_ANSWER, None, os.getpid(), None)
    assert not listing._suspended(os.getpid())


def test_without_runs_it_says_so(capsys) -> None:
    list_runs(as_json=False)
    told = capsys.readouterr()
    assert (told.out, told.err.startswith("no run goes on in ")) == ("", True)


def test_a_run_that_does_not_end_is_an_error_in_bounded_time(served) -> None:
    served(about=ABOUT, controls_take={}, run_stop={"tick": 5, "t_s": 0.5})
    with pytest.raises(InfrastructureError, match=r"has not ended within 0\.1 s"):
        stop_run("", within_s=0.1, force=True, as_json=False)
