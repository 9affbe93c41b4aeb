"""A tool's end of emulated buses: open them, and read several until they end.

Frames come in the order in which they arrived, with bus time. A bus ends with a goodbye when its
run ends, whatever the reason, and breaks when its process is killed.
"""

import select
from collections.abc import Mapping
from typing import NamedTuple, Self

import can

from bridge.can_bus.interface import FleetloopBus
from bridge.can_bus.pythoncan import BusClosedError, to_frame
from bridge.frame import Frame
from configs.errors import FleetloopError, InfrastructureError

CONNECT_S = 2.0
_AT_ONCE = 1024


class Heard(NamedTuple):
    """A frame of a bus."""

    bus: str
    frame: Frame
    stamp_ns: int


def open_bus(channel: str, *, batched: bool = False) -> FleetloopBus:
    """Join a bus as a client like any other.

    Args:
        channel: bus, run/bus or the path of its socket.
        batched: for pure listeners; saves the bus work.

    Raises:
        InfrastructureError: no such bus, or it doesn't answer in `CONNECT_S`.
    """
    try:
        return FleetloopBus(channel, batched=batched, connect_timeout=CONNECT_S)
    except can.CanInitializationError as error:
        if isinstance(error.__cause__, FleetloopError):
            raise error.__cause__ from error
        raise InfrastructureError(str(error)) from error


class Listener:
    """Reads several buses until all of them have ended; a context manager that closes them.

    Args:
        buses: open buses by the name under which their frames are handed out.
        reader_fd: the descriptor of the result's reader; when its other end closes, `abandoned`.
    """

    def __init__(self, buses: Mapping[str, FleetloopBus], reader_fd: int | None = None) -> None:
        self.farewells: list[str] = []
        self.broken = False
        self.abandoned = False
        self._buses = dict(buses)
        self._names = {bus.fileno(): name for name, bus in buses.items()}
        self._unread: set[int] = set()
        self._reader_fd = reader_fd
        self._poll = select.poll()
        for fd in self._names:
            self._poll.register(fd, select.POLLIN)
        if reader_fd is not None:
            self._poll.register(reader_fd, 0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for bus in self._buses.values():
            bus.shutdown()

    @property
    def over(self) -> bool:
        """Whether no frame can follow, or its reader has closed."""
        return self.abandoned or not self._names

    def listen(self, timeout_s: float | None) -> list[Heard]:
        """Received frames; waits at most `timeout_s` (None: until a bus ends)."""
        wait_ms = 0.0 if self._unread else None if timeout_s is None else max(timeout_s, 0.0) * 1e3
        ready = {fd for fd, _ in self._poll.poll(wait_ms)}
        if self._reader_fd in ready:
            self.abandoned = True
            return []
        heard: list[Heard] = []
        for fd in ready | self._unread:
            self._read(fd, heard)
        return heard

    def _read(self, fd: int, heard: list[Heard]) -> None:
        name = self._names[fd]
        receive = self._buses[name].recv
        self._unread.discard(fd)
        try:
            for _ in range(_AT_ONCE):
                message = receive(0.0)
                if message is None:
                    return
                stamp_ns = max(round(message.timestamp * 1e9), 0)
                heard.append(Heard(name, to_frame(message), stamp_ns))
        except can.CanOperationError as error:
            self.farewells.append(str(error))
            self.broken = self.broken or not isinstance(error, BusClosedError)
            self._poll.unregister(fd)
            del self._names[fd]
            return
        self._unread.add(fd)
