"""Bytes of a message: a msgpack array that begins with the version of its layout.

Reading is bounded: too long, not msgpack, a wrong length or an unknown version give None, never an
exception. Text is for people: what doesn't print, such as a terminal's escapes, is replaced.
"""

from math import isfinite
from typing import Any, Final

import msgpack

VERSION: Final = 1
MAX_BYTES: Final = 1 << 18
"""Of any message."""
_MAX_INT: Final = 1 << 63
_PACKER: Final = msgpack.Packer()
"""One for all: making one, as `packb` does for each message, costs more than what it packs."""


def pack(*fields: object) -> bytes:
    """The array of the version and these fields."""
    packed: bytes = _PACKER.pack((VERSION, *fields))
    return packed


def unpack(payload: bytes, length: int) -> list[Any] | None:
    """The array in the bytes, version included; None unless it has so many elements."""
    if len(payload) > MAX_BYTES:
        return None
    try:
        fields = msgpack.unpackb(payload)
    except (ValueError, TypeError, RecursionError, msgpack.UnpackException):
        return None
    if type(fields) is not list or len(fields) != length or fields[0] != VERSION:
        return None
    return fields


def ints(values: list[Any]) -> bool:
    """Whether all are integers of 64 bits."""
    return all(type(value) is int and -_MAX_INT <= value < _MAX_INT for value in values)


def finite(values: list[Any]) -> bool:
    """Whether all are finite floats."""
    return all(type(value) is float and isfinite(value) for value in values)


def printable(text: str) -> str:
    """Text as it may be shown: lines, but nothing that a terminal would obey or hide."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in text)
