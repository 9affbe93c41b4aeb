"""Parameters that SDO messages read and write: the ones that matter to a host of two wheels.

An endpoint's number depends on the firmware: hosts take it from the vendor's `flat_endpoints.json`
of their version. The numbers here are this emulation's own; the names are the vendor's (0.6), and
`fleetloop can dump --decode` shows them.

    RxSdo   u8 opcode (0 read, 1 write), u16 endpoint, u8 0, value
    TxSdo   u8 0, u16 endpoint, u8 0, value     to reads; from firmware 0.6.11 on to writes too

Too short, an unknown endpoint or opcode, a write to what is read only, or a value that makes no
sense: no reply, nothing changes.
"""

import struct
from collections.abc import Callable, Mapping
from enum import Enum
from math import isfinite
from typing import NamedTuple


class Kind(Enum):
    """A value's type on the wire, little endian."""

    F32 = "<f"
    U32 = "<I"
    U8 = "<B"
    BOOL = "<?"


class Endpoint(NamedTuple):
    """One parameter; without `write` it is read only."""

    name: str
    kind: Kind
    read: Callable[[], float | int | bool]
    write: Callable[[float], None] | None = None


READ, WRITE = 0, 1
_HEADER = struct.Struct("<BHB")


def answer(table: Mapping[int, Endpoint], data: bytes, *, confirms_writes: bool) -> bytes | None:
    """Carry out an RxSdo; the TxSdo's data, None for no reply."""
    if len(data) < _HEADER.size:
        return None
    opcode, number, _ = _HEADER.unpack_from(data)
    endpoint = table.get(number)
    if endpoint is None or opcode not in (READ, WRITE):
        return None
    if opcode == WRITE:
        if endpoint.write is None or not _write(endpoint, data[_HEADER.size :]):
            return None
        if not confirms_writes:
            return None
    try:
        value = struct.pack(endpoint.kind.value, endpoint.read())
    except (struct.error, OverflowError):
        return None
    return _HEADER.pack(0, number, 0) + value


def _write(endpoint: Endpoint, data: bytes) -> bool:
    layout = endpoint.kind.value
    if endpoint.write is None or len(data) < struct.calcsize(layout):
        return False
    (value,) = struct.unpack_from(layout, data)
    if not isfinite(value):
        return False
    endpoint.write(value)
    return True
