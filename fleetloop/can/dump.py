"""`fleetloop can dump`: the traffic of buses, as candump prints it.

    console     (0000000012.345678)  r1  009   [8]  00 00 80 3F 00 00 00 00
    log (-L)   (0000000012.345678) r1 009#0000803F00000000

Times are bus time: seconds since the bus was powered up. Ends with the run, after `count` frames or
a silence, when the reader closes, or by a signal (exit status 130). A silence is waited for in the
kernel, by the system's clock.
"""

import contextlib
import io
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TextIO

from bridge.can_bus import sockets
from bridge.drives.interface import DriveProtocol
from bridge.frame import EFF, Frame
from bridge.process.clock import SYSTEM_CLOCK, local_date
from configs.errors import ExitStatus, ScenarioError
from fleetloop.can import error_frames, filters, text
from fleetloop.can.client import Heard, Listener, open_bus
from fleetloop.can.decoder import protocol_of
from fleetloop.can.filters import Filter
from fleetloop.signals import interruptible
from fleetloop.streams import forget_output
from fleetloop.terminal import note

ANY = "any"
STAMPS = "adzA"


@dataclass(frozen=True, slots=True)
class DumpOptions:
    """Format of printed frames, and conditions to end."""

    stamps: str = ""  # of STAMPS, or empty
    nanoseconds: bool = False
    log_format: bool = False
    ascii_too: bool = False
    explain_errors: bool = False
    decode: bool = False
    drives: DriveProtocol = field(default_factory=protocol_of)
    """The protocol that `decode` knows."""
    count: int | None = None
    silence_s: float | None = None

    def check(self) -> None:
        """Raise ScenarioError for what doesn't go together."""
        if self.stamps and self.stamps not in STAMPS:
            raise ScenarioError(f"-t {self.stamps}: right are a, d, z and A")
        if self.log_format and (self.ascii_too or self.explain_errors or self.decode):
            raise ScenarioError("-L is for programs: it doesn't go with -a, -e or --decode")


class Stamps:
    """Time stamps as candump writes them, with the blank after them."""

    __slots__ = ("_first_ns", "_kind", "_nanoseconds")

    def __init__(self, kind: str, *, nanoseconds: bool) -> None:
        self._kind = kind
        self._nanoseconds = nanoseconds
        self._first_ns: int | None = None

    def text(self, stamp_ns: int) -> str:
        """The stamp of a frame, empty if none is wanted."""
        kind = self._kind
        if not kind:
            return ""
        if kind in "dz":
            if self._first_ns is None:
                self._first_ns = stamp_ns
            elapsed_ns = max(stamp_ns - self._first_ns, 0)
            if kind == "d":
                self._first_ns = stamp_ns
            seconds, rest_ns = divmod(elapsed_ns, 1_000_000_000)
            return f"({seconds:03}.{self._fraction(rest_ns)}) "
        seconds, rest_ns = divmod(stamp_ns, 1_000_000_000)
        if kind == "A":
            date = local_date(stamp_ns)
            return f"({date:%Y-%m-%d %H:%M:%S}.{self._fraction(rest_ns)}) "
        return f"({seconds:010}.{self._fraction(rest_ns)}) "

    def _fraction(self, rest_ns: int) -> str:
        return f"{rest_ns:09}" if self._nanoseconds else f"{rest_ns // 1000:06}"


