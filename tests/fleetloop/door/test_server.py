"""The door of a run: requests over its socket, and clients that keep to no rule."""

import json
import socket
import stat
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from support.clocks import ManualClock

from bridge.can_bus import sockets
from configs.errors import InfrastructureError, ScenarioError
from fleetloop.door import server
from fleetloop.door.client import RunClient, open_run
from fleetloop.door.requests import MOST_LINE_BYTES, Request
from fleetloop.door.server import MOST_CLIENTS, NAME, Door


class Table:
    """Requests that are answered at once, later, or at length."""

    def __init__(self) -> None:
        self.later: list = []
        self.requests = {
            "echo": Request({"word": str}, lambda respond, word: respond({"word": word})),
            "later": Request({}, self.later.append),
            "long": Request({}, lambda respond: respond({"long": "x" * 500_000})),
        }


@pytest.fixture
def table() -> Table:
    return Table()


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def door(table: Table, clock: ManualClock) -> Iterator[Door]:
    with (
        sockets.run_folder("demo-000001") as folder,
        Door(folder, table.requests, clock=clock) as it,
    ):
        yield it


def path() -> Path:
    return sockets.folder_of("demo-000001") / NAME


def client() -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    made.settimeout(5.0)
    made.connect(str(path()))
    return made


def ask(made: socket.socket, **request) -> None:
    made.sendall(json.dumps(request).encode() + b"\n")


def answer(made: socket.socket) -> dict:
    with made.makefile("rb") as lines:
        return json.loads(lines.readline())


def test_it_is_this_users_alone_and_goes_with_the_run(table: Table) -> None:
    with sockets.run_folder("demo-000001") as folder, Door(folder, table.requests):
        assert stat.S_IMODE(path().stat().st_mode) == 0o600
    assert not path().exists()


def test_requests_are_answered_in_order_and_one_may_be_answered_later(
    door: Door, table: Table
) -> None:
    with client() as one:
        ask(one, request="later", id=1)
        ask(one, request="echo", word="a", id=2)
        door.look()
        door.look()
        assert answer(one) == {"id": 2, "word": "a"}
        (respond,) = table.later
        respond({"done": True})
        door.look()
        assert answer(one) == {"id": 1, "done": True}


def test_a_request_in_pieces_is_one_request(door: Door) -> None:
    with client() as one:
        for piece in (b'{"request": "ec', b'ho", "word"', b': "a"}\n'):
            one.sendall(piece)
            door.look()
            door.look()
        assert answer(one) == {"word": "a"}


def test_a_client_that_has_gone_is_forgotten_and_its_answer_too(door: Door, table: Table) -> None:
    with client() as one:
        ask(one, request="later")
        door.look()
        door.look()
    door.look()
    table.later[0]({"done": True})
    door.look()
    with client() as two:
        ask(two, request="echo", word="b")
        door.look()
        door.look()
        assert answer(two) == {"word": "b"}


def test_a_line_without_end_is_refused_and_its_client_cut_off(door: Door) -> None:
    with client() as one:
        one.settimeout(0.0)
        sent = 0
        while sent <= MOST_LINE_BYTES:
            try:
                sent += one.send(b"x" * 4096)
            except BlockingIOError:
                door.look()
        for _ in range(8):
            door.look()
        one.settimeout(5.0)
        assert "a line of more than" in answer(one)["error"]
        with suppress(ConnectionResetError):
            assert one.recv(1) == b""


def test_a_client_that_reads_nothing_is_cut_off(door: Door) -> None:
    with client() as deaf, client() as other:
        with suppress(BrokenPipeError):
            for _ in range(60):
                ask(deaf, request="long")
                door.look()
        assert len(door._clients) == 1
        ask(other, request="echo", word="c")
        door.look()
        assert answer(other) == {"word": "c"}


def test_more_clients_than_there_is_room_for_are_told_so_until_one_idles(
    door: Door, clock: ManualClock
) -> None:
    made = [client() for _ in range(MOST_CLIENTS)]
    door.look()
    with client() as late:
        door.look()
        assert f"{MOST_CLIENTS} clients" in answer(late)["error"]
    clock.passes(server.IDLE_S + 1.0)
    door.look()
    with client() as later:
        ask(later, request="echo", word="d")
        door.look()
        door.look()
        assert answer(later) == {"word": "d"}
    for one in made:
        one.close()


def test_a_socket_that_is_there_already_is_an_error(door: Door, table: Table) -> None:
    with pytest.raises(InfrastructureError, match="can't open"):
        Door(path().parent, table.requests)


def test_there_is_no_run_where_there_is_no_door(runtime_folder: Path) -> None:
    with pytest.raises(ScenarioError, match=r"^no run goes on on this machine"):
        open_run("")
    with pytest.raises(ScenarioError, match=r"^r: no run goes on on this machine"):
        open_run("r")
    with sockets.run_folder("gone") as folder:
        left = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        left.bind(str(folder / NAME))
        left.close()  # as a killed launcher leaves it
        with pytest.raises(ScenarioError, match="no run goes on"):
            open_run("")


def test_a_run_that_ends_before_it_answers_is_told(door: Door) -> None:
    with RunClient(path()) as one:
        door.look()
        door.close()
        with pytest.raises(InfrastructureError, match="demo-000001"):
            one.ask("echo", word="a", within_s=5.0)
