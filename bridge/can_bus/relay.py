"""The relay: lets guests from other machines onto the buses of a run, in the router's process.

A guest's packets go to the hub over a Unix socket of its own, and the hub's to the guest, verbatim:
to the hub a guest is a client like any other. The router's access control binds the `user` in a
guest's keys to its login; the relay lets a user onto the buses that it was granted, and says why it
refuses. A guest whose liveliness token goes leaves its bus.

One thread takes what guests send; one thread per guest hands on what the hub sends, so that a guest
who doesn't read keeps only itself waiting.
"""

import contextlib
import queue
import socket
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from bridge import keys
from bridge.can_bus import packet as wire
from bridge.can_bus import places
from bridge.link import Publisher
from bridge.zenoh_link import ZenohLink

ALL_BUSES = "*"
_SEND_S = 1.0
_JOIN_S = 1.0


class _Event(NamedTuple):
    place: str  # of a guest's line; "": the relay ends
    packet: bytes | None  # None: the guest has gone


class Relay:
    """Joins guests and hub; a context manager.

    Args:
        folder: the run's private folder with the buses' sockets.
        buses: those that there are.
        granted: for each user its buses, `ALL_BUSES` for all.
    """

    def __init__(
        self,
        link: ZenohLink,
        folder: Path,
        buses: Sequence[str],
        granted: Mapping[str, Sequence[str]],
    ) -> None:
        self._link = link
        self._folder = folder
        self._buses = tuple(buses)
        self._granted = granted
        self._events: queue.SimpleQueue[_Event] = queue.SimpleQueue()
        self._sockets: dict[str, socket.socket] = {}
        self._readers: list[threading.Thread] = []
        self._thread = threading.Thread(target=self._serve, daemon=True)
        for user in granted:
            # One by one: guests must be told that somebody hears them, and may see no wider key.
            link.each_keyed(keys.guest_lines("up", user), self._hear)
            link.each_gone(keys.guest_lines("alive", user), self._lose)
        self._thread.start()

    def close(self) -> None:
        """Leave all buses. Idempotent."""
        self._events.put(_Event("", None))
        self._thread.join(_JOIN_S)
        for sock in tuple(self._sockets.values()):
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)
        for reader in self._readers:
            reader.join(_JOIN_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    # --- on Zenoh's threads ----------------------------------------------------------------------

    def _hear(self, key: str, packet: bytes) -> None:
        self._events.put(_Event(key.removesuffix("/up"), packet))

    def _lose(self, key: str) -> None:
        self._events.put(_Event(key.removesuffix("/alive"), None))

    # --- on the relay's own ----------------------------------------------------------------------

    def _serve(self) -> None:
        while (event := self._events.get()).place:
            if event.packet is None:
                self._leave(event.place)
            elif event.place in self._sockets:
                self._pass_up(event.place, event.packet)
            else:
                self._join(event.place, event.packet)

    def _join(self, place: str, packet: bytes) -> None:
        hello = wire.decode(packet)
        if hello is None or hello.kind != wire.HELLO:
            return  # of somebody who has left
        user, bus = keys.guest_of(place)
        down = self._link.publisher(f"{place}/down")
        granted = self._granted.get(user, ())
        if bus not in self._buses:
            self._refuse(down, f"no bus {bus!r} is up; buses here: {', '.join(self._buses)}")
        elif ALL_BUSES not in granted and bus not in granted:
            self._refuse(down, f"{user!r} may open {', '.join(granted) or 'no bus'}, not {bus!r}")
        else:
            sock = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            sock.settimeout(_SEND_S)
            try:
                sock.connect(str(places.socket_path(self._folder, bus)))
                sock.send(packet)
            except OSError as error:
                sock.close()
                self._refuse(down, f"the bus doesn't answer: {error}")
                return
            sock.settimeout(None)
            self._sockets[place] = sock
            reader = threading.Thread(target=self._pass_down, args=(sock, down), daemon=True)
            self._readers = [r for r in self._readers if r.is_alive()] + [reader]
            reader.start()

    def _refuse(self, down: Publisher, reason: str) -> None:
        down.put(wire.encode_text(wire.REFUSED, reason))

    def _pass_up(self, place: str, packet: bytes) -> None:
        if len(packet) > wire.MAX_BYTES or packet[:1] == bytes((wire.HELLO,)):
            return  # a hello that was said again
        try:
            self._sockets[place].send(packet)
        except OSError:
            self._leave(place)

    def _leave(self, place: str) -> None:
        sock = self._sockets.pop(place, None)
        if sock is not None:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)

    # --- on a guest's thread ---------------------------------------------------------------------

    def _pass_down(self, sock: socket.socket, down: Publisher) -> None:
        """What the hub sends goes to the guest, to the end."""
        last = b""
        with sock:
            while True:
                try:
                    packet = sock.recv(wire.MAX_BYTES)
                except OSError:
                    packet = b""
                if not packet:
                    break
                last = packet
                down.put(packet)
        if last[:1] != bytes((wire.BYE,)):
            down.put(wire.encode_text(wire.BYE, "the bus has gone"))
