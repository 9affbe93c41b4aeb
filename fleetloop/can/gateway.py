"""`fleetloop can gateway`: joins a bus to another python-can bus, both ways.

    came from      what                         happens
    either         classic data, remote         sent to the other, never back
    either         error frame                  counted; it is the state of one wire, not data
    far            FD frame                     counted; ours is classic CAN
    far            what is no frame at all      counted; some interfaces hand it out
    far            its echo of ours             dropped (see `fleetloop.can.echo`)

A full far bus loses what waits for it, so a stall there ends in a gap and not in old set-points.
Our bus ends with its run: the gateway says so and ends with 0. When the far bus is lost, it ends
with 3, or tries for `retry_s` to open it again; what our bus says meanwhile is lost and counted.
"""

import contextlib
import threading
from dataclasses import dataclass, field

import can

from bridge.can_bus.pythoncan import BusClosedError, to_frame, to_message
from bridge.process.clock import SYSTEM_CLOCK, Clock
from configs.errors import ExitStatus, InfrastructureError
from fleetloop.can.client import open_bus
from fleetloop.can.echo import EchoGuard
from fleetloop.can.far_bus import FarBus
from fleetloop.signals import interruptible
from fleetloop.terminal import note, say

SEND_S = 0.01
WAIT_S = 0.1
RETRY_EVERY_S = 0.5
FAILURES = 10
"""So many failures in a row mean that the far bus is lost; one may be a stranger's datagram."""


@dataclass(slots=True)
class GatewayCounters:
    """Frames forwarded and dropped in one direction."""

    passed: int = 0
    lost: int = 0
    error_frames: int = 0
    echoes: int = 0
    fd_frames: int = 0
    no_frames: int = 0
    most_per_s: int = 0
    _second: int = 0
    _in_second: int = 0

    def passes(self, now_s: float) -> None:
        """One frame was passed on."""
        self.passed += 1
        if int(now_s) != self._second:
            self._second, self._in_second = int(now_s), 0
        self._in_second += 1
        self.most_per_s = max(self.most_per_s, self._in_second)

    def words(self) -> str:
        """For people."""
        parts = [f"{self.passed} frames"]
        for count, what in (
            (self.lost, "lost"),
            (self.echoes, "own echoes dropped"),
            (self.error_frames, "error frames not passed on"),
            (self.fd_frames, "FD frames not passed on"),
            (self.no_frames, "that are no frames of CAN not passed on"),
        ):
            if count:
                parts.append(f"{count} {what}")
        return ", ".join(parts)


@dataclass(slots=True)
class Gateway:
    """Two buses and what went between them; `near` is ours."""

    near: can.BusABC
    far: can.BusABC
    guard: EchoGuard
    outward: GatewayCounters = field(default_factory=GatewayCounters)
    inward: GatewayCounters = field(default_factory=GatewayCounters)
    over: threading.Event = field(default_factory=threading.Event)
    near_gone: can.CanError | None = None
    far_gone: str = ""
    clock: Clock = SYSTEM_CLOCK
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def run(self) -> None:
        """Pass frames on until `over` is set or one of the buses is gone."""
        ways = [threading.Thread(target=way) for way in (self._go_out, self._come_in)]
        for way in ways:
            way.start()
        try:
            self.over.wait()
        finally:
            self.over.set()
            for way in ways:
                way.join()

    # --- from ours to the far one ----------------------------------------------------------------

    def _go_out(self) -> None:
        failures = 0
        try:
            while not self.over.is_set():
                message = self.near.recv(WAIT_S)
                if message is None:
                    continue
                if message.is_error_frame:
                    self.outward.error_frames += 1
                    continue
                try:
                    self._forward_out(message)
                    failures = 0
                except (can.CanError, OSError) as error:
                    failures += 1
                    self.outward.lost += 1 + drain(self.near)
                    if failures > FAILURES:
                        self.far_gone = f"can't send: {error}"
                        return
        except can.CanError as error:
            self.near_gone = error
        finally:
            self.over.set()

    def _forward_out(self, message: can.Message) -> None:
        frame = to_frame(message)
        now_s = self.clock.monotonic_s()
        with self._lock:
            self.guard.sent(frame, now_s)
        # A message of its own: some interfaces take the channel from the message.
        self.far.send(to_message(frame.can_id, frame.data), SEND_S)
        self.outward.passes(now_s)

    # --- from the far one to ours ----------------------------------------------------------------

    def _come_in(self) -> None:
        failures = 0
        try:
            while not self.over.is_set():
                try:
                    message = self.far.recv(WAIT_S)
                except (can.CanError, OSError, ValueError) as error:
                    failures += 1
                    if failures > FAILURES:
                        self.far_gone = str(error)
                        return
                    continue
                failures = 0
                if message is not None:
                    self._forward_in(message)
                if self.guard.storm:
                    self.far_gone = (
                        "what goes out to it comes back: another gateway joins the same two buses,"
                        " or the interface echoes sent frames (then: --echo yes)"
                    )
                    return
        except can.CanError as error:
            self.near_gone = error
        finally:
            self.over.set()

    def _forward_in(self, message: can.Message) -> None:
        counters = self.inward
        if message.is_error_frame:
            counters.error_frames += 1
            return
        if message.is_fd:
            counters.fd_frames += 1
            return
        try:
            frame = to_frame(message)
        except ValueError:
            counters.no_frames += 1
            return
        now_s = self.clock.monotonic_s()
        with self._lock:
            echo = self.guard.is_echo(frame, now_s)
        if echo:
            counters.echoes += 1
            return
        try:
            self.near.send(to_message(frame.can_id, frame.data), WAIT_S)
        except BusClosedError:
            raise
        except can.CanOperationError:
            # A full bus of ours loses the frame; whether it is gone, its reader finds out.
            counters.lost += 1
            return
        counters.passes(now_s)


