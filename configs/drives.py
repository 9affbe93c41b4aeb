"""Where the drive protocols are, by name; and their own keys of `[drive.options]`.

odrive            shipped: a row of `DRIVES`
my_drive:ROW      the value ROW of my_drive.py (or of the package my_drive) beside the scenario
                  file, else on sys.path: a `DriveProtocol`
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from configs.parameters import Parameters
from configs.plugins import Choice, Kind, Plugin, Recorded, find, load
from configs.tables import origin_of, validated

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import core_schema

    from configs.sections import Drive


@dataclass(frozen=True, slots=True, kw_only=True)
class NoOptions(Parameters):
    """A protocol without keys of its own."""


NO_OPTIONS = NoOptions()


DRIVES: Mapping[str, str] = {"odrive": "bridge.drives.odrive:ODRIVE"}
"""The protocols that are shipped: where each one's row is."""
ODRIVE = Choice(find(Kind.DRIVE, "odrive", "", DRIVES), NO_OPTIONS)


class ProtocolName(str):
    """The name of a protocol, and the folder of the file that has it.

    The folder comes with the context of the validation, as for `configs.choices`.
    """

    __slots__ = ("folder", "recorded")
    folder: str
    recorded: bool

    def __new__(cls, name: str, folder: str = "", *, recorded: bool = False) -> Self:
        """A name of a file in this folder; `recorded`: its module needn't be here."""
        made = super().__new__(cls, name)
        made.folder, made.recorded = folder, recorded
        return made

    def __getnewargs_ex__(self) -> Any:
        return (str(self), self.folder), {"recorded": self.recorded}

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: "GetCoreSchemaHandler") -> Any:
        """A text."""
        from pydantic_core import core_schema

        def made(text: str, info: "core_schema.ValidationInfo") -> ProtocolName:
            if isinstance(text, cls):
                return text
            folder, recorded = origin_of(info)
            return cls(text, folder, recorded=recorded)

        return core_schema.with_info_after_validator_function(
            made, core_schema.str_schema(strict=True)
        )


def choice_of(drive: "Drive") -> Choice:
    """The protocol of [drive] with its own keys, checked.

    Raises:
        PluginError: there is none of that name, or its module fails; the text is the remedy.
        ValidationError: a key or value of `[drive.options]` is wrong.
    """
    name = drive.protocol
    if name.recorded and name not in DRIVES:
        return Choice(Plugin(Kind.DRIVE, name, name), Recorded(tuple(drive.options.items())))
    plugin = find(Kind.DRIVE, str(name), name.folder, DRIVES)
    return Choice(plugin, validated(load(plugin).section, drive.options))
