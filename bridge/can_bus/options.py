"""Validation of the options of `can.Bus(interface="fleetloop", ...)`.

python-can's configuration files hold text, so text is accepted for every type. A wrong option is a
`can.CanInitializationError` that names the option, its value and a right one.
"""

from math import isfinite

import can

from bridge.can_bus.credentials import as_option

LONGEST_S = 1e6
"""Longer times are cut to this: the kernel's own have a bound."""
_TRUTHS = {"true": True, "1": True, "yes": True, "on": True, "": False}
_TRUTHS |= {"false": False, "0": False, "no": False, "off": False, "none": False}


def truth(name: str, value: object) -> bool:
    """Whether an option is set."""
    if value is None or isinstance(value, bool):
        return bool(value)
    known = _TRUTHS.get(str(value).lower()) if isinstance(value, str | int) else None
    if known is None:
        raise _wrong(name, value, "must be true or false")
    return known


def seconds(name: str, value: object) -> float:
    """A time above 0."""
    if isinstance(value, bool):
        raise _wrong(name, value, "must be a number of seconds above 0")
    try:
        found = float(value) if isinstance(value, str | float | int) else 0.0
    except (ValueError, OverflowError):
        found = 0.0
    if not (isfinite(found) and found > 0.0):
        raise _wrong(name, value, "must be a number of seconds above 0")
    return min(found, LONGEST_S)


def channel_name(value: object) -> str:
    """What names a bus."""
    if not isinstance(value, str | int | float) or not str(value).strip():
        raise _wrong(
            "channel",
            value,
            'must be a bus ("r1"), run and bus ("RUN/r1") or the path of the bus\'s socket;'
            " fleetloop can list says what is up",
        )
    return as_option(value)


def controller(value: object, secret: object) -> tuple[str, str]:
    """Robot and secret of a synchronous client; both "" for any other client."""
    if value is None or value is False or value == "":
        return "", ""
    if not isinstance(value, str) or not isinstance(secret, str):
        raise _wrong(
            "synchronous", value, "must name the robot whose controller this is, with its secret"
        )
    return value, secret


def _wrong(name: str, value: object, remedy: str) -> can.CanInitializationError:
    return can.CanInitializationError(f"{name} = {value!r}: {remedy}")