@interruptible
def join(
    channel: str,
    far_bus: FarBus,
    *,
    retry_s: float = 0.0,
    with_rates: bool = False,
    clock: Clock = SYSTEM_CLOCK,
) -> int:
    """Join a bus to another until its run ends or a signal comes; return the exit status.

    Raises:
        InfrastructureError: one of the buses can't be opened.
    """
    ways = GatewayCounters(), GatewayCounters()
    start = clock.monotonic_s()
    with contextlib.ExitStack() as until_joined:
        far = until_joined.enter_context(far_bus.open())
        near = open_bus(channel)
        until_joined.pop_all()  # from here on, who passes on closes what it passes on to
    with near:
        note(f"joined {channel} and {far_bus.name}; Ctrl-C ends it")
        try:
            status = _pass_on(near, far, far_bus, ways, retry_s, clock)
        except KeyboardInterrupt:
            status = ExitStatus.INTERRUPTED
    wall_s = clock.monotonic_s() - start
    names = (f"{channel} → {far_bus.name}", f"{far_bus.name} → {channel}")
    for name, counters in zip(names, ways, strict=True):
        rates = f"; {counters.passed / wall_s:.0f}/s, at most {counters.most_per_s} in a second"
        say(f"{name}: {counters.words()}{rates if with_rates else ''}")
    return status


def _pass_on(
    near: can.BusABC,
    far: can.BusABC,
    far_bus: FarBus,
    ways: tuple[GatewayCounters, GatewayCounters],
    retry_s: float,
    clock: Clock,
) -> int:
    """Pass frames on, over as many openings of the far bus as it takes; the exit status."""
    reopened: can.BusABC | None = far
    try:
        while reopened is not None:
            with reopened as current:
                guard = EchoGuard(echoes=far_bus.echoes)
                gateway = Gateway(near, current, guard, *ways, clock=clock)
                gateway.run()
            if gateway.near_gone is not None:
                raise gateway.near_gone
            note(f"fleetloop: {far_bus.name}: {gateway.far_gone}")
            if gateway.guard.storm:
                return ExitStatus.INFRASTRUCTURE
            reopened = _reopen(far_bus, near, ways[0], retry_s, clock)
    except can.CanError as gone:
        note(f"fleetloop: {gone}")
        return ExitStatus.OK if isinstance(gone, BusClosedError) else ExitStatus.INFRASTRUCTURE
    return ExitStatus.INFRASTRUCTURE


def drain(bus: can.BusABC) -> int:
    """Drop what waits on a bus; return how many frames that were."""
    dropped = 0
    while bus.recv(0.0) is not None:
        dropped += 1
    return dropped


def _reopen(
    far_bus: FarBus, near: can.BusABC, outward: GatewayCounters, retry_s: float, clock: Clock
) -> can.BusABC | None:
    deadline = clock.monotonic_s() + retry_s
    while clock.monotonic_s() < deadline:
        clock.sleep(RETRY_EVERY_S)
        outward.lost += drain(near)
        try:
            far = far_bus.open()
        except InfrastructureError:
            continue
        note(f"opened {far_bus.name} again")
        return far
    return None
