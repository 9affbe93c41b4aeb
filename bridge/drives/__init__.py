"""Drive protocols: a folder each, and a row of `configs.drives.DRIVES` that says where it is.

A row is a `DriveProtocol`: the controller's end of a robot's two drives, the emulated drive of one
wheel, and what tools know of the protocol.
"""

from bridge.drives.interface import DriveProtocol
from configs.drives import DRIVES
from configs.plugins import Kind, Plugin, find, load


def protocol(plugin: Plugin) -> DriveProtocol:
    """The protocol of a scenario's `drive.protocol`.

    Raises:
        PluginError: its module fails, or has no such row.
    """
    found: DriveProtocol = load(plugin)
    return found


def protocols() -> list[DriveProtocol]:
    """All protocols that are shipped."""
    return [protocol(find(Kind.DRIVE, name, "", DRIVES)) for name in DRIVES]
