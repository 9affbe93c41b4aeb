"""Who holds the controls of a run, and clients that mean no good."""

import json
import socket
from collections.abc import Iterator

import pytest
from support.clocks import ManualClock

from bridge.can_bus import sockets
from fleetloop.door.controls import MOST_NAME
from fleetloop.door.requests import Request
from fleetloop.door.server import NAME, Door


class Client:
    """A connection to a door that is looked at when this client asks."""

    def __init__(self, door: Door, path: str) -> None:
        self._door = door
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.connect(path)
        self._socket.settimeout(5.0)
        self._lines = self._socket.makefile("rb")

    def ask(self, request: str, **arguments) -> dict:
        return self.say(json.dumps({"request": request, **arguments}).encode())

    def say(self, line: bytes) -> dict:
        self._socket.sendall(line + b"\n")
        for _ in range(3):
            self._door.look()
        return json.loads(self._lines.readline())

    def close(self) -> None:
        self._lines.close()
        self._socket.close()
        for _ in range(3):
            self._door.look()


class Bench:
    """A door with one request that changes the run, and one that doesn't."""

    def __init__(self) -> None:
        self.speeds: list[float] = []

        def set_speed(respond, factor: float) -> None:
            self.speeds.append(factor)
            respond({})

        self._requests = {
            "run.speed": Request({"factor": float}, set_speed, changes=True),
            "run.status": Request({}, lambda respond: respond({"tick": 1})),
        }
        self.folder = sockets.create_run_folder("steered")
        self.door = Door(self.folder, self._requests, clock=ManualClock())
        self._clients: list[Client] = []

    def client(self) -> Client:
        self._clients.append(Client(self.door, str(self.folder / NAME)))
        return self._clients[-1]

    def end(self) -> None:
        for client in self._clients:
            client.close()
        self.door.close()
        sockets.remove_run_folder(self.folder)


@pytest.fixture
def bench(runtime_folder) -> Iterator[Bench]:
    made = Bench()
    yield made
    made.end()


def test_without_a_holder_anybody_may_change_the_run(bench: Bench) -> None:
    one, other = bench.client(), bench.client()
    assert one.ask("run.speed", factor=2) == other.ask("run.speed", factor=0.5) == {}
    assert bench.speeds == [2.0, 0.5]


def test_while_one_holds_them_others_only_look(bench: Bench) -> None:
    page, shell = bench.client(), bench.client()
    assert page.ask("controls.take", who="the page") == {"controller": "the page"}
    held = "the page has the controls of this run"
    assert shell.ask("run.speed", factor=2.0) == {"error": f"run.speed: {held}"}
    assert shell.ask("controls.take", who="a shell") == {"error": f"controls.take: {held}"}
    assert shell.ask("controls.release") == {"controller": "the page"}
    assert shell.ask("run.status") == {"tick": 1}
    assert page.ask("run.speed", factor=3.0) == {}
    assert page.ask("controls.release") == {"controller": None}
    assert shell.ask("run.speed", factor=4.0) == {}
    assert bench.speeds == [3.0, 4.0]


def test_by_force_they_are_lent_and_come_back(bench: Bench) -> None:
    page, shell = bench.client(), bench.client()
    page.ask("controls.take", who="the page")
    assert shell.ask("controls.take", who="a shell", force=True) == {"controller": "a shell"}
    assert page.ask("run.speed", factor=2.0)["error"].startswith("run.speed: a shell has")
    shell.close()  # without a word
    assert page.ask("run.speed", factor=2.0) == {}


def test_a_holder_that_is_gone_holds_nothing(bench: Bench) -> None:
    page, shell = bench.client(), bench.client()
    page.ask("controls.take", who="the page")
    page.close()
    assert shell.ask("controls.take", who="a shell") == {"controller": "a shell"}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b'{"request": "run.speed"}', "run.speed: takes factor, not none"),
        (b'{"request": "run.speed", "factor": "2"}', "factor must be of type float"),
        (b'{"request": "run.speed", "factor": true}', "factor must be of type float"),
        (b'{"request": "run.speed", "factor": NaN}', "factor must be a finite number"),
        (b'{"request": "run.speed", "factor": 1e999}', "factor must be a finite number"),
        (b'{"request": "run.speed", "factor": ' + b"9" * 400 + b"}", "factor must be of type"),
        (b'{"request": "controls.take", "who": ""}', "who must be a name"),
        (b'{"request": "controls.take", "who": "\\u001b[2J"}', "who must be a name"),
        (b'{"request": "controls.take", "who": "a", "force": 1}', "force must be of type bool"),
        (b'{"request": "controls.take", "who": "a", "more": 1}', "takes who, force, not who, more"),
    ],
)
def test_what_is_malformed_changes_nothing_and_takes_nothing(
    bench: Bench, line: bytes, said: str
) -> None:
    hostile, honest = bench.client(), bench.client()
    assert said in hostile.say(line)["error"]
    assert bench.speeds == []
    assert honest.ask("controls.take", who="x" * MOST_NAME) == {"controller": "x" * MOST_NAME}
