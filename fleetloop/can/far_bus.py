"""The other bus of a gateway: any that python-can opens, named on the command line."""

from dataclasses import dataclass
from typing import Any, Self

import can

from bridge.can_bus.echo import hands_back
from configs.errors import InfrastructureError, ScenarioError


@dataclass(frozen=True, slots=True)
class FarBus:
    """The other bus, as python-can opens it."""

    interface: str
    channel: str | None
    options: dict[str, Any]  # whatever the interface takes
    echoes: bool

    @classmethod
    def parse(
        cls,
        interface: str,
        channel: str | None,
        bitrate: int | None,
        pairs: list[str],
        echo: str,
    ) -> Self:
        """From the command line.

        Raises:
            ScenarioError: an option is no KEY=VALUE, or `echo` is none of auto, yes, no.
        """
        if echo not in ("auto", "yes", "no"):
            raise ScenarioError(f"--echo {echo}: right are auto, yes and no")
        options: dict[str, Any] = {}
        for pair in pairs:
            key, equals, value = pair.partition("=")
            if not equals or not key.isidentifier():
                raise ScenarioError(f"--option {pair}: right is KEY=VALUE, e.g. rtscts=true")
            options[key] = _value(value)
        if bitrate is not None:
            options["bitrate"] = bitrate
        echoes = echo == "yes"
        if echo == "auto":
            echoes = hands_back((("interface", interface), *options.items()))
        return cls(interface, channel, options, echoes)

    @property
    def name(self) -> str:
        """For people."""
        return f"{self.interface} {self.channel or ''}".rstrip()

    def open(self) -> can.BusABC:
        """Open it.

        Raises:
            InfrastructureError: python-can can't; the text is python-can's.
        """
        try:
            return can.Bus(channel=self.channel, interface=self.interface, **self.options)
        except (can.CanError, OSError, ValueError, TypeError, ImportError, NameError) as error:
            raise InfrastructureError(f"can't open {self.name}: {error}") from error


def _value(text: str) -> bool | int | float | str:
    match text.lower():
        case "true" | "yes":
            return True
        case "false" | "no":
            return False
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
