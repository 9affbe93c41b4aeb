"""The frames of an axis as `fleetloop can dbc` describes them: made of the table of layouts.

Names are those of the vendor's database. The value of RxSdo and TxSdo is multiplexed by the number
of its endpoint: numbers, types and access are those of `endpoints` and `functions`.
"""

import struct
from collections.abc import Iterator, Mapping
from enum import IntEnum, IntFlag

from bridge.drives.interface import MessageFormat, SignalFormat
from bridge.drives.odrive import frames as f
from bridge.drives.odrive.decoder import ERRORS, LAYOUTS, Layout, Signal, is_answered, name_of
from bridge.drives.odrive.endpoints import ENDPOINTS
from bridge.drives.odrive.frames import Command
from bridge.drives.odrive.functions import FUNCTIONS

_SDO_VALUE_BIT = 8 * f.SDO.size
_DROPPED = ("axis0", "config", "controller")
"""Parts of a path that the name of its signal does without: names have 32 characters at most."""
_COMMENTS: Mapping[Command, str] = {
    Command.ESTOP: "disarms the axis with ESTOP_REQUESTED",
    Command.RX_SDO: "reads (opcode 0), writes or calls (opcode 1) an endpoint",
    Command.TX_SDO: "the answer to RxSdo",
    Command.ADDRESS: "of the drive: its address; of the host: the new address of a serial number",
    Command.REBOOT: "takes effect while the axis is idle, but for REBOOT",
    Command.SET_INPUT_TORQUE: "torque of the motor's shaft; feeds the watchdog",
}


def formats(node: int) -> tuple[MessageFormat, ...]:
    """All messages of a node."""
    return tuple(_message(node, command, layout) for command, layout in LAYOUTS.items())


def _message(node: int, command: Command, layout: Layout) -> MessageFormat:
    sdo = command in (Command.RX_SDO, Command.TX_SDO)
    from_drive = command is Command.TX_SDO or is_answered(command)
    comment = _COMMENTS.get(command, "")
    if command.name.startswith("GET_"):
        comment = "a remote frame, or an empty one, with this identifier asks for it"
    return MessageFormat(
        f.identifier(node, command),
        name_of(command),
        layout.packed.size,
        from_drive=from_drive,
        from_host=command is Command.ADDRESS or not from_drive,
        signals=tuple(_sdo(command, layout) if sdo else _signals(layout)),
        comment=comment,
    )


def _fields(layout: Layout) -> Iterator[tuple[str, int, int]]:
    """(code, first bit, bits) of a layout's signals; the last one has all fields that are left."""
    at, found = 0, []
    for code in _spelled(layout.packed.format):
        bits = 8 * struct.calcsize(f"<{code}")
        if code != "x":
            found.append((code, at, bits))
        at += bits
    if layout.signals:
        *head, (code, first, _) = found[: len(layout.signals)]
        _, last, bits = found[-1]
        yield from head
        yield code, first, last + bits - first


def _spelled(form: str) -> Iterator[str]:
    """Codes of a format one by one: "8B" has eight."""
    count = ""
    for char in form.lstrip("<"):
        if char.isdigit():
            count += char
        else:
            yield from char * int(count or 1)
            count = ""


def _signals(layout: Layout) -> Iterator[SignalFormat]:
    for signal, (code, first, bits) in zip(layout.signals, _fields(layout), strict=True):
        yield _signal(signal, code, first, min(bits, signal.bits.bit_length()))


def _signal(signal: Signal, code: str, first: int, bits: int) -> SignalFormat:
    meaning: type[IntEnum | IntFlag] | None = signal.meaning
    if signal.name in ERRORS:
        meaning = f.AxisError
    values = {int(one): str(one.name) for one in meaning} if meaning is not None else {}
    if signal.name in ERRORS:
        values = {0: "NO_ERROR"} | values
    return SignalFormat(
        signal.name,
        first,
        bits,
        is_float=code == "f",
        signed=code.islower() and code != "f",
        scale=signal.scale,
        unit=signal.unit,
        values=values,
        comment="bits; several may be set" if signal.name in ERRORS else "",
    )


def _sdo(command: Command, layout: Layout) -> Iterator[SignalFormat]:
    """The fields, and instead of the value those of every endpoint."""
    *head, _ = _signals(layout)
    for signal in head:
        yield signal._replace(selects=signal.name == "Endpoint_ID")
    for number, path, code, comment in _values(command):
        yield SignalFormat(
            signal_name(path),
            _SDO_VALUE_BIT,
            8 * struct.calcsize(f"<{code}"),
            is_float=code == "f",
            selected_by=number,
            comment=comment,
        )


def _values(command: Command) -> Iterator[tuple[int, str, str, str]]:
    """(number, path, code of `struct`, comment) of every endpoint; a call without a value has 0."""
    for number, endpoint in ENDPOINTS.items():
        access = "read only" if endpoint.write is None else "read and write"
        yield number, endpoint.path, endpoint.code, f"{endpoint.path}, {access}"
    for number, function in FUNCTIONS.items():
        value = function.argument if command is Command.RX_SDO else function.result
        about = f"{function.path}({function.argument.name if function.argument else ''})"
        if function.result is not None:
            about += f" gives {function.result.name}"
        yield number, function.path, value.code if value else "I", about


def signal_name(path: str) -> str:
    """A name for the value of an endpoint: "axis0.config.can.node_id" is "can_node_id"."""
    return "_".join(part for part in path.split(".") if part not in _DROPPED)
