"""`fleetloop can endpoints`: endpoints in the form of the vendor's `flat_endpoints.json`.

Scripts that read or write parameters over CAN take the numbers of endpoints from that file, and
refuse one whose versions aren't those that Get_Version says. A bus that is up is asked for them:
the first drive that is heard, with a remote frame, as any host may.
"""

import json
from pathlib import Path

import can

from bridge.can_bus.interface import FleetloopBus
from bridge.can_bus.pythoncan import to_frame, to_message
from bridge.drives import protocol
from bridge.drives.interface import EndpointFile, Versions
from bridge.process.clock import SYSTEM_CLOCK
from configs.drives import ODRIVE
from configs.errors import ExitStatus, InfrastructureError, ScenarioError
from fleetloop.can.client import open_bus
from fleetloop.terminal import note, say

HEARD_S = 5.0
"""Longest wait for a drive's first frame, and for its answer."""


def write_endpoints(bus: str | None, firmware: str | None, out: Path | None) -> int:
    """Print the table, or write it to a file; return the exit status.

    Raises:
        ScenarioError: a version that no emulated drive has, a file that can't be written, or both
            a bus and a version.
        InfrastructureError: no such bus, or no drive on it.
    """
    file = _file()
    if bus is None:
        try:
            versions = file.versions_of(firmware)
        except ValueError as error:
            raise ScenarioError(f"--fw-version {firmware}: {error}") from error
    elif firmware is not None:
        raise ScenarioError(f"--fw-version {firmware}: {bus} says itself which firmware it has")
    else:
        with open_bus(bus) as opened:
            versions = ask(opened, bus, HEARD_S)
    text = json.dumps(file.contents(versions), indent=2)
    if out is None:
        say(text)
        return ExitStatus.OK
    try:
        out.write_text(text + "\n")
    except OSError as error:
        raise ScenarioError(f"--out {out}: {error.strerror}") from error
    note(f"{out}: endpoints of firmware {'.'.join(map(str, versions.firmware))}")
    return ExitStatus.OK


def ask(bus: FleetloopBus, name: str, within_s: float) -> Versions:
    """The versions of a drive on a bus.

    Raises:
        InfrastructureError: none is heard or answers in time, or the bus ended.
    """
    query = _file().query()
    deadline = SYSTEM_CLOCK.monotonic_s() + within_s
    try:
        while query.versions is None and (left_s := deadline - SYSTEM_CLOCK.monotonic_s()) > 0.0:
            message = bus.recv(left_s)
            request = query.on_frame(to_frame(message)) if message is not None else None
            if request is not None:
                bus.send(to_message(*request), left_s)
    except can.CanError as error:
        raise InfrastructureError(str(error)) from error
    if query.versions is None:
        raise InfrastructureError(f"bus {name!r}: {query.missing} within {within_s:g} s")
    return query.versions


def _file() -> EndpointFile:
    found = protocol(ODRIVE.plugin).endpoints
    if found is None:
        raise ScenarioError(f"drives of protocol {ODRIVE.name} have no file of endpoints")
    return found
