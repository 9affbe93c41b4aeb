"""`fleetloop can endpoints`: endpoints in the form of the vendor's `flat_endpoints.json`.

Scripts that read or write parameters over CAN take the numbers of endpoints from that file, and
refuse one whose versions aren't those that Get_Version says. A bus that is up is asked for them:
the first drive that is heard, with a remote frame, as any host may.
"""

import json
import re
import time
from pathlib import Path
from typing import NamedTuple

import can

from bridge.can_bus.interface import FleetloopBus
from bridge.can_bus.pythoncan import to_frame, to_message
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.endpoints import flat_endpoints
from bridge.drives.odrive.frames import Command
from bridge.drives.odrive.reports import HARDWARE
from bridge.frame import Frame
from configs.errors import InfrastructureError, ScenarioError
from configs.sections import Drive
from fleetloop.can.client import open_bus
from fleetloop.terminal import note, say

HEARD_S = 5.0
"""How long a drive may take to be heard, and to answer."""


class Versions(NamedTuple):
    """What Get_Version says."""

    firmware: tuple[int, int, int]
    hardware: tuple[int, int, int]


def write_endpoints(bus: str | None, firmware: str | None, out: Path | None) -> int:
    """Print the table, or write it to a file; return the exit status.

    Raises:
        ScenarioError: a version that no emulated drive has, a file that can't be written, or both
            a bus and a version.
        InfrastructureError: no such bus, or no drive on it.
    """
    if bus is None:
        versions = Versions(_parsed(firmware or Drive().firmware), HARDWARE)
    elif firmware is not None:
        raise ScenarioError(f"--fw-version {firmware}: {bus} says itself which firmware it has")
    else:
        with open_bus(bus) as opened:
            versions = ask(opened, bus, HEARD_S)
    text = json.dumps(flat_endpoints(*versions), indent=2)
    if out is None:
        say(text)
        return 0
    try:
        out.write_text(text + "\n")
    except OSError as error:
        raise ScenarioError(f"--out {out}: {error.strerror}") from error
    note(f"{out}: endpoints of firmware {'.'.join(map(str, versions.firmware))}")
    return 0


def ask(bus: FleetloopBus, name: str, within_s: float) -> Versions:
    """The versions of a drive on a bus.

    Raises:
        InfrastructureError: none is heard or answers in time, or the bus ended.
    """
    deadline = time.monotonic() + within_s
    node: int | None = None
    try:
        while (left_s := deadline - time.monotonic()) > 0.0:
            message = bus.recv(left_s)
            frame = to_frame(message) if message is not None else Frame(0, b"")
            if node is None and _is_heartbeat(frame):
                node = frame.can_id >> f.BITS
                bus.send(to_message(*f.request(node, Command.GET_VERSION)), left_s)
            elif node is not None and _is_version(frame, node):
                said = f.VERSION.unpack(frame.data)
                return Versions((said[4], said[5], said[6]), (said[1], said[2], said[3]))
    except can.CanError as error:
        raise InfrastructureError(str(error)) from error
    silent = "no drive's heartbeat" if node is None else f"no Get_Version of node {node}"
    raise InfrastructureError(f"bus {name!r}: {silent} within {within_s:g} s")


def _is_heartbeat(frame: Frame) -> bool:
    can_id, data = frame
    command = can_id & ((1 << f.BITS) - 1)
    return can_id < 1 << 11 and command == Command.HEARTBEAT and len(data) == f.HEARTBEAT.size


def _is_version(frame: Frame, node: int) -> bool:
    can_id, data = frame
    return can_id == f.identifier(node, Command.GET_VERSION) and len(data) == f.VERSION.size


def _parsed(text: str) -> tuple[int, int, int]:
    found = re.fullmatch(r"(0)\.(6)\.([0-9]{1,2})", text)
    if found is None:
        raise ScenarioError(f"--fw-version {text}: right is 0.6 and a revision, e.g. 0.6.10")
    major, minor, revision = (int(part) for part in found.groups())
    return major, minor, revision
