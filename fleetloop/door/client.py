"""A client's end of a door: the runs that go on on this machine, and requests to one of them."""

import contextlib
import json
import socket
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, Self

from bridge.can_bus import sockets
from configs.errors import InfrastructureError, ScenarioError
from fleetloop.door.server import NAME

CONNECT_S = 2.0
"""For a launcher to say which run is its: one that stands still isn't waited for."""
ANSWER_S = 60.0
"""For a request: the launcher answers within a bound of its own."""
_READ_BYTES = 1 << 16
_PEER = struct.Struct("3i")
"""struct ucred: process, user, group."""


class About(NamedTuple):
    """A run that goes on."""

    run: str  # its name
    folder: str  # of its record, "" if it has none
    scenario: str
    tick: int
    t_s: float


class RefusedError(ScenarioError):
    """The run refused a request; the text says why."""


class RunEndedError(InfrastructureError):
    """The run ended before it answered."""


def line_of(request: str, **arguments: Any) -> bytes:
    """The line of a request."""
    return json.dumps({"request": request, **arguments}).encode() + b"\n"


def answered(said: dict[str, Any]) -> dict[str, Any]:
    """An answer that is no refusal.

    Raises:
        RefusedError: it is one.
    """
    if "error" in said:
        raise RefusedError(str(said["error"]))
    return said


class RunClient:
    """A connection to the launcher of one run; a context manager that ends it.

    Raises:
        InfrastructureError: nobody answers there.
    """

    def __init__(self, path: Path) -> None:
        self.run = path.parent.name
        self._unread = b""
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(CONNECT_S)
        try:
            self._socket.connect(str(path))
        except OSError as error:
            self._socket.close()
            raise InfrastructureError(f"{self.run}: no answer: {error}") from error

    @property
    def pid(self) -> int:
        """The process of its launcher, as the kernel says; 0: one of another container."""
        peer = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size)
        pid: int = _PEER.unpack(peer)[0]
        return pid

    def ask(self, request: str, *, within_s: float = ANSWER_S, **arguments: Any) -> dict[str, Any]:
        """The answer to a request.

        Raises:
            RefusedError: the run says why not.
            RunEndedError: the run has ended.
            InfrastructureError: it doesn't answer in time.
        """
        self._socket.settimeout(within_s)
        try:
            self._socket.sendall(line_of(request, **arguments))
            while b"\n" not in self._unread:
                if not (more := self._socket.recv(_READ_BYTES)):
                    raise BrokenPipeError
                self._unread += more
        except TimeoutError as error:
            raise InfrastructureError(f"{self.run}: no answer in {within_s:g} s") from error
        except ConnectionError as error:
            raise RunEndedError(f"{self.run}: the run ended before it answered") from error
        except OSError as error:
            raise InfrastructureError(f"{self.run}: {error.strerror or error}") from error
        answer, _, self._unread = self._unread.partition(b"\n")
        return answered(json.loads(answer))

    def about(self) -> About:
        """Which run it is, and how far.

        Raises:
            InfrastructureError: no answer.
        """
        said = self.ask("about", within_s=CONNECT_S)
        return About(*(said[key] for key in About._fields))

    @contextlib.contextmanager
    def controlled(self, who: str, *, force: bool = False) -> Iterator[None]:
        """Hold the controls of the run for a while.

        Args:
            who: the name under which others are refused meanwhile.
            force: take them from who has them; they are given back afterwards.

        Raises:
            RefusedError: another client has them.
            InfrastructureError: no answer.
        """
        self.take_controls(who, force=force)
        yield
        with contextlib.suppress(RunEndedError):  # it has none any more
            self.ask("controls.release")

    def take_controls(self, who: str, *, force: bool = False) -> None:
        """Take the controls of the run; `controlled` gives them back.

        Raises:
            RefusedError: another client has them; the text says what to do in a command's words.
            InfrastructureError: no answer.
        """
        try:
            self.ask("controls.take", who=who, force=force)
        except RefusedError as error:
            _, _, why = str(error).rpartition("controls.take: ")
            raise RefusedError(f"{why}; --force borrows them") from error

    def close(self) -> None:
        """End the connection."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_run(name: str) -> RunClient:
    """Connect to a run by its name or its folder; "" is the only one that goes on.

    Raises:
        ScenarioError: there is no such run, or there are several; the text lists those there are.
    """
    found: list[tuple[RunClient, About]] = []
    for client in doors():
        try:
            found.append((client, client.about()))
        except (InfrastructureError, RefusedError):
            client.close()
    matching = [one for one in found if one[1].run == name]
    matching = matching or [one for one in found if not name or _is(name, one[1])]
    for client, _ in found:
        if len(matching) != 1 or client is not matching[0][0]:
            client.close()
    if len(matching) == 1:
        return matching[0][0]
    there = ", ".join(about.run for _, about in matching or found)
    if matching:
        wrong = f"{name}: names several runs" if name else "several runs are going on"
        raise ScenarioError(f"{wrong}; name one: {there}")
    if there:
        raise ScenarioError(f"{name}: no such run goes on on this machine; there are: {there}")
    raise ScenarioError(f"{name}: no run goes on on this machine".removeprefix(": "))


def doors() -> Iterator[RunClient]:
    """A connection to each door that can be opened, in the order of the runs' names."""
    for path in sockets.trusted(f"*/{NAME}"):
        try:
            yield RunClient(path)
        except InfrastructureError:
            continue


def _is(name: str, about: About) -> bool:
    """Whether a run has this folder, or this name without the number at its end."""
    if name == about.run.rpartition("-")[0]:
        return True
    return bool(about.folder) and Path(name).absolute() == Path(about.folder)
