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
from bridge.drives.interface import EndpointFile, Versions
from bridge.process.clock import SYSTEM_CLOCK
from configs.drives import DEFAULT
from configs.errors import ExitStatus, InfrastructureError, ScenarioError
from fleetloop.can.client import open_bus
from fleetloop.can.decoder import protocol_of
from fleetloop.terminal import note, say

HEARD_S = 5.0
"""Longest wait for a drive's first frame, and for its answer."""


def write_endpoints(
    bus: str | None, firmware: str | None, out: Path | None, protocol_name: str = DEFAULT
) -> int:
    """Print the table, or write it to a file; return the exit status.

    Raises:
        ScenarioError: no such protocol, or one without endpoints; a version that no emulated drive
            has, a file that can't be written, or both a bus and a version.
        InfrastructureError: no such bus, or no drive on it.
    """
    file = endpoint_file(protocol_name)
    if bus is None:
        try:
            versions = file.versions_of(firmware)
        except ValueError as error:
            raise ScenarioError(f"--fw-version {firmware}: {error}") from error
    elif firmware is not None:
        raise ScenarioError(f"--fw-version {firmware}: {bus} says itself which firmware it has")
    else:
        with open_bus(bus) as opened:
            versions = ask(opened, bus, HEARD_S, file)
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


def ask(bus: FleetloopBus, name: str, within_s: float, file: EndpointFile) -> Versions:
    """The versions of a drive on a bus; time passes in `bus.recv` alone, by the system's clock.

    Raises:
        InfrastructureError: none is heard or answers in time, or the bus ended.
    """
    query = file.query()
    deadline = SYSTEM_CLOCK.monotonic_s() + within_s
    try:
        while query.versions is None and (left_s := deadline - SYSTEM_CLOCK.monotonic_s()) > 0.0:
            message = bus.recv(left_s)
            request = query.on_frame(to_frame(message)) if message is not None else None
            if request is not None:
                bus.send(to_message(request.can_id, request.data), left_s)
    except can.CanError as error:
        raise InfrastructureError(str(error)) from error
    if query.versions is None:
        raise InfrastructureError(f"bus {name!r}: {query.missing} within {within_s:g} s")
    return query.versions


def endpoint_file(protocol_name: str = DEFAULT) -> EndpointFile:
    """The file of a protocol's drives.

    Raises:
        ScenarioError: no such protocol, or its drives have no such file.
    """
    file = protocol_of(protocol_name).endpoints
    if file is None:
        raise ScenarioError(f"--protocol {protocol_name}: its drives have no file of endpoints")
    return file
