"""Validation of the options of `can.Bus(interface="fleetloop", ...)`.

python-can's configuration files hold text, so text is accepted for every type. A wrong option is a
`can.CanInitializationError` that names the option, its value and a right one.
"""

from collections.abc import Collection, Mapping
from math import isfinite

import can
from can.util import cast_from_string

TLS = ("ca", "certificate", "private_key")
REMOTE = frozenset({"endpoint", "user", "password", "users", *TLS})
"""Options of a client on another machine: see `bridge.can_bus.credentials`."""
_IGNORED = frozenset({"bitrate", "data_bitrate", "timing", "single_handle", "ignore_config"})
"""Options of python-can's other interfaces without a meaning here."""
LONGEST_S = 1e6
"""Longer times are cut to this: the kernel's own have a bound."""
_TRUTHS = {"true": True, "1": True, "yes": True, "on": True, "": False}
_TRUTHS |= {"false": False, "0": False, "no": False, "off": False, "none": False}


def as_option(value: object) -> str:
    """An option of `can.Bus` as text, whether or not it came through python-can.

    python-can makes numbers and truth values of texts: "0123" becomes 123, "1.50" 1.5, "true" True.
    The router knows guests' passwords by what this makes of them: "123", "1.5", "true".
    """
    try:
        read = cast_from_string(value) if isinstance(value, str) else value
    except ValueError:  # more digits than Python makes a number of
        read = value
    return str(read).lower() if isinstance(read, bool) else str(read)


def remote(others: Mapping[str, object], keywords: Collection[str]) -> dict[str, str]:
    """The given options of a client on another machine; `keywords` are those of every client.

    Raises:
        TypeError: there is no such option.
    """
    if unknown := sorted(others.keys() - _IGNORED - REMOTE):
        known = ", ".join(sorted({*keywords, *REMOTE}))
        raise TypeError(
            f"the fleetloop interface has no option {', '.join(unknown)} (it has {known})"
        )
    return {key: as_option(others[key]) for key in sorted(REMOTE) if others.get(key) is not None}


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


def refuse_fd(channel: object, value: object) -> None:
    """Refuse CAN FD."""
    if truth("fd", value):
        raise can.CanInitializationError(f"bus {channel!r} is classic CAN: fd must be False")


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
