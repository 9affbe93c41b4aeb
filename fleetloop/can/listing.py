"""`fleetloop can list`: the buses that are up, their clients and drives, their load.

It joins every bus for a short while and listens; that changes nothing for the run. How many clients
a bus has is the kernel's word: connections to the bus's socket (`/proc/net/unix`).
"""

import contextlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from bridge.can_bus import sockets
from bridge.drives.interface import DriveProtocol
from bridge.process.clock import SYSTEM_CLOCK
from configs.drives import DEFAULT
from configs.errors import ExitStatus, InfrastructureError
from fleetloop.can.census import Census, Node
from fleetloop.can.client import Listener, open_bus
from fleetloop.can.decoder import protocol_of
from fleetloop.signals import interruptible
from fleetloop.terminal import note, say

_CONNECTED = "03"


@dataclass(frozen=True, slots=True)
class BusReport:
    """Observations of one bus; None: unknown."""

    run: str
    bus: str
    clients: int | None
    frames_per_s: float | None
    load: float | None
    bit_rate: int
    bus_time_s: float | None
    real_time_factor: float | None
    error_frames: int
    other_frames: int
    nodes: tuple[Node, ...]
    problem: str = ""


@interruptible
def list_buses(
    *, seconds: float, bit_rate: int, as_json: bool, protocol_name: str = DEFAULT
) -> int:
    """Listen to all buses for `seconds` and print what there is; return the exit status.

    Raises:
        ScenarioError: there is no such protocol.
    """
    drives = protocol_of(protocol_name)
    try:
        reports = survey(seconds, bit_rate, drives)
    except KeyboardInterrupt:
        return ExitStatus.INTERRUPTED
    if as_json:
        say(json.dumps([asdict(report) for report in reports], indent=2))
    elif reports:
        say(table(reports, bit_rate))
        for report in reports:
            if report.problem:
                note(f"fleetloop: {report.run}/{report.bus}: {report.problem}")
    else:
        note(f"no bus is up in {sockets.base_folder()}")
    return ExitStatus.OK


def survey(seconds: float, bit_rate: int, drives: DriveProtocol) -> list[BusReport]:
    """Listen to all buses at once; one that doesn't answer costs a little more time.

    Time passes in `listen` alone, which waits for sockets: it is the system clock's.
    """
    clients = connections(Path("/proc/net/unix"))  # before this process adds its own
    paths = sockets.live_buses()
    problems: dict[str, str] = {}
    with contextlib.ExitStack() as opened:
        buses = {}
        for path in paths:
            try:
                buses[str(path)] = opened.enter_context(open_bus(str(path), batched=True))
            except InfrastructureError as error:
                problems[str(path)] = str(error)
        census = {name: Census(bit_rate, drives) for name in buses}
        with Listener(buses) as listener:
            listener.listen(0.0)  # what gathered while the others were opened
            start = SYSTEM_CLOCK.monotonic_s()
            while not listener.over and (left := start + seconds - SYSTEM_CLOCK.monotonic_s()) > 0:
                for name, frame, stamp_ns in listener.listen(left):
                    census[name].count(frame, stamp_ns)
            wall_s = SYSTEM_CLOCK.monotonic_s() - start
    return [
        _report(path, census.get(str(path)), clients, wall_s, problems.get(str(path), ""))
        for path in paths
    ]


def connections(table: Path) -> Mapping[str, int] | None:
    """Connections by path of a Unix socket, from the kernel's table; None if it isn't readable."""
    try:
        lines = table.read_text("utf-8", "surrogateescape").splitlines()[1:]
    except OSError:
        return None
    counts: dict[str, int] = {}
    for line in lines:
        fields = line.split(maxsplit=7)
        if len(fields) == 8:
            counts[fields[7]] = counts.get(fields[7], 0) + (fields[5] == _CONNECTED)
    return counts


def _report(
    path: Path,
    census: Census | None,
    clients: Mapping[str, int] | None,
    wall_s: float,
    problem: str,
) -> BusReport:
    seen = census if census is not None else Census(1)
    # A bus that isn't in the table lives where another kernel table counts (a container's).
    return BusReport(
        run=path.parent.name,
        bus=path.name.removesuffix(sockets.SUFFIX),
        clients=clients.get(str(path)) if clients is not None else None,
        frames_per_s=seen.rate,
        load=seen.load,
        bit_rate=seen.bit_rate,
        bus_time_s=seen.bus_time_s,
        real_time_factor=seen.seconds / wall_s if seen.seconds > 0 else None,
        error_frames=seen.error_frames,
        other_frames=seen.other_frames,
        nodes=tuple(seen.nodes),
        problem=problem,
    )


def table(reports: list[BusReport], bit_rate: int) -> str:
    """The reports as lines."""
    rows = [
        ("BUS", "CLIENTS", "BUS TIME", "SPEED", "FRAMES/S", "LOAD", "NODES"),
        *map(_row, reports),
    ]
    lines = []
    run = ""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    shown = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
    for report, line in zip(reports, shown[1:], strict=True):
        if report.run != run:
            lines += ["", f"run {report.run}", "  " + shown[0]]
            run = report.run
        lines.append("  " + line)
    lines.append(f"\nload at {bit_rate / 1e6:g} Mbit/s; rates per second of bus time")
    return "\n".join(lines).lstrip("\n")


def _row(report: BusReport) -> tuple[str, ...]:
    return (
        report.bus,
        _shown(report.clients, "{}"),
        _shown(report.bus_time_s, "{:.2f} s"),
        _shown(report.real_time_factor, "{:.2f} ×"),
        _shown(report.frames_per_s, "{:.0f}"),
        _shown(report.load, "{:.1%}"),
        _nodes(report) or "none heard",
    )


def _nodes(report: BusReport) -> str:
    shown = [
        f"{node.node} {node.state}".rstrip()
        + (f" ({node.errors})" if node.errors not in ("", "no error") else "")
        for node in report.nodes
    ]
    if report.error_frames:
        shown.append(f"{report.error_frames} error frames")
    if report.other_frames:
        shown.append(f"{report.other_frames} frames of other protocols")
    return ", ".join(shown)


def _shown(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)
