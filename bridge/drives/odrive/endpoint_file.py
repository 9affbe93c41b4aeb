"""The vendor's `flat_endpoints.json`, for the versions that a drive reports in Get_Version.

Scripts that read or write parameters over CAN take the numbers of endpoints from that file, and
refuse one whose versions aren't the drive's.
"""

import re
from collections.abc import Mapping

from bridge.drives.interface import VersionQuery, Versions
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.endpoints import flat_endpoints
from bridge.drives.odrive.frames import Command
from bridge.drives.odrive.reports import HARDWARE
from bridge.drives.odrive.section import OdriveSection
from bridge.frame import Frame


class FlatEndpoints:
    """The file for an emulated firmware, or for the first drive found on a bus."""

    def versions_of(self, firmware: str | None) -> Versions:
        """The versions of an emulated drive; None: of the firmware that drives have by default.

        Raises:
            ValueError: no emulated drive has this firmware.
        """
        found = re.fullmatch(r"(0)\.(6)\.([0-9]{1,2})", firmware or OdriveSection().firmware)
        if found is None:
            raise ValueError("right is 0.6 and a revision, e.g. 0.6.10")
        major, minor, revision = (int(part) for part in found.groups())
        return Versions((major, minor, revision), HARDWARE)

    def query(self) -> VersionQuery:
        """Get_Version of the first drive with a heartbeat."""
        return GetVersion()

    def contents(self, versions: Versions) -> Mapping[str, object]:
        """The file of these versions."""
        return flat_endpoints(versions.firmware, versions.hardware)


class GetVersion:
    """Get_Version with a remote frame, as any host may send it."""

    def __init__(self) -> None:
        self.versions: Versions | None = None
        self._node: int | None = None

    def on_frame(self, frame: Frame) -> Frame | None:
        """Process a frame from the bus; return the request at the first heartbeat."""
        can_id, data = frame.can_id, frame.data
        if self._node is None:
            command = can_id & ((1 << f.BITS) - 1)
            if can_id < 1 << 11 and command == Command.HEARTBEAT and len(data) == f.HEARTBEAT.size:
                self._node = can_id >> f.BITS
                return f.request(self._node, Command.GET_VERSION)
        elif can_id == f.identifier(self._node, Command.GET_VERSION) and (
            len(data) == f.VERSION.size
        ):
            said = f.VERSION.unpack(data)
            self.versions = Versions((said[4], said[5], said[6]), (said[1], said[2], said[3]))
        return None

    @property
    def missing(self) -> str:
        """The frame that is still awaited, in words."""
        if self._node is None:
            return "no drive's heartbeat"
        return f"no Get_Version of node {self._node}"
