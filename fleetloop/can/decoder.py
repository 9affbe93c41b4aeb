"""The drive protocol whose frames a tool decodes, by name."""

from pathlib import Path

from bridge.drives import protocol
from bridge.drives.interface import DriveProtocol
from configs.drives import DEFAULT, DRIVES
from configs.errors import ScenarioError
from configs.plugins import Kind, PluginError, find


def protocol_of(name: str = DEFAULT) -> DriveProtocol:
    """The protocol of an option `--protocol`: shipped, or module:ROW of the current folder.

    Raises:
        ScenarioError: there is none of that name, or its module fails.
    """
    here = "in the current folder"
    try:
        return protocol(find(Kind.DRIVE, name, str(Path.cwd()), DRIVES, place=here))
    except PluginError as error:
        raise ScenarioError(f"--protocol {name}: {error}") from error
