"""Functions of a drive as endpoints: called by RxSdo with opcode 1 and the argument as value.

    function               argument    result          what it does
    save_configuration                 bool success    as Reboot 1: False while it isn't idle
    erase_configuration                                as Reboot 2
    reboot                                             as Reboot 0
    enter_dfu_mode2                                    as Reboot 3
    clear_errors                                       as Clear_Errors
    get_adc_voltage        uint32 gpio float voltage   0: nothing is connected to the pins

A call is answered with its result; without one, from firmware 0.6.11 on, with nothing but the
number. Names and arguments are the vendor's, numbers our own.
"""

import struct
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NamedTuple

from bridge.drives.odrive.frames import SDO, RebootAction

if TYPE_CHECKING:
    from bridge.drives.odrive.node import OdriveNode

FIRST = 1024
"""Numbers of functions begin here, so that values may be added before them."""
_CALL = 1


class Value(NamedTuple):
    """An argument or a result."""

    name: str
    code: str  # of `struct`


class Function(NamedTuple):
    """One function behind a number."""

    path: str
    call: Callable[["OdriveNode", int], float | None]
    """Drive, bus time; the result, if there is one."""
    result: Value | None = None
    argument: Value | None = None


def _restart(action: RebootAction) -> Callable[["OdriveNode", int], bool]:
    return lambda node, now_ns: node.restart(action, now_ns)


FUNCTIONS: Mapping[int, Function] = dict(
    enumerate(
        (
            Function(
                "save_configuration",
                _restart(RebootAction.SAVE_CONFIGURATION),
                result=Value("success", "?"),
            ),
            Function("erase_configuration", _restart(RebootAction.ERASE_CONFIGURATION)),
            Function("reboot", _restart(RebootAction.REBOOT)),
            Function("enter_dfu_mode2", _restart(RebootAction.ENTER_DFU_MODE)),
            Function("clear_errors", lambda node, _: node.clear_errors()),
            Function(
                "get_adc_voltage",
                lambda _, __: 0.0,
                result=Value("voltage", "f"),
                argument=Value("gpio", "I"),
            ),
        ),
        FIRST,
    )
)
"""By number; new ones go to the end, so that numbers stay."""


def answer(node: "OdriveNode", data: bytes, now_ns: int, *, confirms: bool) -> bytes | None:
    """The data of TxSdo in answer to an RxSdo that calls; None for no answer.

    `confirms`: calls without a result are answered too.
    """
    opcode, number, _ = SDO.unpack_from(data)
    function = FUNCTIONS[number]
    argument = function.argument
    size = SDO.size + (struct.calcsize(argument.code) if argument is not None else 0)
    if opcode != _CALL or len(data) < size:
        return None
    value = function.call(node, now_ns)
    head = SDO.pack(0, number, 0)
    if function.result is None or value is None:
        return head.ljust(8, b"\0") if confirms else None
    return (head + struct.pack(f"<{function.result.code}", value)).ljust(8, b"\0")
