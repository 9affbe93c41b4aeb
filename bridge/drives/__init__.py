"""Drive protocols: a folder each, and a row of `configs.drives.DRIVES` that says where it is.

A row is a `DriveProtocol`: the controller's end of a robot's two drives, the emulated drive of one
wheel, and what tools know of the protocol.
"""

from bridge.drives.interface import DriveProtocol
from configs.plugins import Plugin, load


def protocol(plugin: Plugin) -> DriveProtocol:
    """The protocol of a scenario's `drive.protocol`.

    Raises:
        PluginError: its module fails, or has no such row.
    """
    found: DriveProtocol = load(plugin)
    return found
