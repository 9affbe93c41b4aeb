"""Drive port on buses of any python-can interface, one `can.Bus` each.

The emulated drives are one more node on a SocketCAN interface, behind a USB adapter, in a multicast
group. The bus's own clock counts: frames go out when they are delivered and are heard when they
came; bus time in `deliver` is not carried. What can't be sent is dropped and counted: the next one
is newer. Error frames and FD frames are counted and not heard; the drives' own frames, where the
interface hands them back, are neither.

    bus state   on                                                  to
    up          a failed send or receive (link down, adapter gone)  failing, an outage
    failing     a send or receive that works                        up
    failing     for `REOPEN_S`, then every `REOPEN_S`               closed and opened again

A network interface that was taken down works again once it is up; an adapter that was unplugged has
to be opened again. Neither ends the plant. Interfaces without a file descriptor are polled.
"""

import contextlib
import select
from collections.abc import Mapping, Sequence

import can

from bridge.can_bus.drive_port import DrivePort, WaitablePort
from bridge.can_bus.echo import Echoes, hands_back
from bridge.can_bus.pythoncan import open_bus, to_frame, to_message
from bridge.frame import Frame
from bridge.process.clock import SYSTEM_CLOCK, Clock
from bridge.process.waiting import readable
from configs.connections import Settings
from configs.errors import InfrastructureError

REOPEN_S = 1.0
POLL_S = 0.001
"""How often an interface without file descriptor is looked at."""
AT_ONCE = 256
"""Frames taken from one bus before others have their turn."""
BACKLOG = 10_000
"""Frames kept until they are taken; the rest is dropped and counted."""
_FAILURES = (can.CanError, OSError, ValueError)  # ValueError: a descriptor that was closed


class ExternalBusCounters:
    """What went wrong on one bus."""

    __slots__ = ("dropped", "error_frames", "garbage", "outages")

    def __init__(self) -> None:
        self.dropped = 0  # could not be sent, or were not taken in time
        self.garbage = 0  # FD frames, and what is no frame of classic CAN
        self.error_frames = 0
        self.outages = 0


class _Attachment:
    """One bus."""

    __slots__ = (
        "bus",
        "counters",
        "deaf",
        "echoes",
        "failing_since_s",
        "fd",
        "name",
        "out_s",
        "reason",
        "retry_s",
        "settings",
        "taken",
    )

    def __init__(self, name: str, settings: Settings) -> None:
        self.name = name
        self.settings = settings
        self.echoes = Echoes() if hands_back(settings) else None
        self.bus: can.BusABC | None = None
        self.fd: int | None = None
        self.taken: list[Frame] = []
        self.counters = ExternalBusCounters()
        self.failing_since_s: float | None = None
        self.deaf = 0  # failed receives since it last worked
        self.retry_s = 0.0
        self.out_s = 0.0  # of all outages that are over
        self.reason = ""