class Printer:
    """Lines of frames; an 11-bit identifier moves right once a 29-bit one was seen."""

    __slots__ = ("_indent", "_options", "_stamps", "_width")

    def __init__(self, options: DumpOptions, names: Sequence[str]) -> None:
        kind = options.stamps
        if options.log_format and kind != "z":
            kind = "a"
        self._options = options
        self._stamps = Stamps(kind, nanoseconds=options.nanoseconds)
        self._width = max(map(len, names), default=0)
        self._indent = False

    def lines(self, heard: Heard) -> str:
        """The text of a frame, newlines included."""
        bus, frame, stamp_ns = heard
        stamp = self._stamps.text(stamp_ns)
        if self._options.log_format:
            return f"{stamp}{bus:>{self._width}} {text.compact(frame)}\n"
        if frame.can_id & EFF:
            self._indent = True
        shown = text.long(frame, indent=self._indent, ascii_too=self._options.ascii_too)
        return f" {stamp} {bus:>{self._width}}  {self._with_words(shown, frame)}\n"

    def _with_words(self, shown: str, frame: Frame) -> str:
        if self._options.explain_errors:
            shown += "".join(f"\n\t{line}" for line in error_frames.explain(frame))
        if self._options.decode and (said := self._options.drives.words(frame)):
            columns = text.long_columns(indent=self._indent)
            shown = f"{shown:<{columns}}   {said}"
        return shown


@interruptible
def dump(targets: Sequence[str], options: DumpOptions) -> int:
    """Print the frames of buses, each named as `BUS[,filter]*`; return the exit status.

    Raises:
        ScenarioError: a filter or an option is wrong.
        InfrastructureError: a bus isn't there.
    """
    options.check()
    wanted = _wanted(targets)
    with contextlib.ExitStack() as opened:
        buses = {
            name: opened.enter_context(open_bus(channel, batched=True))
            for name, (channel, _) in wanted.items()
        }
        with Listener(buses, _descriptor(sys.stdout)) as listener:
            passes = {name: filtered for name, (_, filtered) in wanted.items()}
            try:
                _print_all(listener, passes, options)
                sys.stdout.flush()
            except KeyboardInterrupt:
                return ExitStatus.INTERRUPTED
            except BrokenPipeError:
                listener.abandoned = True
            if listener.abandoned:
                forget_output()
                return ExitStatus.OK
            for farewell in listener.farewells:
                note(f"fleetloop: {farewell}")
            return 3 if listener.broken else 0


def _wanted(targets: Sequence[str]) -> dict[str, tuple[str, Filter]]:
    """Channels and filters by the name to print."""
    parsed = [filters.parse(target) for target in targets]
    channels: list[tuple[str, Filter]] = []
    for channel, filtered in parsed:
        if channel == ANY:
            channels += [(sockets.name_of(path), filtered) for path in sockets.live_buses()]
        else:
            channels.append((channel, filtered))
    if not channels:
        raise sockets.NoSuchBusError("no bus is up: none is running here")
    counts = Counter(_short(channel) for channel, _ in channels)
    wanted: dict[str, tuple[str, Filter]] = {}
    for channel, filtered in channels:
        name = _short(channel) if counts[_short(channel)] == 1 else channel
        if name in wanted:
            raise ScenarioError(f"bus {channel} is named twice")
        wanted[name] = (channel, filtered)
    return wanted


def _short(channel: str) -> str:
    return channel.rpartition("/")[2].removesuffix(sockets.SUFFIX)


def _print_all(listener: Listener, wanted: dict[str, Filter], options: DumpOptions) -> None:
    printer = Printer(options, list(wanted))
    write, flush = sys.stdout.write, sys.stdout.flush
    left = options.count if options.count is not None else sys.maxsize
    silent_at = _deadline(options.silence_s)
    while not listener.over:
        wait_s = None if silent_at is None else silent_at - SYSTEM_CLOCK.monotonic_s()
        if wait_s is not None and wait_s <= 0:
            return
        heard = [
            item for item in listener.listen(wait_s) if wanted[item.bus].passes(item.frame.can_id)
        ]
        if not heard:
            continue
        heard = heard[:left]
        left -= len(heard)
        write("".join(map(printer.lines, heard)))
        flush()
        if not left:
            return
        silent_at = _deadline(options.silence_s)


def _deadline(silence_s: float | None) -> float | None:
    return None if silence_s is None else SYSTEM_CLOCK.monotonic_s() + silence_s


def _descriptor(stream: TextIO) -> int | None:
    try:
        return stream.fileno()
    except (io.UnsupportedOperation, ValueError):
        return None
