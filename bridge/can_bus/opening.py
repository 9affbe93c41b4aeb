"""Open a CAN bus of whatever interface, the settings as the deployment gives them."""

from typing import Any

import can

from configs.brief import Settings
from configs.errors import InfrastructureError


def open_bus(who: str, settings: Settings) -> can.BusABC:
    """`can.Bus(**settings)`, verbatim: python-can checks what its interface takes.

    Raises:
        InfrastructureError: naming who wanted it, the interface, the channel and the reason.
    """
    options: dict[str, Any] = dict(settings)
    try:
        return can.Bus(**options)
    # Interfaces raise what their libraries raise: a missing device is an OSError on SocketCAN and
    # a serial.SerialException on slcan, a wrong option a TypeError.
    except (can.CanError, OSError, TypeError, ValueError, ImportError) as error:
        named = f"{options.get('interface')} channel {options.get('channel')!r}"
        raise InfrastructureError(f"{who}: no CAN bus: {named}: {error}") from error