class ExternalBuses(WaitablePort):
    """The drives' end of the buses in `settings`, by name.

    Raises:
        InfrastructureError: one of them can't be opened.
    """

    def __init__(self, settings: Mapping[str, Settings], *, clock: Clock = SYSTEM_CLOCK) -> None:
        self._clock = clock
        self._all = {name: _Attachment(name, bus) for name, bus in settings.items()}
        self._by_fd: dict[int, _Attachment] = {}
        self._epoll = select.epoll()
        self._polled = 0
        self._failing = 0
        try:
            for attachment in self._all.values():
                self._open(attachment)
        except InfrastructureError:
            self.close("")
            raise

    # --- the drives' end -------------------------------------------------------------------------

    def deliver(self, name: str, stamp_ns: int, frames: Sequence[Frame]) -> None:  # noqa: ARG002
        """Send frames of the drives, in order; what can't be sent is dropped and counted."""
        attachment = self._all[name]
        bus, echoes = attachment.bus, attachment.echoes
        for n, frame in enumerate(frames):
            try:
                if bus is not None:
                    bus.send(to_message(frame.can_id, frame.data))
                    if echoes is not None:
                        echoes.sent(frame, self._clock.monotonic_s())
            except _FAILURES as error:
                self._note_failure(attachment, error)
                bus = None
            if bus is None:
                attachment.counters.dropped += len(frames) - n
                return
        if attachment.failing_since_s is not None and frames:
            self._note_recovery(attachment)

    def serve(self, timeout_s: float) -> None:
        """Take what came on the buses; waits at most `timeout_s`, to the microsecond."""
        if readable([self._epoll], self.patience(timeout_s)):
            for fd, _ in self._epoll.poll(0.0):
                self._receive(self._by_fd[fd])
        if self._polled:
            for attachment in self._all.values():
                if attachment.fd is None and attachment.bus is not None:
                    self._receive(attachment)
        if self._failing:
            self._reopen()

    def patience(self, timeout_s: float) -> float:
        """How long one may wait for `fileno`, if `timeout_s` at most."""
        return max(min(timeout_s, POLL_S) if self._polled else timeout_s, 0.0)

    def pending(self) -> list[str]:
        """Buses with something to take."""
        return [name for name, attachment in self._all.items() if attachment.taken]

    def receive(self, name: str) -> list[Frame]:
        """What others sent on a bus since the last take, in order."""
        attachment = self._all[name]
        taken, attachment.taken = attachment.taken, []
        return taken

    def clients(self) -> int:
        """Number of open buses: their listeners are unknown."""
        return sum(attachment.bus is not None for attachment in self._all.values())

    def troubles(self) -> dict[str, str]:
        """Buses with outages: their number, duration, last error; with lost and strange frames."""
        now_s = self._clock.monotonic_s()
        found = {}
        for name, attachment in self._all.items():
            counters, since_s = attachment.counters, attachment.failing_since_s
            said = []
            if counters.outages:
                out_s = attachment.out_s + (now_s - since_s if since_s is not None else 0.0)
                said.append(
                    f"{counters.outages} × failed for {out_s:.1f} s in all, {counters.dropped}"
                    f" frames lost; last: {attachment.reason}"
                )
            elif counters.dropped:
                said.append(f"{counters.dropped} frames lost")
            if counters.error_frames:
                said.append(f"{counters.error_frames} error frames")
            if counters.garbage:
                said.append(f"{counters.garbage} × no frame of classic CAN")
            if said:
                found[name] = "; ".join(said)
        return found

    def fileno(self) -> int:
        """A descriptor that is readable when there is something to handle."""
        return self._epoll.fileno()

    def close(self, reason: str) -> None:  # noqa: ARG002 - an external bus has no goodbye
        """Leave all buses. Idempotent."""
        for attachment in self._all.values():
            self._shut(attachment)
        self._epoll.close()

    # --- one bus ---------------------------------------------------------------------------------

    def _open(self, attachment: _Attachment) -> None:
        bus = attachment.bus = open_bus(f"drives of {attachment.name}", attachment.settings)
        try:
            fd = bus.fileno()
            self._epoll.register(fd, select.EPOLLIN)
        # It has no descriptor, -1, or one that epoll doesn't take, such as a file's.
        except (NotImplementedError, OSError, ValueError):
            self._polled += 1
            return
        attachment.fd = fd
        self._by_fd[fd] = attachment

    def _shut(self, attachment: _Attachment) -> None:
        bus, attachment.bus = attachment.bus, None
        if bus is None:
            return
        if attachment.fd is None:
            self._polled -= 1
        else:
            del self._by_fd[attachment.fd]
            with contextlib.suppress(OSError):
                self._epoll.unregister(attachment.fd)
            attachment.fd = None
        with contextlib.suppress(*_FAILURES):
            bus.shutdown()

    def _receive(self, attachment: _Attachment) -> None:
        bus, counters, taken = attachment.bus, attachment.counters, attachment.taken
        for _ in range(AT_ONCE):
            try:
                message = bus.recv(0.0) if bus is not None else None
            except _FAILURES as error:
                self._note_failure(attachment, error)
                attachment.deaf += 1
                if attachment.deaf > 1:  # in a row: a dead descriptor stays readable for ever
                    self._shut(attachment)
                return
            if message is None:
                return
            if message.is_error_frame:
                counters.error_frames += 1
                continue
            try:
                frame = to_frame(message)
            except ValueError:
                counters.garbage += 1
                continue
            if attachment.echoes is not None and attachment.echoes.is_echo(
                frame, self._clock.monotonic_s()
            ):
                continue
            if attachment.failing_since_s is not None:
                self._note_recovery(attachment)
            if len(taken) < BACKLOG:
                taken.append(frame)
            else:
                counters.dropped += 1

    def _note_failure(self, attachment: _Attachment, error: Exception) -> None:
        attachment.reason = str(error)
        if attachment.failing_since_s is None:
            attachment.failing_since_s = self._clock.monotonic_s()
            attachment.retry_s = attachment.failing_since_s + REOPEN_S
            attachment.counters.outages += 1
            self._failing += 1

    def _note_recovery(self, attachment: _Attachment) -> None:
        if attachment.failing_since_s is not None:
            attachment.out_s += self._clock.monotonic_s() - attachment.failing_since_s
            attachment.failing_since_s = None
            attachment.deaf = 0
            self._failing -= 1

    def _reopen(self) -> None:
        now_s = self._clock.monotonic_s()
        for attachment in self._all.values():
            if attachment.failing_since_s is None or now_s < attachment.retry_s:
                continue
            attachment.retry_s = now_s + REOPEN_S
            self._shut(attachment)
            try:
                self._open(attachment)
            except InfrastructureError as error:
                attachment.reason = str(error)


class CombinedPort(DrivePort):
    """Two ends as one; each bus is on one of them."""

    def __init__(self, ours: WaitablePort, others: ExternalBuses, names: Sequence[str]) -> None:
        self._ours = ours
        self._others = others
        self._of_others = frozenset(names)
        self._both: tuple[WaitablePort, ...] = (ours, others)

    def _end_of(self, name: str) -> DrivePort:
        return self._others if name in self._of_others else self._ours

    def deliver(self, name: str, stamp_ns: int, frames: Sequence[Frame]) -> None:
        """Send frames of the drives, in order, over a bus at bus time `stamp_ns`."""
        self._end_of(name).deliver(name, stamp_ns, frames)

    def serve(self, timeout_s: float) -> None:
        """Handle what happens on the buses; waits at most `timeout_s`."""
        readable(self._both, self._others.patience(timeout_s))
        for end in self._both:
            end.serve(0.0)

    def pending(self) -> list[str]:
        """Buses with something to take."""
        return [name for end in self._both for name in end.pending()]

    def receive(self, name: str) -> list[Frame]:
        """What others sent on a bus since the last take, in order."""
        return self._end_of(name).receive(name)

    def clients(self) -> int:
        """Number of buses or clients that may be listening."""
        return sum(end.clients() for end in self._both)

    def troubles(self) -> dict[str, str]:
        """Buses that failed at times, and how."""
        return self._ours.troubles() | self._others.troubles()

    def close(self, reason: str) -> None:
        """Leave all buses. Idempotent."""
        for end in self._both:
            end.close(reason)
