"""Where the drive protocols are, by name; and their own keys of `[drive.options]`.

odrive            shipped: a row of `DRIVES`
my_drive:ROW      the value ROW of an importable module my_drive, a `DriveProtocol`
"""

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from configs.errors import ScenarioError
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
        ScenarioError: there is none of that name; the text is the remedy.
    """
    target = DRIVES.get(name, name)
    module_name, _, row = target.partition(":")
    if not module_name or not row:
        known = ", ".join(DRIVES)
        raise ScenarioError(f'no such protocol (known: {known}; one of your own is "module:ROW")')
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise ScenarioError(f"module {module_name}: {error}") from error
    found = getattr(module, row, None)
    if not all(hasattr(found, end) for end in ("client", "node", "section")):
        raise ScenarioError(f"{row} of module {module_name} is no bridge.drives.DriveProtocol")
    return found


def options_of(drive: "Drive") -> Parameters:
    """The protocol's own keys, checked.

    Raises:
        ScenarioError: there is no such protocol.
        ValidationError: a key or value is wrong.
    """
    from pydantic import TypeAdapter

    options: Parameters = TypeAdapter(load(drive.protocol).section).validate_python(drive.options)
    return options
