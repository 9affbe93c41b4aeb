"""`fleetloop can slcan`: a bus as a pseudo-terminal that slcan software opens like an adapter.

    bus ──► lines, kept up to `KEPT_BYTES` without a reader, then dropped and counted ──► terminal
    bus ◄── frames of complete lines                                                    ◄── terminal

Nothing here waits for the software: it may be slow, stop reading or be killed; when the last one
closes the device, the adapter closes too, and the next one finds it fresh.
"""

import contextlib
import os
import select
import tty
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import can

from bridge.can_bus.interface import FleetloopBus
from bridge.can_bus.pythoncan import BusClosedError, to_frame, to_message
from configs.errors import ExitStatus, InfrastructureError
from fleetloop.can.client import open_bus
from fleetloop.can.slcan_adapter import Adapter
from fleetloop.signals import interruptible
from fleetloop.terminal import note, say

KEPT_BYTES = 64 * 1024
_READ_BYTES = 4096
_AT_ONCE = 256


@dataclass(slots=True)
class SlcanCounters:
    """Frames through the adapter."""

    received: int = 0  # by the software
    sent: int = 0
    dropped: int = 0


class Port:
    """The adapter between a bus and a pseudo-terminal."""

    def __init__(self, bus: FleetloopBus) -> None:
        self.counters = SlcanCounters()
        self._bus = bus
        self._adapter = Adapter()
        self._kept = bytearray()
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.device = os.ttyname(slave)
        # Held open here, the device would never tell that its software left.
        os.close(slave)
        os.set_blocking(self._master, False)
        self._poll = select.epoll()
        self._poll.register(bus.fileno(), select.EPOLLIN)
        # Edge-triggered: a device that no program has open stays in the state "hung up".
        self._poll.register(self._master, select.EPOLLIN | select.EPOLLOUT | select.EPOLLET)

    def close(self) -> None:
        """Close the device."""
        self._poll.close()
        os.close(self._master)

    def serve(self, timeout_s: float | None = None) -> None:
        """Handle what comes from either side; waits at most `timeout_s` (None: until something).

        Raises:
            can.CanOperationError: the bus is gone.
        """
        for fd, event in self._poll.poll(timeout_s):
            if fd != self._master:
                self._from_bus()
                continue
            if event & select.EPOLLIN:
                self._from_software()
            if event & select.EPOLLHUP:
                self._adapter.hang_up()
                self._kept.clear()
            elif event & select.EPOLLOUT:
                self._write()

    def _from_bus(self) -> None:
        for _ in range(_AT_ONCE):
            message = self._bus.recv(0.0)
            if message is None:
                break
            line = self._adapter.show(to_frame(message), max(round(message.timestamp * 1e9), 0))
            if not line:
                continue
            if len(self._kept) + len(line) > KEPT_BYTES:
                self.counters.dropped += 1
                self._adapter.overrun()
            else:
                self.counters.received += 1
                self._kept += line
        self._write()

    def _from_software(self) -> None:
        while True:
            try:
                data = os.read(self._master, _READ_BYTES)
            except OSError:
                # EAGAIN: all read. EIO: no program has the device open, which is an event too.
                return
            reply, frames = self._adapter.process(data)
            self._kept += reply[: max(2 * KEPT_BYTES - len(self._kept), 0)]
            for frame in frames:
                try:
                    self._bus.send(to_message(frame.can_id, frame.data), 0.1)
                    self.counters.sent += 1
                except BusClosedError:
                    raise
                except can.CanOperationError:
                    self.counters.dropped += 1
            self._write()

    def _write(self) -> None:
        while self._kept:
            try:
                written = os.write(self._master, self._kept)
            except OSError:
                return
            del self._kept[:written]


@interruptible
def offer(channel: str, link: Path | None) -> int:
    """Offer a bus until its run ends or a signal comes; return the exit status.

    Raises:
        InfrastructureError: no such bus, or the link can't be made.
    """
    with (
        open_bus(channel) as bus,
        contextlib.closing(Port(bus)) as port,
        _linked(port.device, link),
    ):
        say(str(link or port.device))
        note(f"bus {channel} is an slcan adapter at {port.device}; Ctrl-C ends it")
        status = ExitStatus.OK
        try:
            while True:
                port.serve()
        except KeyboardInterrupt:
            status = ExitStatus.INTERRUPTED
        except can.CanOperationError as error:
            note(f"fleetloop: {error}")
            ended = isinstance(error, BusClosedError)
            status = ExitStatus.OK if ended else ExitStatus.INFRASTRUCTURE
        counters = port.counters
        note(
            f"{counters.received} frames to the software, {counters.sent} from it,"
            f" {counters.dropped} dropped"
        )
    return status


@contextlib.contextmanager
def _linked(device: str, link: Path | None) -> Iterator[None]:
    if link is None:
        yield
        return
    try:
        if link.is_symlink() and not link.exists():
            link.unlink()  # of an adapter that was killed
        link.symlink_to(device)
    except OSError as error:
        raise InfrastructureError(f"can't make the link {link}: {error.strerror}") from error
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            if link.readlink() == Path(device):
                link.unlink()
