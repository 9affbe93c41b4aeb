"""CAN frames as text, byte for byte as can-utils writes and reads them (`lib.h` of can-utils).

    compact   044#2A366C2BBA   1F334455#R8   20000004#0000000000000000     candump -L, cansend
    long      044   [5]  2A 36 6C 2B BA                                    candump

    identifier   3 hex digits: 11-bit; 8: 29-bit, or an error frame with its ERR bit (2.......)
    data         0..8 bytes; `R` and an optional length for a remote frame

Everything is pure; what can't be a classic frame is refused with what would be right.
"""

import re

from bridge.frame import EFF, ERR, ID_MASK_11, ID_MASK_29, MAX_DATA, RTR, Frame
from configs.errors import ScenarioError

DATA_COLUMNS = 3 * MAX_DATA
_HEAD_COLUMNS = 10
_INDENT = " " * 5
_FORM = re.compile(r"(?P<id>[^#]*)#(?P<body>.*)", re.DOTALL)
_HEX = re.compile(r"[0-9A-Fa-f]+")
_REMOTE = re.compile(r"[Rr](?P<length>[0-8]?)")
_DATA = re.compile(r"(?:\.?[0-9A-Fa-f]{2})*")


def compact(frame: Frame) -> str:
    """The frame as `candump -L` prints it and `cansend` reads it."""
    can_id, data = frame.can_id, frame.data
    head = f"{_identifier(can_id)}#"
    if can_id & RTR and not can_id & ERR:
        return f"{head}R{len(data) or ''}"
    return head + data.hex().upper()


def long(frame: Frame, *, indent: bool = False, ascii_too: bool = False) -> str:
    """The frame as candump prints it for people, without time stamp and interface.

    Args:
        frame: what to print.
        indent: shift an 11-bit identifier to where a 29-bit one ends.
        ascii_too: append the data as characters.
    """
    can_id, data = frame.can_id, frame.data
    shift = _INDENT if indent and not can_id & (EFF | ERR) else ""
    head = f"{shift}{_identifier(can_id)}   [{len(data)}] "
    if can_id & RTR and not can_id & ERR:
        return f"{head} remote request"
    line = head + "".join(f" {byte:02X}" for byte in data)
    missing = 3 * (MAX_DATA - len(data))
    if can_id & ERR:
        return line + "ERRORFRAME".rjust(missing + 13)
    if ascii_too:
        shown = "".join(chr(byte) if 0x1F < byte < 0x7F else "." for byte in data)
        return line + "'".rjust(missing + 4) + shown + "'"
    return line


def long_columns(*, indent: bool) -> int:
    """The columns that `long` takes with 8 bytes of data."""
    return _HEAD_COLUMNS + DATA_COLUMNS + (len(_INDENT) if indent else 0)


def parse(text: str) -> Frame:
    """The frame that a text in cansend's syntax means.

    Raises:
        ScenarioError: it is none, or not a frame of classic CAN.
    """
    form = _FORM.fullmatch(text)
    if form is None:
        raise _wrong(text, "there is no '#' between identifier and data")
    can_id = _parse_identifier(text, form["id"])
    body = form["body"]
    if body.startswith("#"):
        raise _wrong(text, "'##' means CAN FD; the bus is classic CAN")
    if "_" in body:
        raise _wrong(text, "a raw length code ('_9' to '_F') is not carried by this bus")
    if remote := _REMOTE.fullmatch(body):
        if can_id & ERR:
            raise _wrong(text, "an error frame can't be remote")
        return Frame(can_id | RTR, bytes(int(remote["length"] or 0)))
    if body[:1] in ("R", "r"):
        raise _wrong(text, f"the length of a remote frame is 0 to 8, not {body[1:]!r}")
    if not _DATA.fullmatch(body):
        raise _wrong(text, f"{body!r} is not pairs of hex digits, optionally parted by '.'")
    data = bytes.fromhex(body.replace(".", ""))
    if len(data) > MAX_DATA:
        raise _wrong(text, f"{len(data)} bytes of data; classic CAN carries up to 8")
    return Frame(can_id, data)


def _parse_identifier(text: str, digits: str) -> int:
    if len(digits) not in (3, 8) or not _HEX.fullmatch(digits):
        raise _wrong(text, f"identifier {digits!r} is not 3 (11-bit) or 8 (29-bit) hex digits")
    number = int(digits, 16)
    if len(digits) == 3:
        if number > ID_MASK_11:
            raise _wrong(text, f"the largest 11-bit identifier is 7FF, not {digits}")
        return number
    if number <= ID_MASK_29:
        return number | EFF
    if number < ERR << 1:
        return number
    raise _wrong(text, f"the largest 29-bit identifier is 1FFFFFFF, not {digits}")


def _identifier(can_id: int) -> str:
    if can_id & ERR:
        return f"{can_id & (ID_MASK_29 | ERR):08X}"
    if can_id & EFF:
        return f"{can_id & ID_MASK_29:08X}"
    return f"{can_id & ID_MASK_11:03X}"


def _wrong(text: str, why: str) -> ScenarioError:
    return ScenarioError(
        f"frame {text!r}: {why}; right are 123#DEADBEEF, 123#, 123#R, 123#R8, 1F334455#11.22.33"
    )
