"""Where the drive protocols are, by name; and their own keys of `[drive.options]`.

odrive            shipped: a row of `DRIVES`
my_drive:ROW      the value ROW of an importable module my_drive, a `DriveProtocol`
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from configs import plugins
from configs.parameters import Parameters

if TYPE_CHECKING:
    from configs.sections import Drive


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOptions(Parameters):
    """A protocol without keys of its own."""


NO_OPTIONS = NoOptions()


DRIVES: Mapping[str, str] = {"odrive": "bridge.drives.odrive:ODRIVE"}
"""The protocols that are shipped: where each one's row is."""


def load(name: str) -> Any:
    """The row of a protocol, a `bridge.drives.interface.DriveProtocol`.

    Raises:
        PluginError: there is none of that name, or its module fails; the text is the remedy.
    """
    return plugins.load(plugins.find(plugins.Kind.DRIVE, name, "", DRIVES))


def options_of(drive: "Drive") -> Parameters:
    """The protocol's own keys, checked.

    Raises:
        PluginError: there is no such protocol.
        ValidationError: a key or value is wrong.
    """
    from pydantic import TypeAdapter

    options: Parameters = TypeAdapter(load(drive.protocol).section).validate_python(drive.options)
    return options
