"""A client of a door; here the launcher is the test."""

from collections.abc import Callable
from threading import Event, Thread
from typing import Any

import pytest

from bridge.can_bus import sockets
from fleetloop.door.client import RunClient, RunEndedError
from fleetloop.door.requests import Request
from fleetloop.door.server import NAME, Door


def test_what_a_run_has_answered_counts_though_it_ends_before_it_has_the_controls_back() -> None:
    over = Event()

    def stop(respond: Callable[[dict[str, Any]], None]) -> None:
        respond({"tick": 5})
        over.set()

    with sockets.run_folder("stopped-000001") as folder:
        door = Door(folder, {"run.stop": Request({}, stop, changes=True)})

        def serve() -> None:
            with door:
                while not over.wait(0.005):
                    door.look()

        thread = Thread(target=serve)
        thread.start()
        try:
            with RunClient(folder / NAME) as client:
                with client.controlled("a shell"):
                    assert client.ask("run.stop") == {"tick": 5}
                    thread.join(10.0)
                with pytest.raises(RunEndedError):
                    client.ask("run.stop")
        finally:
            over.set()
            thread.join(10.0)
