"""Drive protocols: a folder each, and a row of `configs.drives.DRIVES` that says where it is.

A row is a `DriveProtocol`: the controller's end of a robot's two drives, the emulated drive of one
wheel, and what tools know of the protocol.
"""

from bridge.drives.interface import DriveProtocol
from configs.drives import DRIVES, load


def protocol(name: str) -> DriveProtocol:
    """The protocol of a scenario's `drive.protocol`.

    Raises:
        ScenarioError: there is none of that name.
    """
    found: DriveProtocol = load(name)
    return found


def protocols() -> list[DriveProtocol]:
    """All protocols that are shipped."""
    return [protocol(name) for name in DRIVES]
