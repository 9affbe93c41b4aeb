"""The launcher's end of a door: a Unix socket in the private folder of its run.

It is looked at from the launcher's loop and never blocks it: what a client sends and doesn't read
is bounded, and a client that goes beyond its bounds is cut off. Only this user may open it.
"""

import contextlib
import json
import selectors
import socket
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Self

from bridge.process.clock import SYSTEM_CLOCK, Clock
from configs.errors import InfrastructureError
from fleetloop.door.controls import Controls
from fleetloop.door.requests import MOST_LINE_BYTES, Answer, Request, serve

NAME = "door"
"""Of its socket in the run's folder, shorter than that of any bus."""
MOST_CLIENTS = 16
MOST_AT_ONCE = 64
"""Requests of one client that are carried out at one look; others wait."""
MOST_UNREAD_BYTES = 1 << 22
"""Of the answers to one client."""
IDLE_S = 60.0
"""A client that says nothing and waits for nothing makes room for others after this time."""
_BACKLOG = 16


class _Client:
    """One connection."""

    def __init__(self, connection: socket.socket, now_s: float) -> None:
        self.requests: Mapping[str, Request] = {}
        self.connection = connection
        self.since_s = now_s
        self.asked = bytearray()
        self.answers = bytearray()
        self.awaited = 0
        self.gone = False

    def respond(self, answer: Answer) -> None:
        """Queue an answer; a client that reads none of so many is cut off."""
        self.awaited -= 1
        self.answers += json.dumps(answer).encode() + b"\n"
        self.gone |= len(self.answers) > MOST_UNREAD_BYTES

    def read(self) -> None:
        try:
            more = self.connection.recv(MOST_LINE_BYTES)
        except BlockingIOError:
            return
        except OSError:
            more = b""
        self.asked += more
        self.gone |= not more

    def write(self) -> None:
        if not self.answers:
            return
        try:
            sent = self.connection.send(self.answers)
        except BlockingIOError:
            return
        except OSError:
            self.gone = True
            return
        del self.answers[:sent]


class Door:
    """Serves the requests to one run; a context manager that removes its socket.

    Args:
        folder: of the run's sockets.
        requests: what may be asked.
        controls: who holds those of the run.
        clock: of idle clients.

    Raises:
        InfrastructureError: the socket can't be made.
    """

    def __init__(
        self,
        folder: Path,
        requests: Mapping[str, Request],
        controls: Controls | None = None,
        *,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self._path = folder / NAME
        self._requests = requests
        self._controls = controls or Controls()
        self._clock = clock
        self._clients: list[_Client] = []
        self._selector = selectors.DefaultSelector()
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._listener.setblocking(False)
            self._listener.bind(str(self._path))
            self._path.chmod(0o600)
            self._listener.listen(_BACKLOG)
        except OSError as error:
            self._listener.close()
            raise InfrastructureError(f"can't open {self._path}: {error.strerror}") from error
        self._selector.register(self._listener, selectors.EVENT_READ, None)

    def look(self) -> None:
        """Take what has come, carry it out, and send what is answered; returns at once."""
        now_s = self._clock.monotonic_s()
        for key, _ in self._selector.select(0.0):
            if key.data is None:
                self._accept(now_s)
            else:
                key.data.since_s = now_s
                key.data.read()
        for client in self._clients:
            self._serve(client)
            client.write()
            idle = not client.awaited and now_s - client.since_s > IDLE_S
            if client.gone or idle:
                self._drop(client)
        self._clients = [client for client in self._clients if not client.gone]

    def _accept(self, now_s: float) -> None:
        for _ in range(_BACKLOG):
            try:
                connection, _ = self._listener.accept()
            except OSError:  # none waits, or it has gone again
                return
            connection.setblocking(False)
            client = _Client(connection, now_s)
            if len(self._clients) >= MOST_CLIENTS:
                client.respond({"error": f"{MOST_CLIENTS} clients are connected already"})
                client.write()
                connection.close()
                continue
            client.requests = {**self._requests, **self._controls.requests_of(client)}
            self._clients.append(client)
            self._selector.register(connection, selectors.EVENT_READ, client)

    def _serve(self, client: _Client) -> None:
        """Carry out the requests that have come whole; too long a line is the client's last."""
        for _ in range(MOST_AT_ONCE):
            line, newline, rest = client.asked.partition(b"\n")
            if not newline:
                break
            client.asked = rest
            client.awaited += 1
            refuse = partial(self._controls.refusal, client)
            serve(bytes(line), client.requests, partial(_Client.respond, client), refuse)
        else:
            return
        if len(client.asked) >= MOST_LINE_BYTES:
            client.respond({"error": f"a line of more than {MOST_LINE_BYTES} bytes"})
            client.write()
            client.gone = True

    def _drop(self, client: _Client) -> None:
        client.gone = True
        self._controls.drop(client)
        with contextlib.suppress(KeyError):
            self._selector.unregister(client.connection)
        client.connection.close()

    def close(self) -> None:
        """Send what is answered, as far as it is read at once; end all connections. Idempotent."""
        for client in self._clients:
            client.write()
            self._drop(client)
        self._clients.clear()
        self._selector.close()
        self._listener.close()
        self._path.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
