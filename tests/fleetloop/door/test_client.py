"""A client of a door; here the launcher is the test."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest

from bridge.can_bus import sockets
from fleetloop.door.client import RefusedError, RunClient, RunEndedError
from fleetloop.door.requests import Request
from fleetloop.door.server import NAME, Door


@contextmanager
def served(requests: dict[str, Request], over: Event) -> Iterator[Path]:
    """A door with these requests, which is looked after until `over`."""
    with sockets.run_folder("stopped-000001") as folder:
        door = Door(folder, requests)

        def serve() -> None:
            with door:
                while not over.wait(0.005):
                    door.look()

        thread = Thread(target=serve)
        thread.start()
        try:
            yield folder / NAME
        finally:
            over.set()
            thread.join(10.0)


def test_what_a_run_has_answered_counts_though_it_ends_before_it_has_the_controls_back() -> None:
    over = Event()

    def stop(respond: Callable[[dict[str, Any]], None]) -> None:
        respond({"tick": 5})
        over.set()

    requests = {"run.stop": Request({}, stop, changes=True)}
    with served(requests, over) as door, RunClient(door) as client:
        with client.controlled("a shell"):
            assert client.ask("run.stop") == {"tick": 5}
        with pytest.raises(RunEndedError):
            client.ask("run.stop")


def test_who_has_the_controls_is_named_with_the_option_that_borrows_them() -> None:
    with (
        served({}, Event()) as door,
        RunClient(door) as page,
        RunClient(door) as shell,
        page.controlled("the page"),
    ):
        with pytest.raises(RefusedError) as caught, shell.controlled("a shell"):
            pass
        with shell.controlled("a shell", force=True):
            pass
    assert str(caught.value) == "the page has the controls of this run; --force borrows them"
